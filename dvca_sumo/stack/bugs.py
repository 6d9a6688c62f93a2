"""Real bugs of real stacks, each rebuilt as one switch of the reference stack's configuration.

What each one was is told by its source; the code that a switch selects stands in the component.
"""

from difflib import get_close_matches

import msgspec
from msgspec.structs import replace

from dvca_sumo.messages import Component
from dvca_sumo.stack.reference import StackConfig


class BugError(ValueError):
    """There is no such bug."""


class Bug(msgspec.Struct, frozen=True):
    """A fault in code or configuration: the build that has it differs from the fixed one in `switches` alone."""

    component: Component
    summary: str
    source: str
    switches: dict[str, bool | float]  # field of the component's configuration -> its value in the buggy build


BUGS: dict[str, Bug] = {
    "apollo-6826": Bug(
        component=Component.PLANNING,
        summary="decides to pass an object by the free width of the lane, never by the distance to its own path",
        source="Apollo pull request 6826 (4a9a7f0c5, 2019-02-12)",
        switches={"trusts_lane_room": True},
    ),
    "apollo-3257": Bug(
        component=Component.PLANNING,
        summary="stops with its rear axle at the stop line: the front overhang is not subtracted",
        source="Apollo pull request 3257 (a1cff5e9b, 2018-03-07)",
        switches={"lines_at_rear_axle": True},
    ),
    "apollo-10706": Bug(
        component=Component.PLANNING,
        summary="drives at the planner's upper bound where the map has no speed limit, not at the road type's default",
        source="Apollo pull request 10706 (2020)",
        switches={"unmapped_at_bound": True},
    ),
    "apollo-cc890a4": Bug(
        component=Component.PLANNING,
        summary="stops 5 m past the near end of an object that stands in the way: the stop distance has the wrong sign",
        source="Apollo commit cc890a4eb (2017-08-14)",
        switches={"stops_past_objects": True},
    ),
    "apollo-3634": Bug(
        component=Component.PERCEPTION,
        summary="swaps length and width of its boxes: what stands across the road seems to stand along it",
        source="Apollo pull request 3634 (56586a54c, 2018-03-29)",
        switches={"swaps_sides": True},
    ),
    "planfuzz-v1": Bug(
        component=Component.PLANNING,
        summary="takes a lane for blocked by what stands beside it: the lateral buffer of static objects is too large",
        source="PlanFuzz V1, Apollo issue 13922 (2021-07-05)",
        switches={"lateral_buffer": 0.8},
    ),
    "planfuzz-v7": Bug(
        component=Component.PLANNING,
        summary="waits at a stop sign for parked bicycles beside another approach, off its lane, without end",
        source="PlanFuzz V7, Apollo issue 13926 (2021-07-06)",
        switches={"watch_beside": 5.0},
    ),
    "apollo-c803010": Bug(
        component=Component.PLANNING,
        summary="looks for the destination on the route at (x, x) instead of (x, y), and does not stop where it is not",
        source="Apollo commit c80301050 (2017-08-18)",
        switches={"projects_x_twice": True},
    ),
}


def build_with(name: str, config: StackConfig) -> StackConfig:
    """The build of the reference stack that has the bug.

    Raises:
        BugError: No bug has that name.
    """
    if name not in BUGS:
        nearest = get_close_matches(name, BUGS, 1, 0.0)
        raise BugError(f"no bug {name!r} (allowed: {', '.join(BUGS)}); did you mean {nearest[0]!r}?")
    bug = BUGS[name]
    table = replace(getattr(config, bug.component.value), **bug.switches)
    return replace(config, **{bug.component.value: table})
