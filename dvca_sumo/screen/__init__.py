"""Screening: how well the healthy ADS drives trips of a scenario's own traffic, beside SUMO's own drivers."""
