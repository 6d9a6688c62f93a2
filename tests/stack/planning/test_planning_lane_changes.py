"""Changes of lane that the route needs: into a gap, or not at all."""

import math

import msgspec
import numpy as np
import pytest
from planned_drives import SHAPE, Drive, assert_drivable, believed, car, drive, predicted, road, stop_line

from dvca_sumo.geometry.boxes import box_of, distances
from dvca_sumo.messages import Floats, LocalizationEstimate
from dvca_sumo.roadmap import Control, Route
from dvca_sumo.roadmap.route import LaneChange
from dvca_sumo.stack.planning import Planner, PlanningConfig
from dvca_sumo.stack.planning.destination import stop_station
from dvca_sumo.stack.planning.lane_gaps import Gaps, Neighbours, Urgency
from dvca_sumo.stack.planning.reference import Reference

WIDTH = 3.2  # [m] of a lane
START, LATEST = 100.0, 400.0  # [m]


def crossing_over(lanes: int = 1) -> Route:
    """Along x; from 100 m on the line moves over so many lanes to the left, and the ego's own lane ends at 400 m."""
    stations = np.arange(0.0, 600.5)
    share = np.clip((stations - START) / (50.0 * lanes), 0.0, 1.0)
    line = lanes * WIDTH * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    found = road(np.column_stack((stations, line)), destination=590.0)
    along = found.line.stations
    over = np.interp(along, np.hypot(np.diff(stations, prepend=0.0), np.diff(line, prepend=0.0)).cumsum(), line)
    rows = (along >= START) & (along <= LATEST)
    change = LaneChange(
        lanes=tuple((f"ego_{lane}",) * int(rows.sum()) for lane in range(lanes + 1)),
        widths=(WIDTH,) * (lanes + 1),
        start_station=START,
        latest_station=LATEST,
        stations=along[rows],
        offsets=np.stack([lane * WIDTH - over[rows] for lane in range(lanes + 1)]),
    )
    edges = {
        "lane_left": np.where(along > START + 50.0 * lanes, 0.5 * WIDTH, (lanes + 0.5) * WIDTH - over),
        "lane_right": np.where(along > START + 50.0 * lanes, -0.5 * WIDTH, -0.5 * WIDTH - over),
        "road_left": (lanes + 0.5) * WIDTH - over,
        "road_right": -0.5 * WIDTH - over,
    }
    return msgspec.structs.replace(found, lane_changes=(change,), **edges)


def beside(route: Route, config: PlanningConfig) -> Gaps:
    return Gaps(route.line, stop_station(route, config), SHAPE, config)


def lane_at(driven: Drive, x: float) -> float:
    """Where the ego is sideways at x, in lanes."""
    return float(np.interp(x, driven.states[:, 1], driven.states[:, 2])) / WIDTH


def fronts_on(driven: Drive, lane: int) -> Floats:
    """Where the front bumper is while the ego's middle is on that lane [m]."""
    fronts: Floats = driven.fronts[np.rint(driven.states[:, 2] / WIDTH) == lane]
    return fronts


def test_into_a_free_lane_it_goes_along_the_line_as_if_there_were_but_one() -> None:
    driven = drive(crossing_over(), 30.0, speed=13.0)
    alone = drive(msgspec.structs.replace(crossing_over(), lane_changes=()), 30.0, speed=13.0)
    assert np.array_equal(driven.states, alone.states)


@pytest.mark.parametrize("ahead", [-8.0, -3.0, 0.0, 3.0, 8.0])
def test_beside_one_as_fast_it_falls_back_and_changes_behind(ahead: float) -> None:
    driven = drive(crossing_over(), 40.0, speed=13.0, actors=[car(7, 7.0 + ahead, WIDTH, speed=13.0)])
    assert driven.clearances.min() > 1.0
    assert driven.speeds.min() > 8.0
    assert lane_at(driven, LATEST) == pytest.approx(1.0, abs=0.1)
    assert_drivable(driven)


def test_one_that_comes_up_fast_from_behind_goes_first() -> None:
    driven = drive(crossing_over(), 40.0, speed=10.0, actors=[car(7, -60.0, WIDTH, speed=20.0)])
    is_ahead = driven.states[:, 1] > -60.0 + 20.0 * driven.states[:, 0]
    assert np.abs(driven.states[is_ahead, 2]).max() < 0.3
    assert lane_at(driven, LATEST) == pytest.approx(1.0, abs=0.1)


def test_beside_a_queue_without_a_gap_it_waits_at_the_end_of_its_lane() -> None:
    queue = [car(number, 60.0 + 6.5 * number, WIDTH) for number in range(60)]
    driven = drive(crossing_over(), 70.0, speed=13.0, actors=queue)
    assert driven.speeds[-1] == 0.0
    assert 0.0 < LATEST - driven.fronts[-1] < 30.0
    assert abs(driven.states[-1, 2]) < 0.2
    assert driven.decisions[-1] == "wait to change lanes"
    assert_drivable(driven)


def test_behind_the_tail_of_a_queue_it_changes_and_stops() -> None:
    queue = [car(number, 200.0 + 6.5 * number, WIDTH, speed=10.0, stays_from=5.0) for number in range(40)]
    route = msgspec.structs.replace(crossing_over(), stop_lines=(stop_line(LATEST, Control.PRIORITY),))
    driven = drive(route, 60.0, speed=13.0, actors=queue)
    assert driven.speeds[-1] == 0.0
    assert driven.states[-1, 2] == pytest.approx(WIDTH, abs=0.2)
    assert driven.clearances.min() > 1.0


def test_when_the_queue_drives_off_it_changes_from_standstill() -> None:
    queue = [car(number, 60.0 + 6.5 * number, WIDTH, speed=8.0, leaves=60.0) for number in range(55)]
    driven = drive(crossing_over(), 130.0, speed=13.0, actors=queue)
    assert driven.clearances.min() > 0.8
    assert lane_at(driven, LATEST) == pytest.approx(1.0, abs=0.1)
    assert_drivable(driven)


def test_where_it_has_to_change_it_does_though_that_is_on_a_junction() -> None:
    queue = [car(100 + row, 420.0 - 7.0 * row, WIDTH, speed=4.0, leaves=40.0) for row in range(60)]
    route = crossing_over()
    (change,) = route.lane_changes
    on_junction = msgspec.structs.replace(change, junctions=((LATEST - 25.0, LATEST - 5.0),))
    driven = drive(msgspec.structs.replace(route, lane_changes=(on_junction,)), 190.0, speed=10.0, actors=queue)
    assert "wait to change lanes" in driven.decisions
    assert lane_at(driven, LATEST + 50.0) == pytest.approx(1.0, abs=0.1)
    assert driven.fronts[-1] > LATEST + 100.0
    assert driven.clearances.min() > 0.5


def test_over_two_lanes_it_waits_on_the_middle_one() -> None:
    driven = drive(crossing_over(2), 45.0, speed=13.0, actors=[car(7, 7.0, 2.0 * WIDTH, speed=12.0)])
    assert len(fronts_on(driven, 1)) > 20
    assert driven.clearances.min() > 1.0
    assert lane_at(driven, LATEST) == pytest.approx(2.0, abs=0.1)
    assert_drivable(driven)


def test_before_the_lanes_run_side_by_side_it_is_on_none_of_them_but_its_own() -> None:
    """Though it is decided already that it waits on the middle one."""
    driven = drive(crossing_over(2), 12.0, speed=8.0, actors=[car(7, 7.0, 2.0 * WIDTH, speed=8.0)])
    states = driven.states[driven.states[:, 1] < START]
    assert states[-1, 1] > START - 2.0
    assert np.abs(states[:, 2]).max() < 0.1


def test_where_a_turn_leads_past_the_first_lane_it_is_not_beside_the_line_before() -> None:
    """The line swings over to the lane on the left where the two begin, back to the first one, and changes then."""
    route, beside = crossing_over(), car(7, 7.0, WIDTH, speed=8.0)
    change = route.lane_changes[0]
    swings = np.interp(change.stations, [START, START + 12.0], [-2.8, 0.0])
    swung = msgspec.structs.replace(change, offsets=change.offsets + swings)
    driven = drive(msgspec.structs.replace(route, lane_changes=(swung,)), 12.0, speed=8.0, actors=[beside])
    states = driven.states[driven.states[:, 1] < START]
    assert states[-1, 1] > START - 2.0
    assert np.abs(states[:, 2]).max() < 0.1


def test_who_keeps_to_the_lane_beyond_the_next_one_is_not_on_it_where_the_line_moves_over() -> None:
    route = crossing_over()
    gaps = beside(route, PlanningConfig())
    others = predicted([car(7, 125.0, 2.0 * WIDTH, speed=20.0), car(8, 125.0, WIDTH, speed=20.0)], 0.0).objects
    on_own, on_next = gaps.occupied(route.lane_changes[0], 95.0, others)
    assert on_own.tracks == []
    assert on_next.tracks == [8]


def test_one_that_pulls_into_the_gap_in_time_is_let_in() -> None:
    """A gap that closes while the ego is still in its lane is given up."""
    start = START - SHAPE.front
    merging = car(7, start - 20.0, WIDTH, speed=16.0)
    driven = drive(crossing_over(), 40.0, speed=13.0, station=start - 20.0, actors=[merging])
    assert driven.clearances.min() > 1.0
    assert lane_at(driven, LATEST) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("behind", [8.0, 12.0, 16.0])
def test_a_change_hardly_begun_is_broken_off_for_who_comes_faster_from_the_other_side_of_the_next_lane(
    behind: float,
) -> None:
    """Each found the lane free when it began, and was no neighbour of it before."""
    planner = Planner(PlanningConfig(), crossing_over(), SHAPE)
    estimate, gaps = believed(95.0, speed=15.0), []
    x, y, slant = 0.0, 2.0 * WIDTH, 0.0
    for index in range(50):
        time = 0.1 * index
        if estimate.y < 0.4 and slant == 0.0:
            x = estimate.x + SHAPE.centre - behind
        else:
            slant = 0.06 if y > WIDTH else 0.0
        x, y = x + 2.4 * math.cos(slant), y - 2.4 * math.sin(slant)
        other = car(7, x - 24.0 * time * math.cos(slant), y + 24.0 * time * math.sin(slant), heading=-slant, speed=24.0)
        points = planner.step(estimate, predicted([other], time), {}).points
        ego = box_of(estimate.x, estimate.y, estimate.heading, SHAPE)
        gaps.append(float(distances(ego, np.array([other.box_at(time)]))[0]))
        _, ego_x, ego_y, heading, speed, acceleration, curvature = points[1].tolist()
        estimate = LocalizationEstimate(time + 0.1, ego_x, ego_y, heading, speed, acceleration, speed * curvature)
    assert min(gaps) > 1.5


@pytest.mark.parametrize("ahead", [-2.0, 0.0, 2.0])
def test_a_change_is_broken_off_where_somebody_comes_abreast_in_the_next_lane(ahead: float) -> None:
    """Two who change to one lane from both sides; the other was no neighbour of that lane before."""
    planner = Planner(PlanningConfig(), crossing_over(), SHAPE)
    estimate, gaps, other = believed(95.0, speed=8.0), [], None
    for index in range(80):
        time = 0.1 * index
        if other is None and estimate.y > 1.0:  # a part of the body is over the marking
            other = car(7, estimate.x + 1.4 + ahead - 8.0 * time, estimate.y + 3.0, speed=8.0)
        actors = [] if other is None else [other]
        points = planner.step(estimate, predicted(actors, time), {}).points
        if other is not None:
            ego = box_of(estimate.x, estimate.y, estimate.heading, SHAPE)
            gaps.append(float(distances(ego, np.array([other.box_at(time)]))[0]))
        _, x, y, heading, speed, acceleration, curvature = points[1].tolist()
        estimate = LocalizationEstimate(0.1 * (index + 1), x, y, heading, speed, acceleration, speed * curvature)
    assert min(gaps) > 0.3


@pytest.mark.parametrize("behind", [60.0, 90.0])
def test_at_the_end_of_its_lane_a_change_is_not_given_up_where_it_would_stop_turned(behind: float) -> None:
    """Who comes fast is seen when the front is over the marking; it could not begin again so near to the end."""
    planner = Planner(PlanningConfig(), crossing_over(), SHAPE)
    estimate, other, headings = believed(LATEST - 12.0 - SHAPE.front), None, []
    for index in range(60):
        time = 0.1 * index
        if other is None and estimate.y + SHAPE.front * math.sin(estimate.heading) > 0.5 * WIDTH:
            other = car(7, estimate.x - behind - 25.0 * time, WIDTH, speed=25.0)
        points = planner.step(estimate, predicted([other] if other else [], time), {}).points
        _, x, y, heading, speed, acceleration, curvature = points[1].tolist()
        estimate = LocalizationEstimate(0.1 * (index + 1), x, y, heading, speed, acceleration, speed * curvature)
        headings.append(heading)
        if estimate.y > 0.8 * WIDTH:
            break
    assert other is not None
    assert estimate.y > 0.8 * WIDTH
    assert estimate.x + SHAPE.front < LATEST + SHAPE.length
    assert min(headings) > -0.1


@pytest.mark.parametrize("speed", [3.0, 4.0])
@pytest.mark.parametrize("station", [110.0, 116.0])
def test_while_it_waits_it_does_not_go_around_a_standing_car_on_the_lane_it_waits_for(
    station: float, speed: float
) -> None:
    beside = car(7, station - 2.6, WIDTH, speed=speed, leaves=1.0)
    behind = car(8, station - 10.6, WIDTH, speed=speed, leaves=2.0)
    driven = drive(crossing_over(), 12.0, station=station, actors=[car(99, station + 12.0), beside, behind])
    assert driven.clearances.min() > 0.5


@pytest.mark.parametrize("overlap", [-1.0, 0.5])
def test_it_goes_in_front_of_one_that_stays_beside_its_rear_when_the_queue_drives_off(overlap: float) -> None:
    """In a queue, those who let somebody in leave no more than that."""
    packed = [car(number, 60.0 + 6.5 * number, WIDTH) for number in range(60)]
    rear = drive(crossing_over(), 40.0, speed=13.0, actors=packed).fronts[-1] - SHAPE.length
    half = 0.5 * car(0, 0.0).size[0]
    behind = [car(number, rear + overlap - half - 6.5 * number, WIDTH) for number in range(40)]
    ahead = [car(40 + row, rear + overlap + 1.5 + half + 6.5 * row, WIDTH, speed=6.0, leaves=45.0) for row in range(5)]
    driven = drive(crossing_over(), 70.0, speed=13.0, actors=[*behind, *ahead])
    assert driven.clearances.min() > 0.3
    assert lane_at(driven, LATEST) == pytest.approx(1.0, abs=0.1)
    assert_drivable(driven)


def test_shortly_before_the_end_of_its_lane_it_takes_a_gap_that_leaves_no_headway() -> None:
    """Between cars 16 m apart, as they drive off from a queue: it stays beside one such gap until then."""
    cars = [car(10 + number, -200.0 + 16.0 * number, WIDTH, speed=9.0) for number in range(60)]
    driven = drive(crossing_over(), 39.0, speed=9.0, actors=cars)
    assert driven.speeds.min() > 7.0
    assert driven.clearances.min() > 1.0
    assert lane_at(driven, 330.0) == pytest.approx(0.0, abs=0.1)
    assert driven.states[-1, 2] > 0.3 * WIDTH


@pytest.mark.parametrize(
    ("fronts", "is_free"),
    [
        ([-7.0, -23.0], False),  # who follows close behind the second one is hidden by it
        ([-7.0, -23.0, -110.0], True),  # nobody does: the next one is seen
        ([16.0, 7.0], True),  # they have passed, and hide nobody any more
    ],
)
def test_from_standstill_it_does_not_begin_while_somebody_passes_who_hides_those_behind(
    fronts: list[float],
    is_free: bool,  # noqa: FBT001
) -> None:
    route, config = crossing_over(), PlanningConfig()
    window = Reference(route, SHAPE, config).window(390.0, 100.0)
    places, count = np.array(fronts), len(fronts)
    lane = Neighbours(places - 4.5, places, np.full(count, 20.0), np.ones(count, dtype=np.bool_), list(range(count)))
    gaps = beside(route, config)
    assert gaps.is_free(lane, route.lane_changes[0], window, 0.0, Urgency.PRESSED) is is_free


@pytest.mark.parametrize(
    ("pace", "is_free"),
    [
        (13.0, False),  # the headway would be missing for good
        (22.0, True),  # it gets away while the ego changes lanes
    ],
)
def test_close_behind_who_gets_away_it_goes_to_the_next_lane(
    pace: float,
    is_free: bool,  # noqa: FBT001
) -> None:
    route, config = crossing_over(), PlanningConfig()
    window = Reference(route, SHAPE, config).window(150.0, 100.0)
    nose = np.array([SHAPE.front + 3.5])
    lane = Neighbours(nose, nose + 4.5, np.array([pace]), np.ones(1, dtype=np.bool_), [1])
    gaps = beside(route, config)
    assert gaps.is_free(lane, route.lane_changes[0], window, 13.0, Urgency.WANTED) is is_free


@pytest.mark.parametrize(
    ("station", "front", "is_free"),
    [
        (150.0, -12.0, False),  # before it brakes it is at the ego's rear
        (150.0, -19.0, True),
        (565.0, -36.0, False),  # it has to stop as the ego does, at its destination
        (565.0, -48.0, True),
    ],
)
def test_who_closes_in_from_behind_has_room_to_see_and_to_brake_also_when_the_ego_hurries(
    station: float,
    front: float,
    is_free: bool,  # noqa: FBT001
) -> None:
    route, config = crossing_over(), PlanningConfig()
    window = Reference(route, SHAPE, config).window(station, 100.0)
    speed = 9.0 if station > 500.0 else 18.0
    fronts, speeds = np.array([front]), np.array([speed + 6.0])
    lane = Neighbours(fronts - 4.5, fronts, speeds, np.ones(1, dtype=np.bool_), [1])
    gaps = beside(route, config)
    change = msgspec.structs.replace(route.lane_changes[0], latest_station=590.0)
    assert gaps.is_free(lane, change, window, speed, Urgency.HURRIED) is is_free


@pytest.mark.parametrize("ahead", [-124.0, -121.0, -118.0, 118.0, 121.0, 124.0])
def test_who_is_far_away_is_on_no_lane_beside_their_own(ahead: float) -> None:
    route, config = crossing_over(lanes=2), PlanningConfig()
    change = msgspec.structs.replace(route.lane_changes[0], latest_station=590.0)
    gaps = beside(route, config)
    for here in np.arange(150.0, 160.0, 0.1).tolist():
        x, y, _ = route.line.poses([here + ahead])[0]
        lanes = gaps.occupied(change, here, predicted([car(7, x, y)], 0.0).objects)
        found = [lane for lane, occupied in enumerate(lanes) if occupied.tracks]
        assert found == ([] if abs(ahead) > 120.0 else [0 if ahead < 0.0 else 2])


@pytest.mark.parametrize("behind", [5.0, 26.0, 46.0])
def test_who_comes_from_behind_the_beginning_of_the_line_is_on_the_lane_that_it_is_on(behind: float) -> None:
    route, here = crossing_over(), 16.0
    others = [car(7, here - behind, WIDTH, speed=25.0), car(8, here - behind, 0.1, speed=25.0)]
    change = msgspec.structs.replace(route.lane_changes[0], start_station=START)
    own, following = beside(route, PlanningConfig()).occupied(change, here, predicted(others, 0.0).objects)
    assert (own.tracks, following.tracks) == ([8], [7])
    assert following.fronts[0] == pytest.approx(2.25 - behind)
