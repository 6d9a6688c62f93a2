"""Futures on a small town: a two-lane road east to a junction with side roads, and a bend to the north."""

import math
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple, cast

import msgspec
import numpy as np
import pytest
import sumolib

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.messages import PREDICTION_TIMES, Floats, ObjectClass, PredictedObjects, TrackedObjects
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.stack.continuations import Traffic
from dvca_sumo.stack.lane_paths import LanePaths, stretches_of
from dvca_sumo.stack.prediction import MapPrediction, PredictionConfig

RADIUS = 40.0  # [m] of the bend: east along the right lane's line until x = 200, then north along x = 240
RIGHT, LEFT = -4.8, -1.6  # [m] y of the lanes of "in"

NODES = """<nodes>
    <node id="west" x="-200" y="0"/> <node id="cross" x="0" y="0" type="priority"/>
    <node id="south" x="0" y="-150"/> <node id="north" x="0" y="150"/> <node id="end" x="240" y="140"/>
</nodes>"""
ARC = " ".join(
    f"{200 + RADIUS * math.sin(a):.2f},{RIGHT + RADIUS - RADIUS * math.cos(a):.2f}"
    for a in np.linspace(0.0, math.pi / 2, 19)
)
EDGES = f"""<edges>
    <edge id="in" from="west" to="cross" numLanes="2" speed="13.9"/>
    <edge id="bend" from="cross" to="end" numLanes="1" speed="13.9" spreadType="center"
        shape="0,{RIGHT} {ARC} 240,140"/>
    <edge id="left" from="cross" to="north" numLanes="1" speed="13.9"/>
    <edge id="right" from="cross" to="south" numLanes="1" speed="8.3"/>
</edges>"""
CONNECTIONS = """<connections>
    <connection from="in" to="bend" fromLane="0" toLane="0"/> <connection from="in" to="right" fromLane="0" toLane="0"/>
    <connection from="in" to="left" fromLane="1" toLane="0"/>
</connections>"""


@pytest.fixture(scope="module")
def roadmap(tmp_path_factory: pytest.TempPathFactory) -> RoadMap:
    folder: Path = tmp_path_factory.mktemp("town")
    command = [sumolib.checkBinary("netconvert"), "-o", "net.xml", "--offset.disable-normalization", "--no-turnarounds"]
    for option, text in [("node", NODES), ("edge", EDGES), ("connection", CONNECTIONS)]:
        (folder / f"{option}.xml").write_text(text)
        command += [f"--{option}-files", f"{option}.xml"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)  # noqa: S603 - SUMO's own program
    return RoadMap.load(folder / "net.xml")


class Seen(NamedTuple):
    """One tracked object."""

    x: float
    y: float
    heading: float = 0.0
    speed: float = 10.0
    kind: ObjectClass = ObjectClass.VEHICLE
    drift: float = 0.0  # [m/s] to its left
    track: int = 1
    length: float = 4.5  # [m]


def tracked(time: float, *seen: Seen) -> TrackedObjects:
    velocities = [
        (
            s.speed * math.cos(s.heading) - s.drift * math.sin(s.heading),
            s.speed * math.sin(s.heading) + s.drift * math.cos(s.heading),
        )
        for s in seen
    ]
    return TrackedObjects(
        time=time,
        ids=np.array([s.track for s in seen], dtype=np.int64),
        classes=np.array([s.kind for s in seen], dtype=np.int64),
        boxes=np.array([(s.x, s.y, s.heading, s.length, 1.8) for s in seen]).reshape(-1, 5),
        velocities=np.array(velocities).reshape(-1, 2),
        signals={},
    )


def predicted(roadmap: RoadMap, *seen: Seen) -> PredictedObjects:
    return MapPrediction(PredictionConfig(), roadmap).step(tracked(0.0, *seen))


def lane_point(roadmap: RoadMap, lane: str, station: float, offset: float = 0.0) -> tuple[float, float, float]:
    x, y, heading = roadmap.lanes[lane].line.poses([station], offset)[0].tolist()
    return x, y, heading


def constant_velocity(seen: Seen) -> Floats:
    """x, y over the prediction times."""
    direction = np.array([math.cos(seen.heading), math.sin(seen.heading)])
    moved: Floats = np.array([seen.x, seen.y]) + PREDICTION_TIMES[:, None] * seen.speed * direction
    return moved


def ends(result: PredictedObjects, lane: str) -> list[int]:
    return [h for h, lanes in enumerate(result.lanes) if lanes[-1:] == (lane,)]


def way_right(roadmap: RoadMap) -> Polyline:
    """From the lane at the right of the road round the corner."""
    (way,) = (lanes for lanes in predicted(roadmap, Seen(-20.0, RIGHT, speed=6.0)).lanes if lanes[-1] == "right_0")
    return Polyline(np.concatenate([roadmap.lanes[lane].line.points for lane in way]))


def turning(line: Polyline, nose: float, length: float, speed: float) -> tuple[Floats, float]:
    """Pose and speed of a body so long as SUMO turns it: `nose` is its station on the line, `speed` that of the nose.

    Its tail is in line with where the nose was a length before.
    """

    def pose(nose: float) -> Floats:
        front, rear = line.poses([nose, nose - length])[:, :2]
        ahead = (front - rear) / math.dist(front, rear)
        return np.array([*(front - 0.5 * length * ahead), math.atan2(ahead[1], ahead[0])])

    x, y, heading = pose(nose)
    east, north, _ = (pose(nose + 0.1) - pose(nose - 0.1)) / 0.2 * speed
    return np.array([x, y, heading]), float(east * math.cos(heading) + north * math.sin(heading))


def test_a_vehicle_in_a_bend_stays_on_its_lane(roadmap: RoadMap) -> None:
    x, y, heading = lane_point(roadmap, "bend_0", 200.0)
    result = predicted(roadmap, Seen(x, y, heading))
    stations, offsets = roadmap.lanes["bend_0"].line.project(result.poses[0, :, :2])
    assert len(result.owners) == 1
    assert np.abs(offsets).max() < 0.1
    assert np.diff(stations) == pytest.approx(2.5, abs=0.05)
    assert result.poses[0, 0] == pytest.approx([x, y, heading])
    assert result.poses[0, -1, 2] == pytest.approx(math.pi / 2, abs=0.05)
    assert result.lanes == (("bend_0",),)


def test_who_is_faster_in_a_bend_than_comfort_allows_goes_on_so(roadmap: RoadMap) -> None:
    x, y, heading = lane_point(roadmap, "bend_0", 205.0)
    result = predicted(roadmap, Seen(x, y, heading, speed=13.0))
    stations, _ = roadmap.lanes["bend_0"].line.project(result.poses[0, :, :2])
    assert stations[12] - stations[0] == pytest.approx(3.0 * 13.0, abs=0.5)


def test_both_ends_of_a_bus_follow_its_lane_and_its_middle_cuts_the_bend(roadmap: RoadMap) -> None:
    front, rear = (np.array(lane_point(roadmap, "bend_0", 200.0 + end)[:2]) for end in (6.0, -6.0))
    (x, y), (east, north) = 0.5 * (front + rear), front - rear
    result = predicted(roadmap, Seen(x, y, math.atan2(north, east), length=12.0))
    poses = result.poses[0]
    ways = 6.0 * np.stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])), axis=1)
    line = roadmap.lanes["bend_0"].line
    for end in (poses[:, :2] + ways, poses[:, :2] - ways):
        assert np.abs(line.project(end)[1]).max() < 0.1
    _, cuts = line.project(poses[:3, :2])
    assert cuts == pytest.approx(12.0**2 / (8.0 * RADIUS), abs=0.1)


def test_both_ends_of_a_car_follow_a_sharp_turn_that_its_middle_cuts(roadmap: RoadMap) -> None:
    result = predicted(roadmap, Seen(-20.0, RIGHT, speed=6.0))
    (right,) = ends(result, "right_0")
    line = Polyline(np.concatenate([roadmap.lanes[lane].line.points for lane in result.lanes[right]]))
    poses = result.poses[right]
    ways = 0.5 * 4.5 * np.stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])), axis=1)
    front, middle, rear = (np.abs(line.project(poses[:, :2] + end)[1]).max() for end in (ways, 0.0, -ways))
    assert front < 0.1
    assert rear < 0.15
    assert middle > 0.3


@pytest.mark.parametrize("length", [4.5, 9.0, 12.0])
def test_in_a_sharp_turn_a_vehicle_follows_its_nose_and_is_as_fast_as_that(roadmap: RoadMap, length: float) -> None:
    line = way_right(roadmap)
    prediction = MapPrediction(PredictionConfig(), roadmap)
    speed, corner = 3.0, roadmap.lanes["in_0"].line.length
    for time in np.arange(0.0, (length + 9.0) / speed, 0.1).tolist():
        nose = corner + time * speed
        (x, y, heading), forward = turning(line, nose, length, speed)
        result = prediction.step(tracked(time, Seen(x, y, heading, forward, length=length)))
        (right,) = ends(result, "right_0")
        later, _ = turning(line, nose + PREDICTION_TIMES[2] * speed, length, speed)
        assert math.dist(result.poses[right, 2, :2], later[:2]) < 0.35
        assert result.poses[right, 2, 2] == pytest.approx(later[2], abs=0.1)


def test_who_turns_sharply_gets_as_far_as_its_nose_which_is_much_faster_than_its_middle(roadmap: RoadMap) -> None:
    line, length, speed = way_right(roadmap), 12.0, 7.0
    prediction = MapPrediction(PredictionConfig(), roadmap)
    corner = roadmap.lanes["in_0"].line.length
    for time in np.arange(0.0, 2.0, 0.1).tolist():
        (x, y, heading), forward = turning(line, corner + time * speed, length, speed)
        result = prediction.step(tracked(time, Seen(x, y, heading, forward, length=length)))
        (right,) = ends(result, "right_0")
        ways = np.hypot(*np.diff(result.poses[right, -8:, :2], axis=0).T)
        assert ways.min() > 0.9 * ways.max()


def test_at_a_fork_every_way_is_a_hypothesis_and_straight_on_the_likeliest(roadmap: RoadMap) -> None:
    result = predicted(roadmap, Seen(-30.0, RIGHT))
    assert result.probabilities.sum() == pytest.approx(1.0)
    (straight,), (right,) = ends(result, "bend_0"), ends(result, "right_0")
    assert result.probabilities[straight] > result.probabilities[right] > 0.1
    assert result.poses[straight, -1, 0] > 10.0
    assert result.poses[right, -1, 1] < -10.0
    assert result.lanes[right][0] == "in_0"
    assert roadmap.lanes[result.lanes[right][1]].is_internal


@pytest.mark.parametrize("arms", [4, 6])
def test_every_way_at_the_first_fork_is_a_hypothesis_however_many_there_are_and_wherever_they_lead(
    plain: Callable[..., RoadMap], arms: int
) -> None:
    """Straight on, each way forks again so soon that whole continuations straight on are likelier than a turn."""
    nodes = '<node id="from" x="-200" y="0"/><node id="o" x="0" y="0"/>'
    edges = '<edge id="in" from="from" to="o"/>'
    for arm in range(1, arms):
        angle = math.pi + 2.0 * math.pi * arm / arms
        nodes += f'<node id="m{arm}" x="{60 * math.cos(angle):.1f}" y="{60 * math.sin(angle):.1f}"/>'
        edges += f'<edge id="way{arm}" from="o" to="m{arm}"/>'
        for fork, turn in enumerate((-0.2, 0.0, 0.2)):
            x, y = (
                60 * math.cos(angle) + 90 * math.cos(angle + turn),
                60 * math.sin(angle) + 90 * math.sin(angle + turn),
            )
            nodes += f'<node id="n{arm}{fork}" x="{x:.1f}" y="{y:.1f}"/>'
            edges += f'<edge id="on{arm}{fork}" from="m{arm}" to="n{arm}{fork}"/>'
    town = plain(nodes, edges)
    x, y, heading = lane_point(town, "in_0", town.lanes["in_0"].line.length - 10.0)
    result = predicted(town, Seen(x, y, heading, 13.0))
    shares = dict.fromkeys((f"way{arm}_0" for arm in range(1, arms)), 0.0)
    for lanes, probability in zip(result.lanes, result.probabilities.tolist(), strict=True):
        shares[next(lane for lane in lanes if lane.startswith("way"))] += probability
    assert min(shares.values()) > 0.1
    assert sum(shares.values()) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("seen", "kept_for", "ways"),
    [
        (Seen(0.0, 0.0, length=12.0), "bus", 1),
        (Seen(0.0, 0.0, length=4.5), "bus", 0),
        (Seen(0.0, 0.0, speed=6.0, kind=ObjectClass.BICYCLE, length=1.6), "bicycle", 1),
        (Seen(0.0, 0.0, length=12.0), "bicycle", 0),
    ],
)
def test_onto_a_lane_kept_for_some_go_those_and_nobody_else(
    plain: Callable[..., RoadMap], seen: Seen, kept_for: str, ways: int
) -> None:
    town = plain(
        '<node id="from" x="-200" y="0"/><node id="o" x="0" y="0"/><node id="to" x="200" y="0"/>',
        '<edge id="in" from="from" to="o"/>'
        f'<edge id="out" from="o" to="to" numLanes="2"><lane index="0" allow="{kept_for}"/></edge>',
        '<connection from="in" to="out" fromLane="0" toLane="0"/>'
        '<connection from="in" to="out" fromLane="0" toLane="1"/>',
    )
    x, y, heading = lane_point(town, "in_0", town.lanes["in_0"].line.length - 15.0)
    result = predicted(town, seen._replace(x=x, y=y, heading=heading))
    assert len(ends(result, "out_0")) == ways
    assert len(ends(result, "out_1")) == 1


def test_ways_that_part_beyond_the_horizon_are_one_hypothesis(roadmap: RoadMap) -> None:
    result = predicted(roadmap, Seen(-78.0, RIGHT))
    assert result.lanes == (("in_0",),)
    assert result.probabilities == pytest.approx([1.0])


def test_beyond_the_fork_only_the_way_taken_is_left(roadmap: RoadMap) -> None:
    prediction = MapPrediction(PredictionConfig(), roadmap)
    approach, turn = (
        roadmap.lanes["in_0"],
        next(
            lane for name in roadmap.lanes["in_0"].successors if roadmap.lanes[lane := name].successors == ("right_0",)
        ),
    )
    way = [approach.line.poses([s])[0] for s in np.arange(150.0, approach.line.length, 0.5)]
    way += list(roadmap.lanes[turn].line.poses(np.arange(0.0, roadmap.lanes[turn].line.length, 0.5)))
    way += list(roadmap.lanes["right_0"].line.poses(np.arange(0.0, 20.0, 0.5)))
    shares = []
    for step, (x, y, heading) in enumerate(way):
        result = prediction.step(tracked(step * 0.1, Seen(x, y, heading, speed=5.0)))
        assert result.probabilities.sum() == pytest.approx(1.0)
        shares.append(sum(result.probabilities[h] for h in range(len(result.owners)) if "right_0" in result.lanes[h]))
    assert shares[-41:] == pytest.approx([1.0] * 41)
    assert result.lanes == (("right_0",),)


@pytest.mark.parametrize("taken", ["bend_0", "right_0"])
def test_who_is_first_seen_where_ways_part_may_take_each_until_it_is_seen_to_take_one(
    roadmap: RoadMap, taken: str
) -> None:
    """It comes into sight on the junction, where it might have come out behind others."""
    way = next(name for name in roadmap.lanes["in_0"].successors if taken in roadmap.lanes[name].successors)
    prediction = MapPrediction(PredictionConfig(), roadmap)
    told = []
    for step, station in enumerate(np.arange(1.0, roadmap.lanes[way].line.length, 0.5)):
        x, y, heading = lane_point(roadmap, way, station)
        told.append(prediction.step(tracked(0.1 * step, Seen(x, y, heading, speed=5.0))))
    assert {lanes[-1] for lanes in told[0].lanes} == {"bend_0", "right_0"}
    assert told[0].probabilities.max() < 0.7
    assert {lanes[-1] for lanes in told[-1].lanes} == {taken}
    x, y, heading = lane_point(roadmap, taken, 1.0)
    after = prediction.step(tracked(0.1 * len(told), Seen(x, y, heading, speed=5.0)))
    assert after.lanes == ((taken,),)


def test_a_turning_vehicle_slows_down_for_the_turn_and_one_going_straight_does_not(roadmap: RoadMap) -> None:
    result = predicted(roadmap, Seen(-30.0, RIGHT, speed=12.0))
    steps = np.hypot(*np.diff(result.poses[:, :, :2], axis=1).transpose(2, 0, 1)) / 0.25
    (straight,), (right,) = ends(result, "bend_0"), ends(result, "right_0")
    assert steps[right].min() < 7.0
    assert steps[right, :2] == pytest.approx(12.0, abs=1.0)
    assert steps[straight] == pytest.approx(12.0, abs=0.3)


@pytest.mark.parametrize("turn", [0.02, -0.02, 0.2])
def test_kinks_and_lanes_that_overlap_a_little_are_no_corners(roadmap: RoadMap, turn: float) -> None:
    """Nets are drawn so, where nobody slows down: from one lane into the next, and where one of them is a point."""
    onward = 100.0 * np.array([math.cos(turn), math.sin(turn)])
    drawn = {
        "before": ([(-100.0, 0.0), (0.0, 0.0)], ("point",)),
        "point": ([(0.0, 0.0), (0.01, 0.0)], ("after",)),
        "after": ([(0.0, 0.0), onward.tolist()], ()),
    }
    lanes = {
        name: msgspec.structs.replace(roadmap.lanes["in_0"], id=name, line=Polyline(points), successors=successors)
        for name, (points, successors) in drawn.items()
    }
    paths = LanePaths(
        cast("RoadMap", SimpleNamespace(lanes=lanes)), max_branches=3, lateral_acceleration=5.5, braking=2.5
    )
    ((path, _),) = paths.branches("before", 180.0, Traffic.CARS)
    bends, _ = paths.caps(stretches_of([path]), np.zeros(1), 180)
    assert math.sqrt(bends.min()) > 13.9


@pytest.mark.parametrize(("y", "drift", "other"), [(-4.4, 1.0, "in_1"), (-2.0, -1.0, "in_0")])
def test_a_vehicle_drifting_to_the_next_lane_may_change_to_it(
    roadmap: RoadMap, y: float, drift: float, other: str
) -> None:
    result = predicted(roadmap, Seen(-150.0, y, drift=drift))
    assert result.probabilities.sum() == pytest.approx(1.0)
    (change,) = [h for h, lanes in enumerate(result.lanes) if lanes[0] == other]
    assert result.probabilities[change] > 0.3
    assert result.poses[change, -1, 1] == pytest.approx(lane_point(roadmap, other, 110.0)[1], abs=0.1)


@pytest.mark.parametrize(
    ("y", "drift"),
    [(RIGHT, 0.0), (-4.3, 0.25), (-4.0, -0.8), (-1.2, 1.0)],
    ids=["centred", "hardly drifting", "returning", "no lane on that side"],
)
def test_a_vehicle_that_keeps_its_lane_is_not_said_to_change(roadmap: RoadMap, y: float, drift: float) -> None:
    result = predicted(roadmap, Seen(-180.0, y, drift=drift))
    lane = "in_0" if y < -3.2 else "in_1"
    assert {lanes[0] for lanes in result.lanes} == {lane}
    assert result.poses[0, -1, 1] == pytest.approx(lane_point(roadmap, lane, 80.0)[1], abs=0.05)


def test_a_change_of_lanes_goes_on_by_the_likeliest_way(roadmap: RoadMap) -> None:
    result = predicted(roadmap, Seen(-50.0, LEFT, drift=-1.0))
    (change,) = {lanes for lanes in result.lanes if lanes[0] == "in_0"}
    assert change[-1] == "bend_0"


@pytest.mark.parametrize(
    ("known", "slows"), [("", True), ('<param key="dvca.map.speed_limit" value="missing"/>', False)]
)
def test_nobody_is_taken_to_slow_down_for_a_limit_that_the_map_does_not_have(
    plain: Callable[..., RoadMap],
    known: str,
    slows: bool,  # noqa: FBT001
) -> None:
    town = plain(
        '<node id="a" x="0" y="0"/><node id="b" x="200" y="0"/><node id="c" x="400" y="0"/>',
        f'<edge id="ab" from="a" to="b" speed="20"/><edge id="bc" from="b" to="c" speed="8">{known}</edge>',
    )
    x, y, heading = lane_point(town, "ab_0", 170.0)
    poses = predicted(town, Seen(x, y, heading, speed=15.0)).poses[0]
    assert (poses[-1, 0] - poses[0, 0] < 80.0) == slows


def test_after_changing_lanes_the_new_lane_is_followed(roadmap: RoadMap) -> None:
    prediction = MapPrediction(PredictionConfig(), roadmap)
    for step in range(40):
        y = RIGHT + min(3.2, step * 0.1)
        result = prediction.step(tracked(step * 0.1, Seen(-180.0 + step, y, drift=1.0 if y < -1.6 else 0.0)))
    assert {lanes[0] for lanes in result.lanes} == {"in_1"}


def test_a_bicycle_keeps_to_its_side_of_the_lane(roadmap: RoadMap) -> None:
    result = predicted(roadmap, Seen(-150.0, -5.8, speed=5.0, kind=ObjectClass.BICYCLE))
    assert result.poses[0, :, 1] == pytest.approx(-5.8, abs=0.02)


def test_braking_that_is_seen_goes_on_for_a_while(roadmap: RoadMap) -> None:
    prediction = MapPrediction(PredictionConfig(), roadmap)
    x, speed = -180.0, 12.0
    for step in range(15):
        result = prediction.step(tracked(step * 0.1, Seen(x, RIGHT, speed=speed)))
        x, speed = x + 0.1 * speed, speed - 0.3
    way = result.poses[0, -1, 0] - result.poses[0, 0, 0]
    assert 12.0 < way < 6.0 * speed - 10.0
    assert (np.diff(result.poses[0, :, 0]) > 0.0).all()


@pytest.mark.parametrize(
    "seen",
    [
        Seen(-100.0, RIGHT, 0.3, 1.4, ObjectClass.PEDESTRIAN),
        Seen(-100.0, RIGHT, 0.3, 0.0, ObjectClass.PEDESTRIAN),
        Seen(-100.0, 60.0, 0.7, 8.0),
        Seen(-100.0, RIGHT, math.pi, 8.0),
        Seen(-100.0, RIGHT, math.pi / 2, 4.0, ObjectClass.BICYCLE),
    ],
    ids=["walking", "standing person", "off the map", "wrong way", "crossing the road"],
)
def test_what_follows_no_lane_goes_on_as_it_is(roadmap: RoadMap, seen: Seen) -> None:
    result = predicted(roadmap, seen)
    assert result.probabilities.tolist() == [1.0]
    assert result.poses[0, :, :2] == pytest.approx(constant_velocity(seen))
    assert (result.poses[0, :, 2] == seen.heading).all()
    assert result.lanes == ((),)


@pytest.mark.parametrize("kind", [ObjectClass.VEHICLE, ObjectClass.STATIC])
def test_what_stands_stays(roadmap: RoadMap, kind: ObjectClass) -> None:
    result = predicted(roadmap, Seen(-20.0, RIGHT, speed=0.2, kind=kind))
    assert result.probabilities.tolist() == [1.0]
    assert (result.poses[0] == [-20.0, RIGHT, 0.0]).all()
    assert result.lanes == (("in_0",) if kind is ObjectClass.VEHICLE else (),)


def test_just_above_standing_it_moves(roadmap: RoadMap) -> None:
    result = predicted(roadmap, Seen(-100.0, RIGHT, speed=0.4))
    assert result.poses[0, -1, 0] == pytest.approx(-97.6, abs=0.1)


def test_beyond_the_edge_of_the_net_traffic_goes_straight_on(roadmap: RoadMap) -> None:
    result = predicted(roadmap, Seen(240.0, 120.0, math.pi / 2, 10.0))
    assert result.poses[0, -1] == pytest.approx([240.0, 180.0, math.pi / 2], abs=0.3)


def test_nothing_tracked_gives_empty_arrays_of_the_right_shape(roadmap: RoadMap) -> None:
    prediction = MapPrediction(PredictionConfig(), roadmap)
    for time in (0.0, 0.1):
        result = prediction.step(tracked(time))
        assert result.owners.shape == result.probabilities.shape == (0,)
        assert result.poses.shape == (0, len(PREDICTION_TIMES), 3)
        assert result.lanes == ()


def crowd(time: float) -> Sequence[Seen]:
    return (
        Seen(-180.0 + 10.0 * time, RIGHT, track=4),
        Seen(-60.0, -7.5, 1.2, 1.3, ObjectClass.PEDESTRIAN, track=2),
        Seen(-40.0 + 8.0 * time, LEFT, speed=8.0, track=9),
        Seen(-10.0, RIGHT, speed=0.0, track=3),
        Seen(80.0 + 9.0 * time, RIGHT, speed=9.0, drift=0.4, track=7),
    )


def test_every_object_owns_hypotheses_in_order_that_sum_to_one(roadmap: RoadMap) -> None:
    prediction = MapPrediction(PredictionConfig(), roadmap)
    for step in range(20):
        result = prediction.step(tracked(step * 0.1, *crowd(step * 0.1)))
        sums = np.bincount(result.owners, result.probabilities, 5)
        assert sums == pytest.approx(1.0)
        assert (np.diff(result.owners) >= 0).all()
        assert result.poses.shape == (len(result.owners), len(PREDICTION_TIMES), 3)
        assert len(result.lanes) == len(result.owners)
        assert np.isfinite(result.poses).all()
        assert (np.abs(result.poses[:, :, 2]) <= math.pi + 1e-9).all()
        assert (result.poses[:, 0] == result.objects.boxes[result.owners, :3]).all()


def test_the_same_input_gives_the_same_output_whoever_else_is_there(roadmap: RoadMap) -> None:
    alone, among, again = (MapPrediction(PredictionConfig(), roadmap) for _ in range(3))
    for step in range(10):
        seen = crowd(step * 0.1)
        result = among.step(tracked(step * 0.1, *seen))
        repeated = again.step(tracked(step * 0.1, *seen))
        assert (result.poses == repeated.poses).all()
        assert result.lanes == repeated.lanes
        single = alone.step(tracked(step * 0.1, seen[2]))
        assert result.poses[result.owners == 2] == pytest.approx(single.poses, abs=1e-9)


def test_an_object_that_vanishes_is_forgotten(roadmap: RoadMap) -> None:
    prediction = MapPrediction(PredictionConfig(), roadmap)
    prediction.step(tracked(0.0, Seen(-180.0, RIGHT)))
    prediction.step(tracked(0.1))
    result = prediction.step(tracked(0.2, Seen(220.0, 100.0, math.pi / 2, speed=5.0)))
    assert np.diff(result.poses[0, :, 1]) == pytest.approx(1.25)
