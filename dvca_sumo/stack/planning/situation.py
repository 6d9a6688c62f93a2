"""What the path decision of one cycle looks at."""

import msgspec

from dvca_sumo.stack.planning.junctions import LineView
from dvca_sumo.stack.planning.moves import Lateral
from dvca_sumo.stack.planning.reference import Window
from dvca_sumo.stack.planning.scene import Scene


class Situation(msgspec.Struct, frozen=True, eq=False):
    """The ego and what is around it, in window coordinates."""

    time: float  # [s]
    speed: float  # [m/s] of the ego
    lateral: Lateral
    window: Window
    scene: Scene
    views: list[LineView]
