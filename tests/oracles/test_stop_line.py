import pytest
from oracle_scenes import car, drive, judged, moment, stop_line, straight_road

from dvca_sumo.messages import SignalColour
from dvca_sumo.oracles.stop_line import StopAtLine
from dvca_sumo.roadmap import Control
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Answer

SIGN = straight_road(stop_lines=(stop_line(100.0, Control.STOP),))
SIGNAL = straight_road(stop_lines=(stop_line(100.0, Control.SIGNAL, "tls/3"),))
RED, YELLOW, GREEN = SignalColour.RED, SignalColour.YELLOW, SignalColour.GREEN


def slowing(where: float, slowest: float) -> list[Moment]:
    """A run past the line that is slowest at station `where`."""
    stations = [80.0 + 0.25 * k for k in range(120)]
    return [
        moment(0.1 * k, station, max(slowest, min(8.0, abs(station - where))), objects=())
        for k, station in enumerate(stations)
    ]


@pytest.mark.parametrize("control", [Control.STOP, Control.ALL_WAY_STOP])
def test_rolling_through_a_stop_sign_is_a_violation(control: Control) -> None:
    route = straight_road(stop_lines=(stop_line(100.0, control),))
    (violation,) = judged(StopAtLine, slowing(99.0, 0.3), route).violations
    assert violation.kind == "stop_line"
    assert violation.value == 0.3
    assert violation.threshold == 0.3


def test_a_stop_just_before_the_line_is_fine() -> None:
    assert judged(StopAtLine, slowing(99.0, 0.29), SIGN).answer is Answer.KEPT


@pytest.mark.parametrize(
    ("where", "expected"),
    [(97.0, Answer.KEPT), (96.5, Answer.VIOLATED), (100.5, Answer.KEPT), (101.0, Answer.VIOLATED)],
)
def test_a_stop_counts_from_the_zone_to_the_tolerance(where: float, expected: Answer) -> None:
    assert judged(StopAtLine, slowing(where, 0.0), SIGN).answer is expected


def test_each_sign_needs_its_own_stop() -> None:
    route = straight_road(stop_lines=(stop_line(90.0, Control.STOP), stop_line(100.0, Control.STOP)))
    (violation,) = judged(StopAtLine, slowing(89.0, 0.0), route).violations
    assert violation.time == pytest.approx(8.3)


def test_yielding_needs_no_stop() -> None:
    route = straight_road(stop_lines=(stop_line(100.0, Control.YIELD), stop_line(150.0, Control.PRIORITY)))
    assert judged(StopAtLine, drive(80.0, 180.0, 10.0), route).answer is Answer.KEPT


def overshooting(rest: float, seconds: float, colour: SignalColour = YELLOW, lead: float | None = None) -> list[Moment]:
    """Passes the line on `colour`, rests at `rest` on red, goes on at green."""
    objects = [] if lead is None else [car("lead", lead)]
    approach = [moment(0.1 * k, 90.0 + k, 10.0, signals={"tls/3": colour}, objects=objects) for k in range(11)]
    count = round(seconds * 10.0) + 1
    stands = [moment(1.1 + 0.1 * k, rest, 0.0, signals={"tls/3": RED}, objects=objects) for k in range(count)]
    begin = 1.1 + 0.1 * count
    return approach + stands + [moment(begin + 0.1 * k, rest + k, 10.0, signals={"tls/3": GREEN}) for k in range(5)]


def test_resting_beyond_the_line_on_red_is_a_violation() -> None:
    (violation,) = judged(StopAtLine, overshooting(101.5, 5.0), SIGNAL).violations
    assert violation.value == pytest.approx(1.5)
    assert violation.time == pytest.approx(2.1)


def test_resting_within_the_tolerance_or_for_a_moment_is_fine() -> None:
    assert judged(StopAtLine, overshooting(100.49, 5.0), SIGNAL).answer is Answer.KEPT
    assert judged(StopAtLine, overshooting(101.5, 0.9), SIGNAL).answer is Answer.KEPT


def test_waiting_inside_the_junction_is_fine() -> None:
    assert judged(StopAtLine, overshooting(101.5, 5.0, GREEN), SIGNAL).answer is Answer.KEPT
    assert judged(StopAtLine, overshooting(106.0, 5.0), SIGNAL).answer is Answer.KEPT
    assert judged(StopAtLine, overshooting(101.5, 5.0, lead=104.0), SIGNAL).answer is Answer.KEPT


def test_it_cannot_tell_when_the_colour_is_not_recorded() -> None:
    assert judged(StopAtLine, drive(80.0, 120.0, 10.0), SIGNAL).answer is Answer.UNKNOWN


def test_it_cannot_tell_of_a_sign_passed_off_the_route() -> None:
    moments = [moment(0.1 * k, 80.0 + k, 10.0, offset=20.0) for k in range(40)]
    assert judged(StopAtLine, moments, SIGN).answer is Answer.UNKNOWN
