"""People on a crossing of two streets with pavements and a crossing over each arm."""

import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
import shapely
import sumolib

from dvca_sumo.messages import PREDICTION_TIMES, Floats, ObjectClass, PredictedObjects, TrackedObjects
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.roadmap.walkways import Ground
from dvca_sumo.stack.prediction import MapPrediction, PredictionConfig

NODES = """<nodes>
    <node id="w" x="-100" y="0"/><node id="e" x="100" y="0"/><node id="s" x="{}" y="-100"/><node id="n" x="{}" y="100"/>
    <node id="x" x="0" y="0" type="priority"/>
</nodes>"""
EDGES = "<edges>{}</edges>".format(
    "".join(
        f'<edge id="{a}{b}" from="{a}" to="{b}" speed="10"/>' for arm in "wesn" for a, b in ((arm, "x"), ("x", arm))
    )
)
SPEED = 1.4  # [m/s]


def streets(folder: Path, south: float, north: float) -> Path:
    """The net; the southern and the northern arm end so far east [m]."""
    (folder / "nodes.xml").write_text(NODES.format(south, north))
    (folder / "edges.xml").write_text(EDGES)
    command = [sumolib.checkBinary("netconvert"), "-n", "nodes.xml", "-e", "edges.xml", "-o", "net.xml"]
    command += ["--sidewalks.guess", "--crossings.guess", "--offset.disable-normalization"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)  # noqa: S603 - SUMO's own program
    return folder / "net.xml"


@pytest.fixture(scope="module")
def roadmap(tmp_path_factory: pytest.TempPathFactory) -> RoadMap:
    return RoadMap.load(streets(tmp_path_factory.mktemp("streets"), 0.0, 0.0))


def walking(roadmap: RoadMap, place: Floats, heading: float, speed: float = SPEED) -> PredictedObjects:
    tracked = TrackedObjects(
        time=0.0,
        ids=np.array([1]),
        classes=np.array([int(ObjectClass.PEDESTRIAN)]),
        boxes=np.array([[*place, heading, 0.5, 0.6]]),
        velocities=speed * np.array([[math.cos(heading), math.sin(heading)]]),
        signals={},
    )
    return MapPrediction(PredictionConfig(), roadmap).step(tracked)


def towards(begin: Floats, end: Floats) -> float:
    return math.atan2(end[1] - begin[1], end[0] - begin[0])


def pavement(roadmap: RoadMap) -> tuple[Floats, float, str]:
    """A place in the middle of the pavement south of the street from the west, and the street's direction."""
    lane = roadmap.lanes["wx_0"]
    assert lane.is_pavement
    x, y, heading = lane.line.poses([50.0])[0].tolist()
    return np.array([x, y]), heading, lane.id


def crossing(roadmap: RoadMap) -> tuple[str, Floats, Floats]:
    """The crossing over the western arm, from its southern end."""
    found = [lane for lane in roadmap.lanes.values() if lane.is_crossing]
    lane = min(found, key=lambda one: float(one.line.points[:, 0].mean()))
    begin, end = sorted((lane.line.points[0], lane.line.points[-1]), key=lambda point: float(point[1]))
    return lane.id, begin, end


def test_along_the_pavement_they_walk_straight_on(roadmap: RoadMap) -> None:
    place, heading, lane = pavement(roadmap)
    found = walking(roadmap, place, heading)
    ways = SPEED * PREDICTION_TIMES[:, None] * np.array([math.cos(heading), math.sin(heading)])
    assert found.poses[:, :, :2] == pytest.approx((place + ways)[None])
    assert found.lanes == ((lane,),)


def test_slightly_aslant_to_the_kerb_they_walk_on_along_it(roadmap: RoadMap) -> None:
    place, heading, _ = pavement(roadmap)
    found = walking(roadmap, place, heading + 0.2)
    assert found.probabilities.tolist() == [1.0]
    assert found.poses[0, :, 1].max() < place[1] + 1.0
    assert np.hypot(*(found.poses[0, -1, :2] - place)) == pytest.approx(SPEED * PREDICTION_TIMES[-1])


def test_more_aslant_to_the_kerb_they_stay_at_it(roadmap: RoadMap) -> None:
    place, heading, _ = pavement(roadmap)
    kerb = float(place[1]) + 1.0
    found = walking(roadmap, place, heading + 0.6)
    assert found.probabilities.tolist() == [1.0]
    assert kerb - 0.4 < found.poses[0, -1, 1] < kerb


def test_at_the_kerb_and_nearly_along_it_they_stay_on_the_pavement(roadmap: RoadMap) -> None:
    place, heading, _ = pavement(roadmap)
    kerb = float(place[1]) + 1.0
    found = walking(roadmap, np.array([place[0], kerb - 0.3]), heading + 0.3)
    assert found.probabilities.tolist() == [1.0]
    assert found.poses[0, :, 1].max() < kerb
    assert np.hypot(*(found.poses[0, 5, :2] - found.poses[0, 0, :2])) == pytest.approx(SPEED * PREDICTION_TIMES[5])


def test_about_to_step_off_the_pavement_they_are_taken_to_cross_the_road(roadmap: RoadMap) -> None:
    place, _, _ = pavement(roadmap)
    found = walking(roadmap, place, math.pi / 2.0)
    assert found.poses[0, -1, 1] == pytest.approx(place[1] + SPEED * PREDICTION_TIMES[-1])


def test_on_the_way_to_a_crossing_they_may_use_it_or_not(roadmap: RoadMap) -> None:
    lane, begin, end = crossing(roadmap)
    across = (end - begin) / np.hypot(*(end - begin))
    place = begin - 1.5 * across + np.array([-0.5, 0.0])
    found = walking(roadmap, place, towards(place, begin))
    uses = [row for row, lanes in enumerate(found.lanes) if lanes[-1] == lane]
    assert len(uses) == 1
    assert len(found.lanes[uses[0]]) == 2
    assert found.probabilities == pytest.approx(1.0 / len(found.owners))
    last = found.poses[uses[0], -1, :2]
    walked = np.hypot(*np.diff(found.poses[uses[0], :, :2], axis=0).T).sum()
    assert (last - begin) @ across == pytest.approx(SPEED * 6.0 - 1.5, abs=0.2)
    assert walked == pytest.approx(SPEED * 6.0, abs=0.1)
    (other,) = (row for row in range(len(found.owners)) if len(found.lanes[row]) == 1)
    assert (found.poses[other, -1, :2] - begin) @ across < 0.1


@pytest.mark.parametrize(("south", "north"), [(0.0, 0.0), (60.0, 0.0), (-80.0, 120.0), (150.0, 150.0)])
def test_the_crossings_that_begin_at_a_walking_area_are_those_that_the_net_connects_to_it(
    tmp_path: Path, south: float, north: float
) -> None:
    """However far off the area SUMO draws the ends of their middle lines, where streets meet aslant."""
    path = streets(tmp_path, south, north)
    walkways = RoadMap.load(path).walkways
    net = sumolib.net.readNet(str(path), withInternal=True)
    areas = [edge for edge in net.getEdges() if edge.getID().startswith(":x_w")]
    assert len(areas) == 4
    for area in areas:
        crossings = {edge.getID() for edge in (*area.getIncoming(), *area.getOutgoing())}
        outline = shapely.make_valid(shapely.Polygon([point[:2] for point in area.getLane(0).getShape()]))
        (ground,) = walkways.under(shapely.get_coordinates(outline.representative_point()))
        assert isinstance(ground, Ground)
        assert ground.lane == area.getLane(0).getID()
        assert {f"{edge}_0" for edge in crossings if "_c" in edge} == {way.lane for way in ground.ways}


def test_away_from_a_crossing_they_do_not_use_it(roadmap: RoadMap) -> None:
    lane, begin, end = crossing(roadmap)
    across = (end - begin) / np.hypot(*(end - begin))
    place = begin - 1.5 * across
    assert all(lanes[-1] != lane for lanes in walking(roadmap, place, towards(begin, place)).lanes)


def test_past_the_entry_of_a_crossing_they_do_not_use_it(roadmap: RoadMap) -> None:
    lane, begin, end = crossing(roadmap)
    across = (end - begin) / np.hypot(*(end - begin))
    past = towards(begin, end) - 1.3
    place = begin - 0.8 * across
    assert all(lanes[-1] != lane for lanes in walking(roadmap, place, past).lanes)


def test_on_a_crossing_they_go_straight_on(roadmap: RoadMap) -> None:
    lane, begin, end = crossing(roadmap)
    place = 0.5 * (begin + end)
    found = walking(roadmap, place, towards(begin, end))
    assert found.lanes == ((lane,),)
    assert np.hypot(*(found.poses[0, -1, :2] - place)) == pytest.approx(SPEED * 6.0)


def test_on_the_road_they_go_straight_on(roadmap: RoadMap) -> None:
    place = np.array([-50.0, -1.0])
    found = walking(roadmap, place, 0.3)
    assert found.lanes == ((),)
    assert np.hypot(*(found.poses[0, -1, :2] - place)) == pytest.approx(SPEED * 6.0)


def test_who_stands_at_a_crossing_stays_there(roadmap: RoadMap) -> None:
    _, begin, end = crossing(roadmap)
    found = walking(roadmap, begin, towards(begin, end), speed=0.1)
    assert len(found.owners) == 1
    assert np.hypot(*(found.poses[0, -1, :2] - begin)) < 1.0
