"""What is told apart: the simulator's doing, the other one's, the driver's."""

import math
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
import pytest
from moments import LANE_Y, Row, cruise, moment, places

from dvca_sumo.messages import ObjectClass
from dvca_sumo.oracles.collision import Collision
from dvca_sumo.oracles.destination import Destination
from dvca_sumo.oracles.protocol import Oracle
from dvca_sumo.oracles.speed_limit import SpeedLimit
from dvca_sumo.oracles.ttc import TimeToCollision
from dvca_sumo.responsibility.disturbances import Disturbances
from dvca_sumo.responsibility.judging import AtFault, judged
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Answer, Category, Ending, Judgement, Violation


@pytest.fixture(scope="module")
def roads(street: Path) -> RoadMap:
    return RoadMap.load(street)


def disturbances(moments: Sequence[Moment], roads: RoadMap) -> list[tuple[str, str]]:
    found = Disturbances(places(roads))
    for one in moments:
        found.see(one)
    return [(one.object, one.how) for one in found.found]


def at_contact(moments: Sequence[Moment], roads: RoadMap) -> list[tuple[str, AtFault]]:
    """Kinds and faults of a drive that ends with the last of `moments`."""
    where = places(roads)
    oracle, watch = Collision(where, Thresholds()), Disturbances(where)
    for one in moments:
        oracle.observe(one)
        watch.see(one)
    found = judged([oracle.conclude(Ending.CUT)], watch, moments[-1], roads)
    return [(one.violation.kind, one.fault) for one in found]


def on_foot(one: Moment) -> Moment:
    """The same, the others being people."""
    objects = one.objects
    boxes = objects.boxes.copy()
    boxes[:, 3:] = 0.5
    classes = np.full_like(objects.classes, int(ObjectClass.PEDESTRIAN))
    return msgspec.structs.replace(one, objects=msgspec.structs.replace(objects, boxes=boxes, classes=classes))


def test_a_body_that_appears_within_braking_distance_is_the_simulators_doing(roads: RoadMap) -> None:
    before = cruise(1.0, 12.0)
    near, far = ("new", (52.0 + 10.0, LANE_Y), 0.0), ("new", (52.0 + 60.0, LANE_Y), 0.0)
    assert disturbances([*before, moment(1.1, 53.2, 12.0, [near])], roads) == [("new", "appeared")]
    assert disturbances([*before, moment(1.1, 53.2, 12.0, [far])], roads) == []
    fleeing = ("new", (52.0 + 10.0, LANE_Y), 12.0)
    assert disturbances([*before, moment(1.1, 53.2, 12.0, [fleeing])], roads) == []


def test_a_body_that_jumps_into_the_way_is_and_one_that_drives_there_is_not(roads: RoadMap) -> None:
    beside: Row = ("car", (58.0, LANE_Y + 3.2), 4.0)
    into: Row = ("car", (58.4, LANE_Y), 4.0)
    assert disturbances([moment(0.0, 50.0, 12.0, [beside]), moment(0.1, 51.2, 12.0, [into])], roads) == [
        ("car", "jumped")
    ]
    slowly = [
        moment(0.1 * k, 50.0 + 1.2 * k, 12.0, [("car", (62.0 + 0.4 * k, LANE_Y + 3.2 - 0.3 * k), 4.0)])
        for k in range(8)
    ]
    assert disturbances(slowly, roads) == []


def test_a_body_that_jumps_is_told_by_its_speed_before_not_by_that_of_the_jump(roads: RoadMap) -> None:
    """Bodies have the speed at which they are moved: a jump is as fast as it is far."""
    rows: list[Row] = [("car", (58.0, LANE_Y + 3.5), 10.0), ("car", (60.0, LANE_Y + 1.9), 20.0)]
    jump = [moment(0.1 * k, 60.0 + 2.5 * k, 25.0, [row]) for k, row in enumerate(rows)]
    assert disturbances(jump, roads) == [("car", "jumped")]


def test_a_body_that_turns_on_the_spot_sweeps_over_the_road_at_no_speed_of_its_own(roads: RoadMap) -> None:
    """Its front hardly moves: its rear leaps into the way."""

    def turned(time: float, heading: float) -> Moment:
        one = moment(time, 50.0 + 5.0 * time, 5.0, [("car", (0.0, 0.0), 0.0)])
        x, y = 54.0 - 2.3 * math.cos(heading), LANE_Y + 3.5 - 2.3 * math.sin(heading)
        boxes = np.array([[x, y, heading, 4.6, 1.8]])
        return msgspec.structs.replace(one, objects=msgspec.structs.replace(one.objects, boxes=boxes))

    assert disturbances([turned(0.0, -math.pi / 2.0), turned(0.1, math.pi / 2.0)], roads) == [("car", "jumped")]
    slowly = [turned(0.1 * k, -math.pi / 2.0 + 0.1 * k) for k in range(20)]
    assert disturbances(slowly, roads) == []


@pytest.mark.parametrize(("speed", "fault"), [(6.0, AtFault.SIMULATOR), (1.0, AtFault.OTHER)])
def test_a_body_that_jumps_and_touches_the_ego_before_anybody_reacts_is_the_simulators_doing(
    roads: RoadMap, speed: float, fault: AtFault
) -> None:
    """It turns round on the spot beside the ego, and drives at its flank."""

    def turned(time: float, heading: float, gap: float) -> Moment:
        one = moment(time, 50.0 + 0.5 * time, 0.5, [("car", (0.0, 0.0), 0.0)])
        boxes = np.array([[48.0, LANE_Y + 0.9 + gap + 2.3, heading, 4.6, 1.8]])
        objects = msgspec.structs.replace(one.objects, boxes=boxes, velocities=np.array([[0.0, -speed]]))
        return msgspec.structs.replace(one, objects=objects)

    driven = [turned(0.1 * k, -math.pi / 2.0, 1.5 - 0.1 * speed * k) for k in range(1, 17)]
    touching = next(k for k, one in enumerate(driven) if one.objects.boxes[0, 1] - 2.3 <= LANE_Y + 0.9)
    moments = [turned(0.0, math.pi / 2.0, 1.5), *driven[: touching + 1]]
    assert at_contact(moments, roads)[-1] == ("collision", fault)


def test_what_a_jump_brings_about_is_the_simulators_doing_though_the_body_jumps_again_later(roads: RoadMap) -> None:
    watch = Disturbances(places(roads))
    for k in range(9):
        aside = 3.0 * (k >= 4) - 3.0 * (k >= 7)
        watch.see(moment(0.1 * k, 50.0 + 2.5 * k, 25.0, [("car", (90.0 + 1.6 * k, LANE_Y + 6.0 - aside), 16.0)]))
    explained = [watch.explain("car", time) for time in (0.45, 0.75)]
    assert [(one.how, round(one.time, 1)) for one in explained if one] == [("jumped", 0.4), ("jumped", 0.7)]


def test_a_body_that_turns_on_the_spot_beside_the_nose_swings_its_tail_into_the_way(roads: RoadMap) -> None:
    """Its nose stays beside the ego's: along the way, it is not ahead."""

    def turned(time: float, heading: float) -> Moment:
        one = moment(time, 50.0 + 4.4 * time, 4.4, [("car", (0.0, 0.0), 0.0)])
        nose = np.array([49.5, LANE_Y + 2.4])
        middle = nose - 2.3 * np.array([math.cos(heading), math.sin(heading)])
        objects = msgspec.structs.replace(one.objects, boxes=np.array([[*middle, heading, 4.6, 1.8]]))
        return msgspec.structs.replace(one, objects=objects)

    assert disturbances([turned(0.0, -0.6), turned(0.1, math.pi - 0.5)], roads) == [("car", "jumped")]


@pytest.mark.parametrize(("aside", "expected"), [(0.6, [("person:p", "jumped")]), (0.3, [])])
def test_a_person_who_is_set_down_in_the_way_is_the_simulators_doing_and_one_who_steps_aside_is_not(
    roads: RoadMap, aside: float, expected: list[tuple[str, str]]
) -> None:
    beside, into = (("person:p", (52.0, LANE_Y - 1.4 + way), 0.0) for way in (0.0, aside))
    moments = [moment(0.0, 50.0, 5.0, [beside]), moment(0.1, 50.5, 5.0, [into])]
    assert disturbances([on_foot(one) for one in moments], roads) == expected


@pytest.mark.parametrize(("beside", "expected"), [(0.5, [("person:p", "appeared")]), (1.0, [])])
def test_a_person_who_appears_a_step_beside_the_ego_is_the_simulators_doing(
    roads: RoadMap, beside: float, expected: list[tuple[str, str]]
) -> None:
    appears = moment(1.1, 53.2, 12.0, [("person:p", (50.0, LANE_Y - 0.9 - beside - 0.25), 0.0)])
    assert disturbances([on_foot(one) for one in (*cruise(1.0, 12.0), appears)], roads) == expected


@pytest.mark.parametrize(("stood", "fault"), [(0.5, AtFault.OTHER), (2.0, AtFault.SIMULATOR)])
def test_a_person_who_walks_into_an_ego_that_has_stood_is_the_simulators_doing(
    roads: RoadMap, stood: float, fault: AtFault
) -> None:
    steps = 10 + round(10.0 * stood)
    moments = []
    for k in range(steps + 1):
        walker: Row = ("person:p", (42.0, LANE_Y - 1.1 - 0.12 * (steps - k)), 1.2)
        moments.append(moment(0.1 * k, min(40.0 + 0.4 * k, 44.0), 4.0 if k <= 10 else 0.0, [walker]))
    assert at_contact([on_foot(one) for one in moments], roads) == [("collision", fault)]


def test_a_jump_behind_or_far_beside_changes_nothing(roads: RoadMap) -> None:
    for x, y in ((20.0, LANE_Y), (60.0, LANE_Y + 9.6)):
        jump = [moment(0.1 * k, 50.0 + k, 10.0, [("car", (x + 5.0 * k, y), 4.0)]) for k in range(3)]
        assert disturbances(jump, roads) == []


def test_a_contact_that_follows_from_a_conflict_of_the_simulators_doing_is_so_too(roads: RoadMap) -> None:
    """It jumps to the side of the way and crosses it: no time is left when anybody could react."""

    def crossing(time: float, y: float) -> Moment:
        one = moment(time, 50.0 + 10.0 * time, 10.0, [("car", (0.0, 0.0), 0.0)])
        boxes = np.array([[57.0, y, -math.pi / 2.0, 4.6, 1.8]])
        objects = msgspec.structs.replace(one.objects, boxes=boxes, velocities=np.array([[0.0, -5.0]]))
        return msgspec.structs.replace(one, objects=objects)

    def faults(leap: float) -> list[tuple[str, AtFault]]:
        driven = [crossing(0.1 * k, LANE_Y + 7.0 - 0.5 * k + leap * (k <= 0)) for k in range(-10, 9)]
        where = places(roads)
        oracles, watch = (Collision(where, Thresholds()), TimeToCollision(where, Thresholds())), Disturbances(where)
        for one in driven:
            watch.see(one)
            for oracle in oracles:
                oracle.observe(one)
        judgements = [oracle.conclude(Ending.CUT) for oracle in oracles]
        return [(one.violation.kind, one.fault) for one in judged(judgements, watch, driven[-1], roads)]

    assert faults(3.0) == [("ttc", AtFault.SIMULATOR), ("collision", AtFault.SIMULATOR)]
    assert faults(0.0) == [("ttc", AtFault.OTHER), ("collision", AtFault.OTHER)]


def test_a_contact_with_what_was_inserted_is_counted_apart(roads: RoadMap) -> None:
    inserted: Row = ("new", (56.0, LANE_Y), 0.0)
    moments = [*cruise(1.0, 12.0), *[moment(1.1 + 0.1 * k, 52.4 + 1.2 * k, 12.0, [inserted]) for k in range(3)]]
    assert at_contact(moments, roads) == [("collision", AtFault.SIMULATOR)]


def test_running_into_a_standing_car_is_the_drivers(roads: RoadMap) -> None:
    assert at_contact(cruise(2.0, 10.0, [("lead", (60.0, LANE_Y), 0.0)])[:19], roads) == [("collision", AtFault.DRIVER)]


def test_being_run_into_from_behind_is_the_others_unless_the_ego_left_its_lane(roads: RoadMap) -> None:
    def hit(y: float) -> list[Moment]:
        return [moment(0.1 * k, 60.0 + 0.5 * k, 5.0, [("tail", (40.0 + 1.5 * k, y), 15.0)], y=y) for k in range(15)]

    assert at_contact(hit(LANE_Y), roads) == [("collision", AtFault.OTHER)]
    assert at_contact(hit(LANE_Y + 1.6), roads) == [("collision", AtFault.DRIVER)]
    aslant = [msgspec.structs.replace(one, ego=msgspec.structs.replace(one.ego, heading=0.4)) for one in hit(LANE_Y)]
    assert at_contact(aslant, roads) == [("collision", AtFault.OTHER)]  # its front has swept out, its rear has not


@pytest.mark.parametrize(("heading", "fault"), [(0.2, AtFault.OTHER), (0.0, AtFault.DRIVER), (-0.2, AtFault.DRIVER)])
def test_being_run_into_on_the_way_out_of_a_lane_is_the_others_and_on_the_way_in_the_drivers(
    roads: RoadMap, heading: float, fault: AtFault
) -> None:
    """The ego lies across the marking: whose lane that of the other is depends on where it goes."""
    tail = [("tail", (40.0 + 1.5 * k, LANE_Y), 15.0) for k in range(15)]
    moments = [moment(0.1 * k, 60.0 + 0.5 * k, 5.0, [row], y=LANE_Y + 1.6) for k, row in enumerate(tail)]
    aslant = [msgspec.structs.replace(one, ego=msgspec.structs.replace(one.ego, heading=heading)) for one in moments]
    assert at_contact(aslant, roads) == [("collision", fault)]


def test_a_standing_ego_is_never_at_fault(roads: RoadMap) -> None:
    moments = [moment(0.1 * k, 60.0, 0.0, [("tail", (40.0 + 1.5 * k, LANE_Y), 15.0)]) for k in range(12)]
    assert at_contact(moments, roads) == [("collision", AtFault.OTHER)]


@pytest.mark.parametrize("is_on_foot", [False, True], ids=["in a car", "on foot"])
@pytest.mark.parametrize(
    ("own", "others", "fault"), [(0.08, 0.0, AtFault.DRIVER), (0.0, 0.05, AtFault.OTHER), (0.08, 0.12, AtFault.OTHER)]
)
def test_of_two_who_stand_the_one_that_creeps_is_at_fault(
    roads: RoadMap, *, own: float, others: float, is_on_foot: bool, fault: AtFault
) -> None:
    """The ego comes to 3 cm of the other one's front."""
    moments = []
    for k in range(-50, 8):
        front = 60.0 + (0.03 * k if k < 0 else 0.1 * own * k)
        near = 60.028 - 0.1 * others * max(k, 0)
        row: Row = ("near", (near + (0.25 if is_on_foot else 2.3), LANE_Y), -others if k > 0 else 0.0)
        one = moment(5.0 + 0.1 * k, front, own if k > 0 else 0.3, [row])
        moments.append(on_foot(one) if is_on_foot else one)
        if near <= front:
            break
    assert at_contact(moments, roads)[-1] == ("collision", fault)


@pytest.mark.parametrize(
    ("own", "others", "last", "fault"),
    [
        (0.08, 0.0, 0.0, AtFault.DRIVER),
        (0.0, 0.08, 0.08, AtFault.SIMULATOR),
        (0.0, 0.08, 0.0, AtFault.SIMULATOR),  # who comes to rest as it touches
    ],
)
def test_an_ego_that_creeps_for_long_into_who_stands_on_foot_was_not_walked_into(
    roads: RoadMap, own: float, others: float, last: float, fault: AtFault
) -> None:
    moments = []
    for k in range(-60, 25):
        near = 60.15 - 0.1 * others * max(k, 0)
        front = 60.0 + (0.03 * k if k < 0 else 0.1 * own * k)
        row: Row = ("near", (near + 0.25, LANE_Y), -(last if near <= front else others) if k > 0 else 0.0)
        moments.append(on_foot(moment(6.0 + 0.1 * k, front, own if k > 0 else 0.3, [row])))
        if near <= front:
            break
    assert at_contact(moments, roads)[-1] == ("collision", fault)


@pytest.mark.parametrize(("front", "fault"), [(60.0, AtFault.OTHER), (202.0, AtFault.DRIVER)])
def test_a_touched_flank_is_the_others_in_the_egos_lane_and_not_on_a_junction(
    roads: RoadMap, front: float, fault: AtFault
) -> None:
    where = [(front - 7.0 + 0.5 * k, LANE_Y + 5.1 - 0.35 * k) for k in range(14)]
    moments = [moment(0.1 * k, front - 3.0 + 0.5 * k, 5.0, [("side", place, 5.0)]) for k, place in enumerate(where)]
    touching = next(k for k, (_, y) in enumerate(where) if y - LANE_Y <= 1.8)
    assert at_contact(moments[: touching + 1], roads)[-1] == ("collision", fault)


def test_a_flank_touched_by_who_stands_is_the_drivers(roads: RoadMap) -> None:
    parked: Row = ("parked", (53.0, LANE_Y + 2.5), 0.0)
    moments = [moment(0.1 * k, 56.0 + 0.05 * k, 0.5, [parked], y=LANE_Y + 0.1 * k) for k in range(10)]
    touching = next(k for k in range(10) if 0.1 * k > 0.7)
    assert at_contact(moments[: touching + 1], roads) == [("collision", AtFault.DRIVER)]


@pytest.mark.parametrize(("y", "fault"), [(-1.6, AtFault.OTHER), (1.6, AtFault.DRIVER)])
def test_a_flank_touched_in_a_lane_that_leads_the_other_way_is_the_drivers(
    roads: RoadMap, y: float, fault: AtFault
) -> None:
    """Between the lanes is the middle of the street."""
    side = 1.0 if y > 0.0 else -1.0
    where = [(47.0 + 0.5 * k, y - side * (3.0 - 0.2 * k)) for k in range(10)]
    moments = [moment(0.1 * k, 50.0 + 0.5 * k, 5.0, [("side", place, 5.0)], y=y) for k, place in enumerate(where)]
    touching = next(k for k, (_, one) in enumerate(where) if abs(one - y) <= 1.8)
    assert at_contact(moments[: touching + 1], roads)[-1] == ("collision", fault)


@pytest.mark.parametrize(
    ("waits", "front", "fault"),
    [(True, 202.0, AtFault.SIMULATOR), (False, 202.0, AtFault.DRIVER), (True, 199.0, AtFault.DRIVER)],
)
def test_who_stood_beside_the_ego_and_walks_into_its_flank_is_the_simulators_doing(
    roads: RoadMap, *, waits: bool, front: float, fault: AtFault
) -> None:
    """On a junction. Who has walked on all the time, or set off before the front was past, is not."""
    moments = [_walked(k, front, waits=waits) for k in range(-10, 10)]
    touching = next(k for k, one in enumerate(moments) if one.objects.boxes[0, 1] + 0.25 >= LANE_Y - 0.9)
    assert at_contact(moments[: touching + 1], roads) == [("collision", fault)]


@pytest.mark.parametrize(
    ("jump", "stands", "pace", "front", "fault"),
    [
        (2.0, False, 1.5, 202.0, AtFault.SIMULATOR),
        (0.0, False, 1.5, 202.0, AtFault.DRIVER),
        (2.0, False, 0.4, 202.0, AtFault.DRIVER),
        (0.9, True, 0.4, 202.0, AtFault.SIMULATOR),
        (2.0, False, 1.5, 199.4, AtFault.DRIVER),
    ],
)
def test_who_jumps_beside_the_ego_and_walks_into_its_flank_is_the_simulators_doing(
    roads: RoadMap, *, jump: float, stands: bool, pace: float, front: float, fault: AtFault
) -> None:
    """On a junction. Who takes longer than to a stop, and a second, or jumps there before the front is past, is not.

    Who stood there before, and has longer, still has.
    """

    def walked(k: int) -> Moment:
        y = LANE_Y - 2.6 + 0.1 * pace * (max(k, 0) if stands else k) - jump * (k < 0)
        one = on_foot(moment(0.1 * k, front + 0.05 * k, 0.5, [("p", (200.0, y), 0.0)]))
        velocities = np.array([[0.0, pace * (k >= 0 or not stands)]])
        return msgspec.structs.replace(one, objects=msgspec.structs.replace(one.objects, velocities=velocities))

    moments = [walked(k) for k in range(-10, 40)]
    touching = next(k for k, one in enumerate(moments) if one.objects.boxes[0, 1] + 0.25 >= LANE_Y - 0.9)
    assert at_contact(moments[: touching + 1], roads) == [("collision", fault)]


@pytest.mark.parametrize(("waits", "fault"), [(True, AtFault.SIMULATOR), (False, AtFault.DRIVER)])
def test_who_walks_close_up_to_the_egos_flank_is_judged_as_who_walks_into_it(
    roads: RoadMap, *, waits: bool, fault: AtFault
) -> None:
    """An ego that stops before it is touched is no worse than one that does not."""
    where = places(roads)
    oracles: list[Oracle] = [Collision(where, Thresholds()), TimeToCollision(where, Thresholds())]
    watch = Disturbances(where)
    moments = [_walked(k, 202.0, waits=waits) for k in range(-10, 8)]
    for one in moments:
        for oracle in oracles:
            oracle.observe(one)
        watch.see(one)
    found = judged([oracle.conclude(Ending.CUT) for oracle in oracles], watch, moments[-1], roads)
    assert {(one.violation.kind, one.fault) for one in found} == {("safe_distance", fault), ("ttc", fault)}


def test_who_walks_along_beside_the_ego_has_not_walked_at_its_flank(roads: RoadMap) -> None:
    people = [
        on_foot(moment(0.1 * k, 202.0 + 0.1 * k, 1.0, [("p", (200.0 + 0.12 * k, LANE_Y - 1.4), 1.2 * (k > 0))]))
        for k in range(9)
    ]
    assert disturbances(people, roads) == [
        ("p", "was there as the ego appeared")
    ]  # with the ego, which has just departed


def _walked(k: int, front: float, *, waits: bool) -> Moment:
    """The ego passes at 2 m/s; beside it somebody walks towards its way, or sets off to as its front is at `front`."""
    y = LANE_Y - 2.1 + 0.12 * (max(k, 0) if waits else k)
    one = on_foot(moment(0.1 * k, front + 0.2 * k, 2.0, [("p", (200.0, y), 0.0)]))
    velocities = np.array([[0.0, 1.2 * (k > 0 or not waits)]])
    return msgspec.structs.replace(one, objects=msgspec.structs.replace(one.objects, velocities=velocities))


@pytest.mark.parametrize(
    ("kind", "fault"), [(Destination.not_reached, AtFault.OTHER), (Destination.overrun, AtFault.DRIVER)]
)
def test_a_jam_keeps_the_ego_from_its_destination_and_does_not_drive_it_past(
    roads: RoadMap, kind: str, fault: AtFault
) -> None:
    violation = Violation(kind, Category.MISSION, 9.0, None, (0.0, 0.0), None, 40.0, 3.0, "")
    judgement = Judgement(Destination.kind, Answer.VIOLATED, (violation,))
    (found,) = judged([judgement], Disturbances(places(roads)), moment(9.0, 60.0, 0.0), roads, "somebody")
    assert found.fault is fault


def test_traffic_rules_are_always_the_drivers(roads: RoadMap) -> None:
    where = places(roads)
    oracle, watch = SpeedLimit(where, Thresholds()), Disturbances(where)
    moments = cruise(2.0, 20.0)
    for one in moments:
        oracle.observe(one)
        watch.see(one)
    (found,) = judged([oracle.conclude(Ending.CUT)], watch, moments[-1], roads)
    assert (found.oracle, found.fault, found.is_alone) == ("speed_limit", AtFault.DRIVER, None)
