"""Waiting for an ego: chosen, late, hindered, never; and an ego that is taken away."""

from collections.abc import Callable
from pathlib import Path

import pytest
from small_scenarios import EGO, in_child, scenario_file
from watched_world import STANDING, entered

from dvca_sumo.roadmap import RoadMap
from dvca_sumo.scenario import ScenarioError, load_scenario
from dvca_sumo.world import Ego, VehicleLimits, World

FLOW = '<flow id="many" from="ab" to="bc" begin="0" period="2" number="60"/>'


def test_an_ego_that_departs_long_after_the_first_routes_are_read_is_awaited(tmp_path: Path, street: Path) -> None:
    assert entered(scenario_file(tmp_path, street, EGO.replace('"0"', '"900"'))).time == pytest.approx(900.1)


def test_a_vehicle_of_a_flow_can_be_the_ego(tmp_path: Path, street: Path) -> None:
    entry = entered(scenario_file(tmp_path, street, FLOW), ego="many.3")
    assert (entry.ego, entry.edges) == ("many.3", ("ab", "bc"))


@pytest.mark.parametrize("is_left_hand", [False, True])
@pytest.mark.parametrize("aside", ["left", "center", "right"])
def test_an_ego_departs_on_the_side_of_its_lane_where_sumo_has_it(
    tmp_path: Path, grid_file: Callable[..., Path], aside: str, *, is_left_hand: bool
) -> None:
    """SUMO counts to the other side where traffic keeps left."""
    net = grid_file("--lefthand") if is_left_hand else grid_file()
    trip = f'<trip id="ego" from="A1B1" to="B1C1" depart="0" departPos="50" departPosLat="{aside}"/>'
    entry = entered(scenario_file(tmp_path, net, trip))
    line = RoadMap.load(net).lanes[entry.lane].line
    (_, (beside,)) = line.project([[entry.front_x, entry.front_y]])
    assert entry.beside == pytest.approx(beside, abs=1e-6)
    assert (abs(beside) > 0.5) == (aside != "center")


def test_auto_takes_the_first_car_that_meets_traffic(tmp_path: Path, street: Path) -> None:
    bus = '<vType id="bus" vClass="bus"/><vehicle id="bus" type="bus" depart="60"><route edges="nb bs"/></vehicle>'
    entry = entered(scenario_file(tmp_path, street, FLOW + bus), ego="auto")
    assert entry.vehicle_class == "passenger"
    assert 60.0 <= entry.time < 65.0


def test_auto_says_when_no_trip_is_fit(tmp_path: Path, street: Path) -> None:
    scenario = load_scenario(scenario_file(tmp_path, street, FLOW), "auto", begin=5.0, end=70.0)

    def job() -> None:
        World(scenario, tmp_path).await_ego((), lambda _: False)

    says = (
        r"no vehicle fit to be the ego departs between 5 s and 70 s; departed: "
        r"\d+ before 65 s \(auto chooses from 60 s after the begin on\), \d+ without a trip"
    )
    with pytest.raises(ScenarioError, match=says):
        in_child(job)


@pytest.mark.parametrize(("kind", "says"), [('vClass="bus"', "of class bus"), ('length="12"', "longer than 7 m")])
def test_auto_says_what_those_are_that_depart(tmp_path: Path, street: Path, kind: str, says: str) -> None:
    bus = f'<vType id="bus" {kind}/><vehicle id="bus" type="bus" depart="60"><route edges="nb bs"/></vehicle>'
    with pytest.raises(ScenarioError, match=rf"between 0 s and .* s; departed: 1 {says}$"):
        entered(scenario_file(tmp_path, street, bus), ego="auto")


def test_an_ego_whose_time_comes_after_the_end_never_departs(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, EGO.replace('"0"', '"40"'), end="30")
    with pytest.raises(ScenarioError, match="the ego 'ego' never departs between 0 s and 30 s"):
        entered(config)


def test_an_ego_that_waits_for_a_ride_never_departs(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, STANDING.replace('depart="0"', 'depart="triggered"'), end="5")
    with pytest.raises(ScenarioError, match="the ego 'ego' never departs"):
        entered(config)


def test_an_ego_whose_place_stays_taken_is_not_awaited_for_ever(tmp_path: Path, street: Path) -> None:
    blocked = (
        '<vehicle id="first" depart="0" departPos="20"><route edges="bc"/>'
        '<stop lane="bc_0" endPos="21" duration="1e6"/></vehicle>'
    )
    config = scenario_file(tmp_path, street, blocked + STANDING, time_to_teleport="-1")
    with pytest.raises(ScenarioError, match="the ego 'ego' finds no room to depart until 60"):
        entered(config)


def test_the_world_says_which_ego_sumo_removed(tmp_path: Path, street: Path) -> None:
    scenario = load_scenario(scenario_file(tmp_path, street, STANDING))
    roadmap = RoadMap.load(street)

    def job() -> list[list[str]]:
        import libsumo  # noqa: PLC0415

        world = World(scenario, tmp_path)
        entry = world.await_ego((), lambda _: True)
        world.adopt(entry, roadmap.route(entry.edges, entry.lane, entry.position, None, 200.0), VehicleLimits())
        lost = [world.advance()]
        step = libsumo.simulationStep
        libsumo.simulationStep = lambda: (step(), libsumo.vehicle.remove("ego"))
        lost.append(world.advance())
        return [[ego.name for ego in egos] for egos in lost]

    assert in_child(job) == [[], ["ego"]]


def test_a_dismissed_ego_is_gone_and_the_world_goes_on(tmp_path: Path, street: Path) -> None:
    other = STANDING.replace('"ego"', '"other"').replace('"20"', '"60"')
    scenario = load_scenario(scenario_file(tmp_path, street, STANDING + other))
    roadmap = RoadMap.load(street)

    def job() -> list[tuple[str, ...]]:
        world = World(scenario, tmp_path)
        world.advance()
        egos = []
        for name in sorted(world.departed()):
            entry = world.entry(name, ())
            route = roadmap.route(entry.edges, entry.lane, entry.position, None, 200.0)
            egos.append(world.adopt(entry, route, VehicleLimits()))
        seen = []
        for step in range(6):
            if step == 3:
                world.dismiss(egos[0])
            assert world.advance() == ()
            seen.append(world.observe(egos[1]).objects.ids)
        return seen

    assert in_child(job) == [("ego",)] * 3 + [()] * 3


def entered_ego(config: Path, net: Path) -> Ego:
    """The ego as the world adopts it, with the route to the end of its last edge."""
    entry = entered(config)
    roadmap = RoadMap.load(net)
    end = roadmap.lanes[f"{entry.edges[-1]}_0"].length
    return Ego(entry, roadmap.route(entry.edges, entry.lane, entry.position, None, end), VehicleLimits())


def test_an_ego_departs_along_its_route_wherever_sumo_turned_it(
    tmp_path: Path, plain_file: Callable[..., Path]
) -> None:
    """SUMO lets a vehicle at the begin of its lane point along a road that leads there."""
    nodes = '<node id="a" x="-100" y="-100"/><node id="b" x="0" y="0"/><node id="c" x="200" y="0"/>'
    edges = '<edge id="ab" from="a" to="b" speed="13.9"/><edge id="bc" from="b" to="c" speed="13.9"/>'
    ego = '<vehicle id="ego" depart="0" departPos="0" departSpeed="10"><route edges="bc"/></vehicle>'
    net = plain_file(nodes, edges)
    config = scenario_file(tmp_path, net, ego)
    assert entered(config).heading > 0.2
    truth = entered_ego(config, net).truth
    assert (truth.heading, truth.speed) == pytest.approx((0.0, 10.0), abs=1e-3)
    assert truth.y == pytest.approx(-1.6, abs=1e-2)


@pytest.mark.parametrize(("position", "slowest", "fastest"), [("102", 3.0, 9.0), ("20", 10.0, 10.0)])
def test_an_ego_departs_no_faster_than_the_next_turn_allows(
    tmp_path: Path, plain_file: Callable[..., Path], position: str, slowest: float, fastest: float
) -> None:
    nodes = '<node id="a" x="0" y="0"/><node id="b" x="120" y="0"/><node id="c" x="120" y="-120"/>'
    edges = '<edge id="ab" from="a" to="b" speed="13.9"/><edge id="bc" from="b" to="c" speed="13.9"/>'
    ego = f'<vehicle id="ego" depart="0" departPos="{position}" departSpeed="10"><route edges="ab bc"/></vehicle>'
    net = plain_file(nodes, edges)
    config = scenario_file(tmp_path, net, ego)
    assert entered(config).speed == 10.0
    assert slowest <= entered_ego(config, net).truth.speed <= fastest
