import pytest
from oracle_scenes import drive, judged, moment, straight_road

from dvca_sumo.oracles.destination import Destination
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Answer, Ending


def stopping_at(station: float, speed: float = 0.0) -> list[Moment]:
    approach = drive(200.0, station, 5.0)
    return [*approach, moment(approach[-1].time + 0.1, station, speed)]


@pytest.mark.parametrize("station", [247.1, 250.0, 252.9])
def test_standing_at_the_destination_is_arriving(station: float) -> None:
    assert judged(Destination, stopping_at(station), ended=Ending.ARRIVED).answer is Answer.KEPT


def test_standing_short_of_the_destination_is_not_arriving() -> None:
    (violation,) = judged(Destination, stopping_at(246.9)).violations
    assert (violation.kind, violation.category) == ("destination_not_reached", "mission")
    assert violation.value == pytest.approx(3.1)


def test_rolling_at_the_destination_is_not_arriving() -> None:
    assert judged(Destination, stopping_at(250.0, speed=0.2)).answer is Answer.VIOLATED


def test_passing_the_destination_without_a_stop_is_an_overrun() -> None:
    (violation,) = judged(Destination, drive(240.0, 260.0, 5.0), ended=Ending.CUT).violations
    assert violation.kind == "destination_overrun"
    assert violation.time == pytest.approx(2.7, abs=0.11)


@pytest.mark.parametrize("station", [254.0, 262.0, 270.0])
def test_past_the_end_of_the_road_the_way_beyond_counts(station: float) -> None:
    """The destination is where a road ends that leads nowhere, unless a trip says otherwise."""
    found = judged(Destination, stopping_at(station), straight_road(length=250.0))
    assert "destination_overrun" in {violation.kind for violation in found.violations}


@pytest.mark.parametrize("station", [250.0, 252.9])
def test_no_farther_past_the_end_of_the_road_than_elsewhere_is_there(station: float) -> None:
    road = straight_road(length=250.0)
    assert judged(Destination, stopping_at(station), road, ended=Ending.ARRIVED).answer is Answer.KEPT


def test_what_comes_after_the_arrival_is_not_judged() -> None:
    assert judged(Destination, stopping_at(250.0) + drive(250.0, 270.0, 5.0)).answer is Answer.KEPT


def test_it_cannot_tell_of_a_run_cut_on_the_way() -> None:
    found = judged(Destination, drive(100.0, 200.0, 10.0), ended=Ending.CUT)
    assert found.answer is Answer.UNKNOWN
    assert "cut" in found.reason
