"""Whose doing a violation is: the driver's, another's, or the simulator's."""
