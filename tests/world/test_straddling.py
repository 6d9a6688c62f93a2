"""An ego that stands across two lanes is in the way of both, and nobody but SUMO's drivers sees how they are told."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from small_scenarios import in_child, scenario_file
from watched_world import STEP, entered

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.geometry.boxes import box_of, distances
from dvca_sumo.messages import ControlCommand, PoseStep
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.scenario import load_scenario
from dvca_sumo.truth import EgoTruth, ObjectsTruth
from dvca_sumo.world import Ego, VehicleLimits, World
from dvca_sumo.world.straddling import taken
from dvca_sumo.world.ways import End

NODES = '<node id="b" x="0" y="0"/><node id="c" x="300" y="0"/>'
EDGES = '<edge id="bc" from="b" to="c" speed="13.9" numLanes="2" width="4"/>'
EGO = '<trip id="ego" from="bc" to="bc" depart="0" departPos="{}" departSpeed="0" departLane="0"/>'
FROM_BEHIND = '<trip id="other" from="bc" to="bc" depart="5" departPos="0" departSpeed="max" departLane="{}"/>'
BESIDE = '<trip id="other" from="bc" to="bc" depart="1" departPos="98" departSpeed="0" departLane="1"/>'
# Two ways from one lane, side by side far into the junction; both wait on it for those who cross.
FORK_NODES = """
<node id="a" x="-200" y="0"/><node id="b" x="0" y="0"/><node id="c" x="200" y="20"/><node id="d" x="200" y="-20"/>
<node id="n" x="0" y="200"/><node id="s" x="0" y="-200"/>"""
FORK_EDGES = "".join(
    f'<edge id="{name}" from="{name[0]}" to="{name[1]}" speed="13.9" priority="{priority}"/>'
    for name, priority in (("ab", 1), ("bc", 1), ("bd", 1), ("nb", 9), ("bs", 9))
)
FORK_WAYS = "".join(f'<connection from="ab" to="{to}" fromLane="0" toLane="0" contPos="5"/>' for to in ("bc", "bd"))
FORKING = """
<trip id="ego" from="ab" to="bc" depart="0" departPos="150" departSpeed="0"/>
<trip id="other" from="ab" to="bd" depart="4" departPos="100" departSpeed="8"/>"""
# Two that part late, and in different places become their second lanes.
LONG_FORK_WAYS = """
<connection from="ab" to="bc" fromLane="0" toLane="0" contPos="10.4" shape="-7.2,-1.6 12,-2.2 19.9,0.4"/>
<connection from="ab" to="bd" fromLane="0" toLane="0" contPos="16.3" shape="-7.2,-1.6 9,-2.7 19.9,-3.6"/>"""
CLOSE = '<vType id="close" length="4.5" minGap="1"/>' + FORKING.replace("<trip", '<trip type="close"')
FORKS = {"early": (FORK_WAYS, FORKING), "late": (LONG_FORK_WAYS, CLOSE)}
# A side road joins another one aslant, two lanes each.
MERGE_NODES = """
<node id="n" x="-140" y="140"/><node id="w" x="-190" y="-60"/>
<node id="b" x="0" y="0"/><node id="e" x="180" y="-84"/>"""
MERGE_EDGES = "".join(
    f'<edge id="{name}" from="{name[0]}" to="{name[1]}" speed="13.9" numLanes="2" priority="{priority}"/>'
    for name, priority in (("nb", 9), ("be", 9), ("wb", 1))
)
MERGE_WAYS = "".join(
    f'<connection from="{origin}" to="be" fromLane="{lane}" toLane="{lane}"/>'
    for origin in ("nb", "wb")
    for lane in (0, 1)
)
MERGING = """
<trip id="ego" from="nb" to="be" depart="0" departPos="150" departLane="0" departSpeed="0"/>
<trip id="other" from="wb" to="be" depart="5" departPos="150" departLane="1" departSpeed="3"/>"""
# A road of two lanes crosses a wide one, and leads straight on.
CROSS_NODES = """
<node id="a" x="-200" y="0"/><node id="b" x="0" y="0"/><node id="c" x="200" y="0"/>
<node id="n" x="0" y="200"/><node id="s" x="0" y="-200"/>"""
CROSS_EDGES = "".join(
    f'<edge id="{name}" from="{name[0]}" to="{name[1]}" speed="13.9" numLanes="{lanes}" priority="{priority}"/>'
    for name, lanes, priority in (("ab", 2, 9), ("bc", 2, 9), ("nb", 5, 1), ("bs", 5, 1))
)
CROSSING = """
<trip id="ego" from="ab" to="bc" depart="0" departPos="150" departLane="0" departSpeed="0"/>
<trip id="other" from="ab" to="bc" depart="4" departPos="100" departLane="1" departSpeed="8"/>"""
# Who crosses the road is drawn to pass this far [m] beyond the middle of the junction.
BULGE = '<connection from="nb" to="bs" fromLane="0" toLane="0" shape="-1.6,12 {},0 -1.6,-12"/>'
BULGE_EDGES = "".join(
    f'<edge id="{name}" from="{name[0]}" to="{name[1]}" speed="13.9" priority="9"/>'
    for name in ("ab", "bc", "nb", "bs")
)
BULGING = """
<trip id="ego" from="ab" to="bc" depart="0" departPos="150" departSpeed="0"/>
<trip id="other" from="nb" to="bs" depart="6" departPos="100" departSpeed="8"/>"""
# Who turns right comes near the way of who drives straight on; it is drawn to lead onto that one, or not.
NEARBY = '<connection from="nb" to="ba" fromLane="0" toLane="0" shape="-1.6,12 {} -12,1.6"/>'
NEARBY_EDGES = BULGE_EDGES.replace('id="bs" from="b" to="s"', 'id="ba" from="b" to="a"')
TURNING = BULGING.replace('to="bs"', 'to="ba"')
# Where it leads to lies beside the road on which the other comes, or on it.
ONTO_EDGES = NEARBY_EDGES.replace('id="ba" from="b" to="a"', 'id="be" from="b" to="e" shape="0,{0} -200,{0}"')
ONTO_NODES = CROSS_NODES + '<node id="e" x="-200" y="-30"/>'
ONTO = TURNING.replace('to="ba"', 'to="be"')
# Two lanes lead on, of which the left one is there to pass on, or where a further road leads off.
ALONG_NODES = CROSS_NODES + '<node id="e" x="200" y="200"/>'
ALONG_EDGES = CROSS_EDGES.replace('numLanes="5"', 'numLanes="1"') + '<edge id="ce" from="c" to="e" speed="13.9"/>'
ALONG_WAYS = '<connection from="bc" to="ce" fromLane="1" toLane="0"/>'
WALKING = """
<trip id="ego" from="bc" to="bc" depart="0" departPos="40" departSpeed="0"/>
<person id="walker" depart="0" departPos="70"><walk from="bc" to="bc" arrivalPos="200"/></person>"""
OUT, BACK = 15, 250  # steps after which it stands across the lanes, and goes back to its own
ASIDE = 2.1  # [m] its front is over the edge then
BESIDE_IT = 1.0  # [m] who is nearer to it stands beside it, not behind it


class Drive:
    """An ego that moves out over the edge of its lane, stands there, and moves back."""

    def __init__(self, folder: Path, net: Path, traffic: str, position: float = 100.0, **options: str) -> None:
        scenario = load_scenario(scenario_file(folder, net, EGO.format(position) + traffic, **options), "ego")
        self.world = World(scenario, folder)
        entry = self.world.await_ego((), lambda _: True)
        route = RoadMap.load(net).route(entry.edges, entry.lane, entry.position, None, 300.0)
        self.ego = self.world.adopt(entry, route, VehicleLimits())
        self.gaps: list[float] = []
        self.names: set[str] = set()

    def go(self, steps: int) -> None:
        """So many steps on."""
        for step in range(len(self.gaps), len(self.gaps) + steps):
            left = ASIDE / OUT * ((step < OUT) - (BACK <= step < BACK + OUT))
            move = PoseStep(0.1 * (left != 0.0), left, 0.0, 0.0)
            self.ego.vehicle.advance(ControlCommand(self.world.time, 0.0, 0.0, move), STEP)
            self.world.advance()
            objects = self.world.observe(self.ego).objects
            self.gaps.append(_gap(self.ego, objects))
            self.names |= {*objects.ids, *self.world.departed(), *self.world.waits()}


@pytest.mark.parametrize("lane", [0, 1])
def test_who_comes_on_either_lane_stops_behind_an_ego_across_both_until_it_is_out_of_the_way(
    tmp_path: Path, plain_file: Callable[..., Path], lane: int
) -> None:
    net = plain_file(NODES, EDGES)

    def job() -> tuple[list[float], set[str]]:
        drive = Drive(tmp_path, net, FROM_BEHIND.format(lane))
        drive.go(BACK + 200)
        return drive.gaps, drive.names

    gaps, names = in_child(job)
    assert 0.5 < min(gaps[:BACK]) < 5.0
    assert gaps[BACK - 1] == min(gaps[:BACK])
    assert gaps[-1] > 20.0  # on the free lane it has passed
    assert names == {"other"}


def test_who_comes_over_the_junction_stops_behind_the_rear_of_an_ego_that_is_still_on_it(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    net = plain_file(
        '<node id="a" x="-200" y="0"/>' + NODES,
        '<edge id="ab" from="a" to="b" speed="13.9" numLanes="2" width="4"/>' + EDGES,
    )
    traffic = FROM_BEHIND.format(1).replace('from="bc"', 'from="ab"')

    def job() -> list[float]:
        drive = Drive(tmp_path, net, traffic, position=0.2)
        drive.go(BACK)
        return drive.gaps

    assert 0.5 < min(in_child(job)) < 5.0


@pytest.mark.parametrize("part", FORKS)
@pytest.mark.parametrize("past", [5.0, 8.0, 13.0, 15.0, 16.0, 17.0])  # [m] the front is beyond the stop line
def test_who_leaves_its_lane_by_a_way_beside_the_egos_stops_behind_it_on_the_junction(
    tmp_path: Path, plain_file: Callable[..., Path], part: str, past: float
) -> None:
    ways, traffic = FORKS[part]
    net = plain_file(FORK_NODES, FORK_EDGES, ways)
    assert 0.5 < min(_gaps_to_one_that_stops(tmp_path, net, traffic, lambda lane: lane.startswith(":"), past)) < 5.0


@pytest.mark.parametrize(("aside", "stops"), [(1.5, True), (1.0, False)])  # [m] to the left of its lane's middle
def test_who_comes_from_the_lane_beside_stops_on_the_junction_behind_an_ego_that_is_in_its_way(
    tmp_path: Path, plain_file: Callable[..., Path], aside: float, *, stops: bool
) -> None:
    net = plain_file(CROSS_NODES, CROSS_EDGES)
    assert _is_stopped_for(tmp_path, net, CROSSING, lambda lane: lane.startswith(":"), 11.0, aside) is stops


@pytest.mark.parametrize(
    ("edges", "aside", "origin"),  # [m] to the left of its route's line
    [("ab bc", 3.2, "ab_1"), ("ab bc ce", -3.2, "ab_0")],
    ids=["on a lane to pass on", "before a change of lanes"],
)
def test_an_ego_beside_its_route_has_come_by_the_lane_that_leads_to_where_its_front_is(
    tmp_path: Path, plain_file: Callable[..., Path], edges: str, aside: float, origin: str
) -> None:
    net = plain_file(ALONG_NODES, ALONG_EDGES, ALONG_WAYS)
    trip = f'<vehicle id="ego" depart="0" departLane="0" departSpeed="0"><route edges="{edges}"/></vehicle>'
    entry = entered(scenario_file(tmp_path, net, trip))
    route = RoadMap.load(net).route(entry.edges, entry.lane, entry.position, None, 100.0)
    ego = Ego(entry, route, VehicleLimits())
    junction = route.stop_lines[0]
    rear = 0.5 * (junction.station + junction.exit_station) - ego.shape.front
    for station in [*np.arange(ego.station(), rear).tolist(), rear, rear]:
        move = _to(route.line.poses(np.array([station]), aside)[0].tolist(), ego.truth)
        ego.vehicle.advance(ControlCommand(0.0, 0.0, 0.0, move), STEP)
        lane = ego.lane()
    assert lane.startswith(":b_")
    assert lane not in route.lane_ids
    assert ego.straddled(lane)[0] == End(lane, origin)


def test_an_ego_on_a_junction_right_behind_another_one_has_come_by_the_road_between(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    nodes = (("a", -90, 0), ("b", 0, 0), ("c", 8, 0), ("d", 90, 0), ("n", 0, 90), ("s", 8, -90))
    roads = ("ab", "bc", "cd", "nb", "cs")
    net = plain_file(
        "".join(f'<node id="{name}" x="{x}" y="{y}"/>' for name, x, y in nodes),
        "".join(f'<edge id="{name}" from="{name[0]}" to="{name[1]}"/>' for name in roads),
    )
    trip = '<vehicle id="ego" depart="0" departPos="60" departSpeed="0"><route edges="ab bc cd"/></vehicle>'
    entry = entered(scenario_file(tmp_path, net, trip))
    route = RoadMap.load(net).route(entry.edges, entry.lane, entry.position, None, 40.0)
    assert "bc_0" not in route.lane_ids
    ego, origins = Ego(entry, route, VehicleLimits()), set[End]()
    for station in np.arange(ego.station(), 100.0, 0.5).tolist():
        move = _to(route.line.poses(np.array([station]))[0].tolist(), ego.truth)
        ego.vehicle.advance(ControlCommand(0.0, 0.0, 0.0, move), STEP)
        origins.update(ego.straddled(ego.lane()))
    assert {end.origin for end in origins if end.lane.startswith(":b_")} == {"ab_0"}
    assert {end.origin for end in origins if end.lane.startswith(":c_")} == {"bc_0"}


@pytest.mark.parametrize(("past", "stops"), [(1.0, True), (2.0, False)])  # [m] the front is beyond the junction
def test_who_comes_by_another_way_stops_for_a_tail_that_is_still_on_the_junction_and_in_its_way(
    tmp_path: Path, plain_file: Callable[..., Path], past: float, *, stops: bool
) -> None:
    net = plain_file(MERGE_NODES, MERGE_EDGES, MERGE_WAYS)
    assert _is_stopped_for(tmp_path, net, MERGING, lambda lane: lane == "be_0", past) is stops


@pytest.mark.parametrize(("past", "stops"), [(10.0, True), (25.0, False)])  # [m] the front is beyond the junction
def test_who_crosses_a_road_that_has_left_the_junction_stops_for_an_ego_there(
    tmp_path: Path, plain_file: Callable[..., Path], past: float, *, stops: bool
) -> None:
    net = plain_file(CROSS_NODES, BULGE_EDGES, BULGE.format(16))
    assert _is_stopped_for(tmp_path, net, BULGING, lambda lane: lane == "bc_0", past) is stops


@pytest.mark.parametrize(("past", "stops"), [(50.0, False), (57.0, True)])  # [m] the front is along its route
def test_who_crosses_a_road_before_the_junction_stops_for_an_ego_there(
    tmp_path: Path, plain_file: Callable[..., Path], past: float, *, stops: bool
) -> None:
    net = plain_file(CROSS_NODES, BULGE_EDGES.replace('"9"', '"1"', 1), BULGE.format(-16))
    assert _is_stopped_for(tmp_path, net, BULGING, lambda lane: lane == "ab_0", past) is stops


@pytest.mark.parametrize(("corner", "stops"), [("-1.6,-1.6", True), ("-4,4", False)])
def test_who_need_not_mind_the_egos_way_by_the_net_stops_for_an_ego_that_is_in_its_way(
    tmp_path: Path, plain_file: Callable[..., Path], corner: str, *, stops: bool
) -> None:
    net = plain_file(CROSS_NODES, NEARBY_EDGES, NEARBY.format(corner))
    assert _is_stopped_for(tmp_path, net, TURNING, lambda lane: lane.startswith(":"), 10.0) is stops


def test_devices_of_all_vehicles_do_not_mind_what_stands_for_an_ego_on_a_junction(
    tmp_path: Path, plain_file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    net = plain_file(CROSS_NODES, NEARBY_EDGES, NEARBY.format("-1.6,-1.6"))
    ssm = {"device__ssm__probability": "1"}
    gaps = _gaps_to_one_that_stops(tmp_path, net, TURNING, lambda lane: lane.startswith(":"), 10.0, options=ssm)
    assert 0.3 < gaps[-1] < 5.0


def test_who_stops_for_an_ego_in_a_way_drawn_over_its_own_does_not_stay_for_ever(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    """The ego may wait for that one in turn."""
    net = plain_file(CROSS_NODES, NEARBY_EDGES, NEARBY.format("-1.6,-1.6"))
    gaps = _gaps_to_one_that_stops(tmp_path, net, TURNING, lambda lane: lane.startswith(":"), 10.0, steps=450)
    assert max(gaps[250:290]) < 5.0  # it has stood for less than 20 s
    assert gaps[-1] > 20.0


@pytest.mark.parametrize(("aside", "waits"), [(-3.2, True), (0.0, False)])  # [m] of the road that one turns into
def test_who_turns_into_a_road_that_lies_on_the_egos_waits_at_the_line_for_it(
    tmp_path: Path, plain_file: Callable[..., Path], aside: float, *, waits: bool
) -> None:
    net = plain_file(ONTO_NODES, ONTO_EDGES.format(aside))
    gaps = _gaps_to_one_that_stops(tmp_path, net, ONTO, lambda lane: lane == "ab_0", 57.0)
    assert min(gaps) > 0.3
    assert (10.0 < gaps[-1] < 15.0) is waits


@pytest.mark.parametrize(("who", "stops"), [("passenger", False), ("bus", True)])
def test_a_bus_needs_all_of_a_lane_of_its_own(
    tmp_path: Path, plain_file: Callable[..., Path], who: str, *, stops: bool
) -> None:
    crossing = BULGE.format(16).replace("from", f'allow="{who}" from', 1)
    kind = '<vType id="bus" vClass="bus"/><vType id="passenger"/>'
    traffic = kind + BULGING.replace('id="other"', f'id="other" type="{who}"')
    net = plain_file(CROSS_NODES, BULGE_EDGES, crossing)
    assert _is_stopped_for(tmp_path, net, traffic, lambda lane: lane == "bc_0", 17.7) is stops


def test_who_walks_by_an_ego_that_is_hardly_on_the_sidewalk_walks_on(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    net = plain_file(NODES, '<edge id="bc" from="b" to="c" speed="13.9" sidewalkWidth="2"/>')
    assert _gaps_to_one_that_stops(tmp_path, net, WALKING, lambda lane: lane == "bc_1", 60.0, -1.0)[-1] > 15.0


def _is_stopped_for(
    folder: Path, net: Path, traffic: str, is_there: Callable[[str], bool], past: float, aside: float = 0.0
) -> bool:
    """Whether somebody stops behind an ego as of `_gaps_to_one_that_stops`; either way nobody touches it."""
    gaps = _gaps_to_one_that_stops(folder, net, traffic, is_there, past, aside)
    assert min(gaps) > 0.3
    return gaps[-1] < 5.0


def _gaps_to_one_that_stops(
    folder: Path,
    net: Path,
    traffic: str,
    is_there: Callable[[str], bool],
    past: float,
    aside: float = 0.0,
    steps: int = 250,
    options: dict[str, str] | None = None,
) -> list[float]:
    """How far others are from an ego whose front stops so far [m] past the first of its lanes that is there.

    It is `aside` [m] of their middle, to the left.
    """

    def job() -> list[float]:
        world = World(load_scenario(scenario_file(folder, net, traffic, **(options or {})), "ego"), folder)
        entry = world.await_ego((), lambda _: True)
        route = RoadMap.load(net).route(entry.edges, entry.lane, entry.position, None, 100.0)
        ego = world.adopt(entry, route, VehicleLimits())
        stop = next(row for row, lane in enumerate(route.lane_ids) if is_there(lane)) + past - ego.shape.front
        gaps = []
        for station in np.minimum(ego.station() + 0.5 * np.arange(steps), stop):
            move = _to(route.line.poses(np.array([station]), aside)[0].tolist(), ego.truth)
            ego.vehicle.advance(ControlCommand(world.time, 0.0, 0.0, move), STEP)
            world.advance()
            gaps.append(_gap(ego, world.observe(ego).objects))
        return gaps

    return in_child(job)


def _gap(ego: Ego, others: ObjectsTruth) -> float:
    """From an ego to the nearest of the others [m]."""
    truth = ego.truth
    own = box_of(truth.x, truth.y, truth.heading, ego.shape)
    return float(distances(own, others.boxes).min(initial=math.inf))


def _to(pose: Sequence[float], truth: EgoTruth) -> PoseStep:
    """The step that takes an ego to `pose`: x, y, heading."""
    x, y, heading = pose[0] - truth.x, pose[1] - truth.y, truth.heading
    ahead, left = x * math.cos(heading) + y * math.sin(heading), y * math.cos(heading) - x * math.sin(heading)
    return PoseStep(ahead, left, wrapped(pose[2] - heading), 0.0)


@pytest.mark.parametrize("end", ["of its trip", "by SUMO"])
def test_nothing_of_an_ego_stays_on_the_road_without_it(
    tmp_path: Path, plain_file: Callable[..., Path], end: str
) -> None:
    net = plain_file(NODES, EDGES)

    def job() -> tuple[int, tuple[str, ...]]:
        import libsumo  # noqa: PLC0415 one simulation a process: never in the tests' own

        drive = Drive(tmp_path, net, FROM_BEHIND.format(1))
        drive.go(50)
        before = libsumo.vehicle.getIDCount()
        if end == "of its trip":
            drive.world.dismiss(drive.ego)
        else:
            step = libsumo.simulationStep

            def take_off() -> None:
                for kind in (libsumo.constants.CMD_GET_VEHICLE_VARIABLE, libsumo.constants.CMD_GET_PERSON_VARIABLE):
                    libsumo.vehicle.unsubscribeContext("ego", kind, 0.0)
                libsumo.vehicle.remove("ego")
                step()

            libsumo.simulationStep = take_off
        drive.world.advance()
        return before, libsumo.vehicle.getIDList()

    assert in_child(job) == (3, ("other",))


def test_who_is_already_beside_it_drives_on(tmp_path: Path, plain_file: Callable[..., Path]) -> None:
    net = plain_file(NODES, EDGES)

    def job() -> list[float]:
        drive = Drive(tmp_path, net, BESIDE)
        drive.go(BACK)
        return drive.gaps

    assert in_child(job)[-1] == math.inf  # out of sight


def test_who_is_already_beside_it_drives_on_along_lanes_that_are_drawn_longer_than_they_count(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    net = plain_file(NODES, EDGES.replace("speed", 'length="200" speed'))

    def job() -> tuple[list[float], set[str]]:
        import libsumo  # noqa: PLC0415 one simulation a process: never in the tests' own

        drive = Drive(tmp_path, net, BESIDE.replace('"98"', '"130"'), position=130.0)
        shadowed = set[str]()
        for _ in range(BACK):
            drive.go(1)
            if drive.gaps[-1] < BESIDE_IT:
                shadowed |= {*libsumo.vehicle.getIDList()} - {"ego", "other"}
        return drive.gaps, shadowed

    gaps, shadowed = in_child(job)
    assert min(gaps) < BESIDE_IT
    assert shadowed == set()
    assert gaps[-1] == math.inf  # out of sight


def test_the_sub_lane_model_needs_nothing_more(tmp_path: Path, plain_file: Callable[..., Path]) -> None:
    net = plain_file(NODES, EDGES)

    def job() -> tuple[int, list[float]]:
        import libsumo  # noqa: PLC0415 one simulation a process: never in the tests' own

        drive = Drive(tmp_path, net, FROM_BEHIND.format(1), lateral_resolution="0.8")
        drive.go(100)
        return libsumo.vehicle.getIDCount(), drive.gaps

    count, gaps = in_child(job)
    assert count == 2
    assert min(gaps) > 0.2


@pytest.mark.parametrize(
    ("low", "expected"),
    [(1.0, (10.0, 15.0)), (1.7, None), (-1.0, (10.0, 15.0)), (-3.0, (10.0, 15.0)), (-3.5, None)],
)
def test_a_body_is_in_the_way_that_leaves_a_car_no_room_to_pass(low: float, expected: Any) -> None:
    middle, body = shapely.LineString([(0.0, 0.0), (100.0, 0.0)]), shapely.box(10.0, low, 15.0, low + 1.8)
    assert taken(body, middle, 3.2) == (expected and pytest.approx(expected))


def test_a_body_beyond_the_end_of_a_lane_is_not_in_its_way() -> None:
    middle = shapely.LineString([(0.0, 0.0), (100.0, 0.0)])
    assert taken(shapely.box(100.5, -0.9, 105.5, 0.9), middle, 3.2) is None
    assert taken(shapely.box(98.0, -0.9, 103.0, 0.9), middle, 3.2) == pytest.approx((98.0, 100.0))
    assert taken(shapely.box(-3.0, -0.9, 2.0, 0.9), middle, 3.2) == pytest.approx((-3.0, 2.0))
