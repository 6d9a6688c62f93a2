"""Planning: previous trajectory -> start -> path decision -> ST graph -> speed -> trajectory."""

from dvca_sumo.stack.planning.config import PlanningConfig
from dvca_sumo.stack.planning.planner import Planner

__all__ = ["Planner", "PlanningConfig"]
