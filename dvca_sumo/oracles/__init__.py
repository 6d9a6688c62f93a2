"""Oracles: one rule each, judged on recorded ground truth, with three answers."""

from collections.abc import Iterable, Sequence

from dvca_sumo.oracles.collision import Collision
from dvca_sumo.oracles.destination import Destination
from dvca_sumo.oracles.no_progress import NoProgress
from dvca_sumo.oracles.place import Places
from dvca_sumo.oracles.protocol import Oracle
from dvca_sumo.oracles.red_light import RedLight
from dvca_sumo.oracles.road_departure import RoadDeparture
from dvca_sumo.oracles.speed_limit import SpeedLimit
from dvca_sumo.oracles.stop_line import StopAtLine
from dvca_sumo.oracles.ttc import TimeToCollision
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Ending, Judgement

__all__ = ["ORACLES", "Oracle", "Places", "judge", "judges"]

ORACLES: tuple[type[Oracle], ...] = (
    Collision,
    TimeToCollision,
    SpeedLimit,
    RoadDeparture,
    RedLight,
    StopAtLine,
    Destination,
    NoProgress,
)


def judges(places: Places, thresholds: Thresholds) -> tuple[Oracle, ...]:
    """All oracles for one run of one ego along the route of `places`, at its beginning."""
    return tuple(oracle(places, thresholds) for oracle in ORACLES)


def judge(moments: Iterable[Moment], oracles: Sequence[Oracle], ended: Ending) -> tuple[Judgement, ...]:
    """What fresh `oracles` say of a whole recorded run, in their order."""
    for moment in moments:
        for oracle in oracles:
            oracle.observe(moment)
    return tuple(oracle.conclude(ended) for oracle in oracles)
