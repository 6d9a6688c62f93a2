"""Driving violation cause analysis on SUMO: which component did it, and which message to open first."""

import importlib
import os
import sys
from typing import TYPE_CHECKING

# One thread in numpy's linear algebra: how a product is shared out among threads decides its last bits,
# the arrays are small, and a process with threads cannot be forked.
os.environ["OPENBLAS_NUM_THREADS"] = "1"
if "numpy" in sys.modules:  # and has read its environment
    importlib.import_module("threadpoolctl").threadpool_limits(limits=1, user_api="blas")

if TYPE_CHECKING:
    from dvca_sumo.api import attribute, drive, load_scenario

__all__ = ["attribute", "drive", "load_scenario"]


def __getattr__(name: str) -> object:
    """The three calls, loaded when first used: a part of the package must not cost the whole of it."""
    if name in __all__:
        return getattr(importlib.import_module("dvca_sumo.api"), name)
    raise AttributeError(f"module 'dvca_sumo' has no attribute {name!r}")
