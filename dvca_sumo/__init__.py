"""Driving violation cause analysis on SUMO: which component did it, and which message to open first."""

import os

# One thread in numpy's linear algebra: the arrays are small, sums keep one order, and a process
# with threads cannot be forked.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
