"""Plane geometry without effects: angles, oriented boxes, polylines and Frenet projection."""
