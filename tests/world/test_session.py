"""SUMO's truth in the project's conventions: who is there, where, how big; and what SUMO does to an ego."""

import itertools
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scenarios import EGO, in_child, scenario_file
from watched_world import STANDING, STEP, asked, entered, objects_of, watch, watched

from dvca_sumo.engine.replay import roadmap
from dvca_sumo.messages import ObjectClass, SignalColour
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.run import Task, departed
from dvca_sumo.scenario import ScenarioError, load_scenario
from dvca_sumo.stack.reference import reference_stack
from dvca_sumo.world import World

CAR_IN_THE_WAY = (
    '<vehicle id="stopped" depart="0" departPos="60"><route edges="bc"/>'
    '<stop lane="bc_0" endPos="61" duration="1000"/></vehicle>'
)


def test_an_ego_enters_as_sumo_put_it_there(tmp_path: Path, street: Path) -> None:
    mark = '<param key="dvca.ttc" value="0.7"/><param key="other" value="1"/>'
    routes = (
        '<vType id="van" length="6" width="2.1" vClass="delivery"/>'
        '<vehicle id="ego" type="van" depart="2.5" departPos="20" departSpeed="5" departLane="1">'
        f'<route edges="bc cb"/>{mark}</vehicle>'
    )
    entry = entered(scenario_file(tmp_path, street, routes), settings=("ttc", "safe_distance"))
    assert (entry.ego, entry.time, entry.vehicle_class) == ("ego", 2.6, "delivery")
    assert (entry.length, entry.width) == (6.0, 2.1)
    assert (entry.edges, entry.lane, entry.position) == (("bc", "cb"), "bc_1", 20.0)
    assert entry.parameters == {"ttc": "0.7"}
    assert entry.heading == pytest.approx(0.0)
    assert entry.front_y == pytest.approx(-1.6)
    assert entry.speed == 5.0


def test_the_ego_stands_where_sumo_had_it_and_is_seen_by_its_own_motion_only(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, STANDING)
    first, *_, last = watched(config, 20, speed=5.0)
    assert last.ego.x - first.ego.x == pytest.approx(10.0)
    assert last.ego.speed == pytest.approx(5.0)
    assert last.time == pytest.approx(first.time + 2.0)
    assert "ego" not in last.objects.ids
    x, y = asked(config, 20, lambda sumo: sumo.vehicle.getPosition("ego"), speed=5.0)
    assert (x, y) == pytest.approx((last.ego.x + last.shape.front, last.ego.y))
    assert asked(config, 20, lambda sumo: sumo.vehicle.getSpeed("ego"), speed=5.0) == pytest.approx(5.0)


def test_vehicles_of_all_sizes_are_boxes_around_their_centre(tmp_path: Path, street: Path) -> None:
    routes = (
        '<vType id="bus" vClass="bus" length="12" width="2.5"/>'
        '<vType id="bike" vClass="bicycle" length="1.6" width="0.6"/>'
        '<vehicle id="bus" type="bus" depart="0" departPos="220" departLane="1"><route edges="cb"/></vehicle>'
        '<vehicle id="bike" type="bike" depart="0" departPos="100" departSpeed="4"><route edges="bc"/></vehicle>'
    )
    config = scenario_file(tmp_path, street, routes + STANDING)
    moment = watched(config, 3)[-1]
    rows, truth = objects_of(moment), moment.objects
    bus, bike = rows["bus"], rows["bike"]
    assert (truth.classes[bus], truth.classes[bike]) == (ObjectClass.VEHICLE, ObjectClass.BICYCLE)
    assert abs(truth.boxes[bus, 2]) == pytest.approx(math.pi)
    assert truth.boxes[bus, 3:].tolist() == [12.0, 2.5]
    assert truth.boxes[bike, 2:].tolist() == pytest.approx([0.0, 1.6, 0.6])
    assert truth.velocities[bike, 0] > 3.0
    assert truth.velocities[bus] == pytest.approx([-float(np.hypot(*truth.velocities[bus])), 0.0], abs=1e-9)
    assert (truth.lanes[bus], truth.lanes[bike]) == ("cb_1", "bc_0")
    bus_x, bus_y = asked(config, 3, lambda sumo: sumo.vehicle.getPosition("bus"))
    assert truth.boxes[bus, :2].tolist() == pytest.approx([bus_x + 6.0, bus_y])


def test_a_body_is_as_fast_as_it_is_moved(tmp_path: Path, plain_file: Callable[..., Path]) -> None:
    nodes = '<node id="b" x="200" y="0"/><node id="c" x="500" y="0"/>'
    there = '<edge id="bc" from="b" to="c" numLanes="2" speed="13.9"/>'
    back = '<edge id="cb" from="c" to="b" numLanes="2" speed="13.9" length="200"/>'  # drawn half as long again
    driver = '<vehicle id="other" depart="0" departPos="130" departSpeed="10"><route edges="cb"/></vehicle>'
    moments = watched(scenario_file(tmp_path, plain_file(nodes, there + back), STANDING + driver), 20)
    rows = [objects_of(moment)["other"] for moment in moments]
    places = [moment.objects.boxes[row, 0] for moment, row in zip(moments, rows, strict=True)]
    speeds = [moment.objects.velocities[row, 0] for moment, row in zip(moments, rows, strict=True)]
    assert speeds[1:] == pytest.approx((np.diff(places) / STEP).tolist())
    assert speeds[1] < -14.0


def test_a_parked_car_is_seen_beside_the_road(tmp_path: Path, street: Path) -> None:
    parked = CAR_IN_THE_WAY.replace("/></vehicle>", ' parking="true"/></vehicle>')
    moment = watched(scenario_file(tmp_path, street, STANDING + parked), 50)[-1]
    box = moment.objects.boxes[objects_of(moment)["stopped"]]
    assert box[1] < -6.4  # the road's edge
    assert np.hypot(*moment.objects.velocities[0]) == 0.0


def test_people_on_foot_are_bodies_and_riders_and_containers_are_not(tmp_path: Path, street: Path) -> None:
    routes = (
        '<vehicle id="car" depart="0" departPos="120" departLane="1"><route edges="bc"/></vehicle>'
        '<person id="walker" depart="0" departPos="50"><walk edges="bc" arrivalPos="-1"/></person>'
        '<person id="waiting" depart="0" departPos="90"><stop lane="bc_0" duration="100"/></person>'
        '<person id="late" depart="50" departPos="90"><stop lane="bc_0" duration="100"/></person>'
        '<person id="rider" depart="triggered"><ride from="bc" to="bc" lines="car"/></person>'
        '<container id="box" depart="0" departPos="50"><tranship edges="bc" arrivalPos="200"/></container>'
    )
    moment = watched(scenario_file(tmp_path, street, STANDING + routes), 20)[-1]
    assert set(moment.objects.ids) == {"car", "person:walker", "person:waiting"}
    walker = objects_of(moment)["person:walker"]
    assert moment.objects.classes[walker] == ObjectClass.PEDESTRIAN
    assert moment.objects.velocities[walker, 0] == pytest.approx(1.3, abs=0.4)
    assert moment.objects.boxes[walker, 3] < moment.objects.boxes[walker, 4] < 1.0


def test_a_person_with_the_name_of_a_vehicle_is_another_body(tmp_path: Path, street: Path) -> None:
    person = '<person id="stopped" depart="0" departPos="50"><walk edges="bc" arrivalPos="0"/></person>'
    moment = watched(scenario_file(tmp_path, street, STANDING + CAR_IN_THE_WAY + person), 60)[-1]
    rows, truth = objects_of(moment), moment.objects
    assert set(rows) == {"stopped", "person:stopped"}
    car, walker = rows["stopped"], rows["person:stopped"]
    assert truth.boxes[car, 2] == pytest.approx(0.0)
    assert truth.velocities[car].tolist() == [0.0, 0.0]
    assert math.cos(truth.boxes[walker, 2]) == pytest.approx(-1.0)
    assert truth.velocities[walker, 0] < -0.8


def test_nobody_beyond_the_radius_is_reported(tmp_path: Path, street: Path) -> None:
    routes = STANDING + "".join(
        f'<vehicle id="at{position}" depart="0" departPos="{position}" departLane="1"><route edges="bc"/></vehicle>'
        for position in (160, 190)
    )
    poles = '<poi id="near" type="obstacle.pole" x="360" y="9"/><poi id="far" type="obstacle.pole" x="390" y="9"/>'
    moment = watched(scenario_file(tmp_path, street, routes, poles), 0)[-1]
    assert set(moment.objects.ids) == {"at160", "poi:near"}


def test_pois_and_polygons_are_bodies_when_their_type_says_so(tmp_path: Path, street: Path) -> None:
    additional = (
        '<poi id="cone" type="obstacle.cone" x="250" y="10" width="0.4" height="0.6" angle="30"/>'
        '<poi id="tree" type="tree" x="250" y="10"/><poly id="house" type="building" shape="0,0 1,0 1,1" fill="1"/>'
        '<poly id="wall" type="obstacle.wall" shape="240,20 250,20 250,30" lineWidth="0.5"/>'
        '<poly id="box" type="obstacle.box" fill="1" shape="240,-20 244,-20 244,-22 240,-22"/>'
    )
    moment = watched(scenario_file(tmp_path, street, STANDING, additional), 0)[-1]
    rows, boxes = objects_of(moment), moment.objects.boxes
    assert set(rows) == {"poi:cone", "polygon:wall#0", "polygon:wall#1", "polygon:box"}
    assert boxes[rows["poi:cone"]].tolist() == pytest.approx([250.0, 10.0, math.radians(60.0), 0.6, 0.4])
    assert boxes[rows["polygon:wall#1"]].tolist() == pytest.approx([250.0, 25.0, math.pi / 2, 10.0, 0.5])
    assert sorted(boxes[rows["polygon:box"], 3:]) == pytest.approx([2.0, 4.0])
    assert set(moment.objects.classes.tolist()) == {ObjectClass.STATIC}


def test_signals_show_their_colour_for_the_egos_movement(tmp_path: Path, street: Path) -> None:
    red, yellow, green, permissive, off = list(SignalColour)
    shown = dict(zip("ruyYGgsoO", (red, red, yellow, yellow, green, permissive, permissive, off, off), strict=True))
    phases = "".join(f'<phase duration="1" state="{letter * 20}"/>' for letter in shown)
    light = f'<tlLogic id="b" programID="all" type="static">{phases}</tlLogic>'
    ego = STANDING.replace('from="bc"', 'from="ab"')
    moments = watched(scenario_file(tmp_path, street, ego, light), 89)
    assert all(len(moment.signals) == 1 for moment in moments)
    assert [next(iter(moment.signals.values())) for moment in moments[4::10]] == list(shown.values())


def test_a_teleporting_vehicle_is_nowhere(tmp_path: Path, street: Path) -> None:
    routes = (
        '<vehicle id="ego" depart="0" departPos="40" departSpeed="0"><route edges="nb bs"/></vehicle>'
        '<vehicle id="stopped" depart="0" departPos="20"><route edges="sb bn"/>'
        '<stop lane="sb_0" endPos="40" duration="1000"/></vehicle>'
        '<vehicle id="jammed" depart="1" departPos="5"><route edges="sb bn"/></vehicle>'
    )
    config = scenario_file(tmp_path, street, routes, time_to_teleport="2", tls__all_off="true")
    moments = watched(config, 150)
    assert asked(config, 150, lambda sumo: sumo.simulation.getTime()) > 15.0
    places = [m.objects.boxes[objects_of(m)["jammed"], 1] for m in moments if "jammed" in m.objects.ids]
    assert max(np.diff(places)) > 20.0  # it was taken past the one in its way
    assert all(np.abs(moment.objects.boxes).max(initial=0.0) < 1e4 for moment in moments)


def test_an_ego_that_stands_longer_than_a_jam_may_last_stays(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, STANDING + CAR_IN_THE_WAY, time_to_teleport="2")
    assert asked(config, 60, lambda sumo: (sumo.vehicle.getRoadID("ego"), sumo.simulation.getTime())) == ("bc", 6.1)


def test_an_ego_past_its_arrival_position_stays(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, STANDING.replace("/>", ' arrivalPos="40"/>'))
    assert watched(config, 60, speed=10.0)[-1].ego.x > 280.0
    assert asked(config, 60, lambda sumo: sumo.vehicle.getIDList(), speed=10.0) == ("ego",)


def test_an_ego_past_the_end_of_the_net_stays(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, STANDING.replace('"20"', '"270"'))
    assert watched(config, 60, speed=10.0)[-1].ego.x > 520.0
    assert asked(config, 60, lambda sumo: sumo.vehicle.getIDList(), speed=10.0) == ("ego",)


@pytest.mark.parametrize("left", [-3.0, 3.0, 60.0])
def test_an_ego_beside_the_road_is_where_it_is(tmp_path: Path, street: Path, left: float) -> None:
    config = scenario_file(tmp_path, street, STANDING)
    last = watched(config, 50, speed=5.0, left=left)[-1]
    assert abs(last.ego.y) > 8.0
    x, y = asked(config, 50, lambda sumo: sumo.vehicle.getPosition("ego"), speed=5.0, left=left)
    assert (x, y) == pytest.approx((last.ego.x + last.shape.front, last.ego.y), abs=0.01)


def test_drivers_react_to_the_egos_true_speed_on_a_junction(tmp_path: Path, street: Path) -> None:
    ego = STANDING.replace('from="bc" to="bc"', 'from="sb" to="ba"').replace('"20"', '"60"')
    config = scenario_file(tmp_path, street, ego)

    def job() -> list[tuple[str, float]]:
        import libsumo  # noqa: PLC0415

        met: list[tuple[str, float]] = []
        step = libsumo.simulationStep

        def noting() -> None:
            if "ego" in libsumo.vehicle.getIDList():
                met.append((libsumo.vehicle.getRoadID("ego"), libsumo.vehicle.getSpeed("ego")))
            step()

        libsumo.simulationStep = noting
        watch(config, 40, speed=10.0, left=1.0)
        return met

    met = in_child(job)
    assert any(road.startswith(":b_") for road, _ in met)
    assert [speed for _, speed in met] == pytest.approx([10.0] * 40)


@pytest.mark.parametrize(("start", "left"), [("bc", 0.0), ("bc", 0.5), ("ab", 0.0)], ids=["lane", "change", "junction"])
def test_drivers_see_the_egos_true_lane_and_speed(tmp_path: Path, street: Path, start: str, left: float) -> None:
    position = 20.0 if start == "bc" else 150.0
    ego = STANDING.replace('from="bc"', f'from="{start}"').replace('"20"', f'"{position}"')
    config = scenario_file(tmp_path, street, ego)

    def job() -> list[tuple[str, float, tuple[float, float]]]:
        import libsumo  # noqa: PLC0415

        of, seen = libsumo.vehicle, []
        step = libsumo.simulationStep

        def noting() -> None:
            if "ego" in of.getIDList():
                seen.append((of.getLaneID("ego"), of.getSpeed("ego"), of.getPosition("ego")))
            step()

        libsumo.simulationStep = noting
        watch(config, 90, speed=8.0, left=left)
        return seen

    lanes = RoadMap.load(street).lanes
    begin, end = lanes["bc_0"].line.points[0, 0], lanes["ab_0"].line.points[-1, 0]
    seen = in_child(job)[1:]  # before the first it had only been taken over
    for lane, _, (x, y) in seen:
        edge = "ab" if x < end else "bc" if x > begin else ":b_14"
        beyond = y + 3.2  # the border of the two lanes; SUMO leaves the lane that the route has a little later
        assert 0.0 < beyond < 0.7 or lane == f"{edge}_{int(beyond > 0.0)}"
    assert len({lane for lane, _, _ in seen}) == {("bc", 0.0): 1, ("bc", 0.5): 2, ("ab", 0.0): 3}[start, left]
    assert {round(speed, 9) for _, speed, _ in seen} == {8.0}


def shown(config: Path, street: Path) -> list[tuple[float, float, str, int]]:
    """Speed [m/s], acceleration [m/s^2], lane and signals of the ego that its stack drives, after every step."""
    scenario = load_scenario(config)

    def job() -> list[tuple[float, float, str, int]]:
        import libsumo  # noqa: PLC0415

        of, seen = libsumo.vehicle, []
        step = libsumo.simulationStep

        def noting() -> None:
            is_there = "ego" in of.getIDList()
            motion = (of.getSpeed("ego"), of.getAcceleration("ego")) if is_there else ()
            step()
            if is_there:
                seen.append((*motion, of.getLaneID("ego"), of.getSignals("ego")))

        libsumo.simulationStep = noting
        with departed(Task(scenario), partial(roadmap, street), reference_stack) as simulation:
            simulation.proceed()
        return seen

    return in_child(job)[1:]


def test_the_ego_shows_when_it_brakes_and_where_it_turns(tmp_path: Path, street: Path) -> None:
    ego = STANDING.replace('from="bc" to="bc"', 'from="sb" to="ba"').replace('"0" departLane', '"9" departLane')
    stop = "<trip" + ego.partition("<trip")[2].replace("/>", ' arrivalPos="60"/>')
    seen = shown(scenario_file(tmp_path, street, stop, tls__all_off="true"), street)
    brakes = [signals & 8 > 0 for *_, signals in seen]
    assert all(
        is_lit == (speed < 0.1 or acceleration < -(0.05 + 0.005 * speed) * speed)
        for (speed, acceleration, _, _), is_lit in zip(seen, brakes, strict=True)
    )
    assert {True, False} == set(brakes)
    indicated = [(lane, signals & 3) for *_, lane, signals in seen]
    assert [side for side, _ in itertools.groupby(side for _, side in indicated)] == [0, 2, 0]
    assert {lane for lane, side in indicated if side} == {"sb_0", ":b_11_0", ":b_22_0"}


def test_the_ego_shows_that_it_changes_lanes(tmp_path: Path, street: Path) -> None:
    ego = '<trip id="ego" from="ab" to="bn" depart="0" departPos="20" departSpeed="8" departLane="0" arrivalPos="40"/>'
    seen = shown(scenario_file(tmp_path, street, ego, tls__all_off="true"), street)
    assert {lane for *_, lane, signals in seen if not signals & 3} >= {"ab_1"}
    sides = [side for side, _ in itertools.groupby(signals & 3 for *_, signals in seen)]
    assert sides == [0, 2, 0, 2, 0]  # a change of lanes, then the turn


def test_the_ego_shows_to_which_side_it_goes_when_it_passes_somebody(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    nodes = '<node id="a" x="0" y="0"/><node id="b" x="900" y="0"/>'
    net = plain_file(nodes, '<edge id="ab" from="a" to="b" numLanes="2" speed="20"/>')
    routes = (
        '<vType id="slow" maxSpeed="8"/><trip id="tractor" type="slow" depart="0" from="ab" to="ab" departPos="80"/>'
        '<trip id="ego" depart="1" from="ab" to="ab" departLane="0" departSpeed="18" arrivalPos="700"/>'
    )
    seen = shown(scenario_file(tmp_path, net, routes), net)
    sides = [side for side, _ in itertools.groupby(signals & 3 for *_, signals in seen)]
    assert [side for side in sides if side] == [2, 1]
    assert [lane for lane, _ in itertools.groupby(lane for *_, lane, _ in seen)] == ["ab_0", "ab_1", "ab_0"]


def test_vehicles_that_collide_with_the_ego_are_not_removed(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, STANDING + CAR_IN_THE_WAY, collision__action="remove")
    moments = watched(config, 70, speed=10.0)
    gaps = [abs(m.objects.boxes[0, 0] - (m.ego.x + m.shape.centre)) for m in moments]
    assert min(gaps) < 1.0
    assert moments[-1].objects.ids == ("stopped",)


def test_an_ego_of_a_class_with_a_lane_of_its_own_keeps_class_and_size(tmp_path: Path, street: Path) -> None:
    routes = '<vType id="bus" vClass="bus" length="12" width="2.5"/>' + STANDING.replace("<trip", '<trip type="bus"')
    question = lambda sumo: (  # noqa: E731 read where it is used
        sumo.vehicle.getVehicleClass("ego"),
        sumo.vehicle.getLength("ego"),
        sumo.vehicle.getWidth("ego"),
    )
    assert asked(scenario_file(tmp_path, street, routes), 5, question) == ("bus", 12.0, 2.5)


PLACES = (
    '<busStop id="market" lane="bc_0" startPos="40" endPos="60"/>'
    '<containerStop id="dock" lane="bc_0" startPos="40" endPos="60"/>'
    '<chargingStation id="socket" lane="bc_0" startPos="40" endPos="60"/>'
    '<parkingArea id="yard" lane="bc_0" startPos="40" endPos="60" roadsideCapacity="2"/>'
)
ON_LANE = 'lane="bc_0" startPos="40" endPos="60"'


@pytest.mark.parametrize(
    ("stop", "name"),
    [
        (f'{ON_LANE} duration="60"', "bc_0 at 60 m"),
        (f'{ON_LANE} until="90"', "bc_0 at 60 m"),
        (f'{ON_LANE} duration="60" parking="true"', "bc_0 at 60 m"),
        (f'{ON_LANE} triggered="true"', "bc_0 at 60 m"),
        (f'{ON_LANE} speed="3"', "bc_0 at 60 m"),
        ('edge="bc" endPos="60" duration="60"', "an edge at 60 m"),
        ('busStop="market" duration="60"', "market"),
        ('containerStop="dock" duration="60"', "dock"),
        ('chargingStation="socket" duration="60"', "socket"),
        ('parkingArea="yard" duration="60"', "yard"),
    ],
)
@pytest.mark.parametrize("depart", ["departPos='20'", "departPos='stop'"])
def test_an_ego_passes_its_stops_as_a_vehicle_on_the_road(
    tmp_path: Path, street: Path, stop: str, name: str, depart: str
) -> None:
    further = '<stop lane="bc_1" endPos="200" duration="9" parking="true"/>'  # of the vehicle; the other is its route's
    routes = f'<vehicle id="ego" depart="0" {depart}><route edges="bc"><stop {stop}/></route>{further}</vehicle>'
    config = scenario_file(tmp_path, street, routes, PLACES)
    assert entered(config).stops == (name, "bc_1 at 200 m")

    def job() -> list[Any]:
        import libsumo  # noqa: PLC0415

        of, seen = libsumo.vehicle, []
        step = libsumo.simulationStep

        def noting() -> None:
            step()
            seen.append((of.getRoadID("ego"), of.getStopState("ego"), len(of.getStops("ego"))))

        libsumo.simulationStep = noting
        moments = watch(config, 80, speed=10.0, left=0.0)
        x, _ = of.getPosition("ego")
        return [set(seen[1:]), x - moments[-1].ego.x - moments[-1].shape.front]

    assert in_child(job) == [{("bc", 0, 0)}, pytest.approx(0.0)]


@pytest.mark.parametrize(
    ("edges", "found"),
    [("ab", ""), ("ab bn", ""), ("ab bc", "bc_0"), ("ab ba", "")],
    ids=["past its last edge", "straight on where it was to turn", "over the junction", "where it was to turn back"],
)
@pytest.mark.parametrize(
    "stop",
    [
        'lane="ab_0" endPos="170" duration="9"',
        'lane="ab_0" endPos="170" speed="3"',
        'busStop="market" duration="9"',
        'parkingArea="yard" duration="9"',
    ],
)
def test_an_ego_that_had_stops_goes_where_it_goes_and_its_route_stays(
    tmp_path: Path, street: Path, stop: str, edges: str, found: str
) -> None:
    """Wherever SUMO found it beside its route, it would add the stops of its definition again, and give up."""
    ego = f'<vehicle id="ego" depart="0" departPos="150"><route edges="{edges}"/><stop {stop}/></vehicle>'
    places = PLACES.replace("bc_0", "ab_0").replace('"40"', '"155"').replace('"60"', '"175"')
    config = scenario_file(tmp_path, street, ego, places)
    last = watched(config, 120, speed=10.0)[-1]
    assert last.ego.x + last.shape.front == pytest.approx(270.0, abs=2.0)

    def question(sumo: Any) -> Any:
        of = sumo.vehicle
        return of.getPosition("ego"), of.getRoute("ego"), of.getLaneID("ego"), of.getStops("ego")

    place, route, lane, stops = asked(config, 120, question, speed=10.0)
    assert place == pytest.approx((last.ego.x + last.shape.front, last.ego.y), abs=0.01)
    assert (route, stops) == (tuple(edges.split()), ())
    assert lane == found


@pytest.mark.parametrize("step", ["1", "0.5", "0.05"])
@pytest.mark.parametrize(("configured", "interval"), [({}, 0.1), ({"default__action_step_length": "0.7"}, 0.7)])
def test_drivers_act_at_every_world_step_unless_the_scenario_has_them_act_at_intervals(
    tmp_path: Path, street: Path, step: str, configured: dict[str, str], interval: float
) -> None:
    """In steps of 0.1 s, drivers who act once a second jam junctions that flow in steps of 1 s, too."""
    config = scenario_file(tmp_path, street, STANDING + CAR_IN_THE_WAY, step_length=step, **configured)
    answers = asked(config, 1, lambda sumo: (sumo.vehicle.getActionStepLength("stopped"), sumo.simulation.getDeltaT()))
    assert answers == (interval, 0.1)


@pytest.mark.parametrize(("begin", "asked_for"), [("0:0:10", None), ("10", None), ("0", 10.0)])
def test_a_simulation_begins_when_it_shall(tmp_path: Path, street: Path, begin: str, asked_for: float | None) -> None:
    routes = EGO.replace('"0"', '"12"') + CAR_IN_THE_WAY.replace('"0"', '"3"').replace("stopped", "before")
    config = scenario_file(tmp_path, street, routes, begin=begin)

    def job() -> tuple[float, float, tuple[str, ...]]:
        import libsumo  # noqa: PLC0415

        world = World(load_scenario(config, begin=asked_for), tmp_path)
        started = world.time
        return started, world.await_ego((), lambda _: True).time, libsumo.vehicle.getIDList()

    assert in_child(job) == (10.0, 12.1, ("ego",))


def test_a_second_simulation_in_one_process_is_refused(tmp_path: Path, street: Path) -> None:
    scenario = load_scenario(scenario_file(tmp_path, street))

    def job() -> Any:
        World(scenario, tmp_path)
        with pytest.raises(ScenarioError, match="already loaded"):
            World(scenario, tmp_path)

    in_child(job)


def test_worlds_can_follow_each_other_in_one_process(tmp_path: Path, street: Path) -> None:
    scenario = load_scenario(scenario_file(tmp_path, street))
    broken = load_scenario(scenario_file(tmp_path / "broken", street, EGO + "<vehicle"))

    def job() -> list[float]:
        times = []
        for _ in range(2):
            with pytest.raises(ScenarioError, match="cannot start"):
                World(broken, tmp_path)
            world = World(scenario, tmp_path)
            times.append(world.await_ego((), lambda _: True).time)
            world.close()
        return times

    assert in_child(job) == [0.1, 0.1]
