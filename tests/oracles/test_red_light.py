import pytest
from oracle_scenes import drive, judged, moment, stop_line, straight_road

from dvca_sumo.messages import SignalColour
from dvca_sumo.oracles.red_light import RedLight
from dvca_sumo.roadmap import Control
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Answer

ROUTE = straight_road(stop_lines=(stop_line(100.0, Control.SIGNAL, "tls/3"),))
RED, YELLOW, GREEN = SignalColour.RED, SignalColour.YELLOW, SignalColour.GREEN


def passing(before: SignalColour, after: SignalColour, change: float) -> list[Moment]:
    """Past the line at 10 m/s; the colour changes when the front bumper is at `change`."""
    return [
        moment(0.1 * k, 90.5 + k, 10.0, signals={"tls/3": before if 90.5 + k < change else after}) for k in range(20)
    ]


def test_passing_the_line_on_red_is_a_violation() -> None:
    (violation,) = judged(RedLight, passing(YELLOW, RED, 97.0), ROUTE).violations
    assert violation.kind == "red_light"
    assert violation.time == pytest.approx(1.2)
    assert "tls/3" in violation.detail


def test_passing_the_line_on_yellow_is_fine() -> None:
    assert judged(RedLight, passing(GREEN, YELLOW, 97.0), ROUTE).answer is Answer.KEPT


def test_a_signal_that_turns_red_in_the_step_of_passing_is_fine() -> None:
    assert judged(RedLight, passing(YELLOW, RED, 100.5), ROUTE).answer is Answer.KEPT
    assert judged(RedLight, passing(YELLOW, RED, 99.5), ROUTE).answer is Answer.VIOLATED


def test_stopping_with_the_bumper_just_beyond_the_line_is_not_running_it() -> None:
    waits = [moment(0.1 * k, min(95.0 + 0.3 * k, 101.9), 3.0, signals={"tls/3": RED}) for k in range(60)]
    goes = [moment(6.0 + 0.1 * k, 101.9 + k, 10.0, signals={"tls/3": GREEN}) for k in range(10)]
    assert judged(RedLight, waits + goes, ROUTE).answer is Answer.KEPT
    creeps = [moment(6.0 + 0.1 * k, 101.9 + k, 10.0, signals={"tls/3": RED}) for k in range(10)]
    assert judged(RedLight, waits + creeps, ROUTE).answer is Answer.VIOLATED


def test_lines_behind_the_start_and_signs_do_not_count() -> None:
    route = straight_road(stop_lines=(stop_line(5.0, Control.SIGNAL, "tls/3"), stop_line(100.0, Control.STOP)))
    assert judged(RedLight, drive(20.0, 120.0, 10.0, signals={"tls/3": RED}), route).answer is Answer.KEPT


def test_it_cannot_tell_when_the_colour_is_not_recorded() -> None:
    found = judged(RedLight, drive(80.0, 120.0, 10.0, signals={"tls/4": RED}), ROUTE)
    assert found.answer is Answer.UNKNOWN
    assert "tls/3" in found.reason


def test_it_can_tell_when_the_line_was_never_reached() -> None:
    assert judged(RedLight, drive(80.0, 99.0, 10.0), ROUTE).answer is Answer.KEPT


def test_it_cannot_tell_of_lines_passed_off_the_route() -> None:
    moments = [moment(0.1 * k, 80.0 + k, 10.0, offset=20.0, signals={"tls/3": RED}) for k in range(40)]
    assert judged(RedLight, moments, ROUTE).answer is Answer.UNKNOWN
