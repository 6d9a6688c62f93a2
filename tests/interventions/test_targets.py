import math

import numpy as np
import pytest
from msgspec.structs import replace

from dvca_sumo.geometry.polyline import Polyline
from dvca_sumo.interventions.states import state_of
from dvca_sumo.interventions.targets import ALL, IN_WAY, in_way, rows_of
from dvca_sumo.messages import ObjectClass, TrackedObjects
from interventions.scenes import Thing, ego, estimate, occasion, road, tracked, walker

LEAD = Thing("lead", 45.0, 0.0, (8.0, 0.0))


def found(*things: Thing) -> str | None:
    row = in_way(occasion(things))
    return None if row is None else things[row].name


def test_the_nearest_in_the_lane_is_in_the_way() -> None:
    assert found(Thing("far", 70.0, 0.5), LEAD, Thing("beside", 30.0, 3.5)) == "lead"


def test_a_person_who_walks_onto_the_lane_is_in_the_way_and_one_who_walks_off_is_not() -> None:
    assert found(walker("crossing", 60.0, -5.0, across=1.4)) == "crossing"
    assert found(walker("leaving", 60.0, -5.0, across=-1.4)) is None
    assert found(walker("waiting", 60.0, -5.0)) is None


def test_a_person_too_slow_to_get_there_is_not_in_the_way() -> None:
    assert found(walker("slow", 60.0, -9.0, across=1.0)) is None  # 6 m in 6 s, 7.5 m to go


def test_a_car_in_the_next_lane_is_not_in_the_way_unless_it_is_just_coming_over() -> None:
    assert found(Thing("parallel", 45.0, 3.2, (10.0, 0.0))) is None
    assert found(Thing("merging", 45.0, 3.2, (10.0, -1.5))) == "merging"


@pytest.mark.parametrize("thing", [Thing("behind", 5.0, 0.0, (10.0, 0.0)), Thing("far", 150.0, 0.0)])
def test_what_is_behind_or_far_away_is_not_in_the_way(thing: Thing) -> None:
    assert found(thing) is None


def test_a_person_beside_the_egos_flank_is_not_in_the_way() -> None:
    assert found(walker("beside", 22.0, 1.3)) is None
    assert found(walker("before", 24.0, 1.3)) == "before"


def test_what_reaches_into_the_egos_width_is_in_the_way_and_just_beside_it_is_not() -> None:
    cone = Thing("cone", 45.0, 1.0, kind=ObjectClass.STATIC, size=(0.4, 0.4))  # reach: (1.8 + 0.4) / 2 + 0.3
    assert found(cone) == "cone"
    assert found(replace(cone, y=1.39)) == "cone"
    assert found(replace(cone, y=1.41)) is None


def test_what_stands_across_the_road_is_in_the_way_by_its_length() -> None:
    barrier = Thing("barrier", 45.0, 3.0, kind=ObjectClass.STATIC, size=(5.0, 0.4), heading=math.pi / 2.0)
    assert found(barrier) == "barrier"
    assert found(replace(barrier, heading=0.0)) is None
    assert found(replace(barrier, y=3.71)) is None


def test_nothing_is_in_the_way_on_an_empty_road() -> None:
    assert found() is None


def test_the_way_ends_with_the_searched_stretch() -> None:
    car = Thing("beyond", 121.0, 0.0)
    assert in_way(occasion([car], who=ego(x=22.0))) == 0
    assert in_way(occasion([car], who=ego(x=17.0))) is None


def test_an_id_names_its_object_with_and_without_its_prefix() -> None:
    things = (LEAD, walker("person:ped", 60.0, -2.0))
    for name in ("ped", "person:ped"):
        assert rows_of(name, tracked(things), occasion(things)).tolist() == [1]
    assert rows_of("lead", tracked(things), occasion(things)).tolist() == [0]


def test_the_id_of_a_drawn_thing_names_all_its_parts() -> None:
    parts = [Thing(f"polygon:kerb#{part}", 40.0 + 20.0 * part, -3.0, kind=ObjectClass.STATIC) for part in range(3)]
    things = (LEAD, *parts)
    for name in ("kerb", "polygon:kerb"):
        assert rows_of(name, tracked(things), occasion(things)).tolist() == [1, 2, 3]
    assert rows_of("kerb#1", tracked(things), occasion(things)).tolist() == [2]


def test_all_names_every_tracked_object_also_one_that_does_not_exist() -> None:
    assert rows_of(ALL, tracked([LEAD, Thing("phantom", 5.0, 5.0)]), occasion([LEAD])).tolist() == [0, 1]


def test_the_object_in_the_way_is_found_among_the_tracked_ones() -> None:
    things = (walker("aside", 30.0, 8.0), LEAD)
    assert rows_of(IN_WAY, tracked(things), occasion(things)).tolist() == [1]


@pytest.mark.parametrize("which", ["lead", IN_WAY])
def test_an_object_that_is_not_tracked_has_no_row(which: str) -> None:
    assert rows_of(which, tracked([]), occasion([LEAD])).size == 0
    assert rows_of(which, tracked([replace(LEAD, x=49.1)]), occasion([LEAD])).size == 0  # 4.1 m off is another one
    assert rows_of(which, tracked([replace(LEAD, x=48.9)]), occasion([LEAD])).tolist() == [0]


def test_an_id_that_nobody_has_has_no_row() -> None:
    assert rows_of("ghost", tracked([LEAD]), occasion([LEAD])).size == 0
    assert rows_of(IN_WAY, tracked([LEAD]), occasion([])).size == 0


def test_the_object_is_looked_for_where_an_ego_that_is_wrong_about_itself_sees_it() -> None:
    believed = replace(estimate(), y=6.0)

    def seen(car: Thing) -> TrackedObjects:
        return tracked([car])

    shifted = replace(LEAD, y=6.0)
    assert rows_of("lead", seen(shifted), occasion([LEAD], believed=believed)).tolist() == [0]
    assert rows_of("lead", seen(LEAD), occasion([LEAD], believed=believed)).size == 0


def test_the_way_is_the_route_and_not_the_straight_ahead() -> None:
    car = Thing("ahead", 45.0, 15.0)
    offroad = occasion([car], who=ego(y=15.0), route=road())
    assert in_way(offroad) is None
    assert np.isclose(offroad.moment.objects.boxes[0, 1], offroad.moment.ego.y)


def test_on_a_loop_the_way_is_that_of_the_present_pass() -> None:
    corners = np.array(
        [[0, 0], [100, 0], [100, 40], [0, 40], [0, 0], [200, 0]], dtype=np.float64
    )  # round, then straight on
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    stations = np.arange(0.0, lengths[-1] + 0.5, 1.0)
    line = Polyline(np.column_stack([np.interp(stations, lengths, corners[:, axis]) for axis in (0, 1)]))
    beyond_the_bend = Thing("beyond", 130.0, 0.0)
    for station, row in ((60.0, None), (340.0, 0)):
        state = state_of(station, 10.0, 0.0)
        passing = occasion([beyond_the_bend], who=ego(x=60.0), route=replace(road(), line=line), state=state)
        assert in_way(passing) == row
