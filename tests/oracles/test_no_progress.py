import pytest
from oracle_scenes import Row, car, drive, judged, moment, stop_line, straight_road

from dvca_sumo.messages import SignalColour
from dvca_sumo.oracles.no_progress import NoProgress
from dvca_sumo.roadmap import Control
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Answer, Ending

SIGNAL = straight_road(stop_lines=(stop_line(100.0, Control.SIGNAL, "tls/3"),))
JUNCTION = straight_road(stop_lines=(stop_line(100.0, Control.YIELD),))


def waiting(
    seconds: float, station: float = 90.0, objects: tuple[Row, ...] = (), **signals: SignalColour
) -> list[Moment]:
    shown = {name.replace("_", "/"): colour for name, colour in signals.items()}
    return [moment(0.5 * k, station, 0.0, objects=objects, signals=shown) for k in range(round(seconds * 2.0) + 1)]


def test_standing_without_a_reason_is_a_violation() -> None:
    (violation,) = judged(NoProgress, waiting(70.0)).violations
    assert (violation.kind, violation.category) == ("no_progress", "mission")
    assert violation.time == pytest.approx(30.0)


def test_creeping_is_no_progress_and_a_metre_in_time_is() -> None:
    assert judged(NoProgress, drive(50.0, 51.8, 0.03, dt=0.5)).answer is Answer.VIOLATED
    assert judged(NoProgress, drive(50.0, 53.0, 0.035, dt=0.5)).answer is Answer.KEPT


def test_standing_just_not_long_enough_is_fine() -> None:
    assert judged(NoProgress, waiting(29.5)).answer is Answer.KEPT


def test_waiting_at_red_is_a_reason_and_at_green_is_none() -> None:
    assert judged(NoProgress, waiting(60.0, tls_3=SignalColour.RED), SIGNAL).answer is Answer.KEPT
    assert judged(NoProgress, waiting(60.0, tls_3=SignalColour.GREEN), SIGNAL).answer is Answer.VIOLATED
    far = waiting(60.0, station=50.0, tls_3=SignalColour.RED)
    assert judged(NoProgress, far, SIGNAL).answer is Answer.VIOLATED


def test_an_object_in_the_way_is_a_reason_and_one_beside_it_is_none() -> None:
    assert judged(NoProgress, waiting(60.0, objects=(car("lead", 95.0),))).answer is Answer.KEPT
    assert judged(NoProgress, waiting(60.0, objects=(car("parked", 95.0, y=3.0),))).answer is Answer.VIOLATED
    assert judged(NoProgress, waiting(60.0, objects=(car("far", 106.0),))).answer is Answer.VIOLATED


@pytest.mark.parametrize("heading", [1.8, -1.8])
def test_one_that_stands_across_the_way_is_a_reason_though_a_corner_of_it_is_beside_the_ego(heading: float) -> None:
    across: Row = ("across", (91.35, 1.4 if heading > 0.0 else -1.4, heading, 5.0, 1.8), (0.0, 0.0))
    assert judged(NoProgress, waiting(60.0, objects=(across,))).answer is Answer.KEPT


def test_traffic_at_the_junction_ahead_is_a_reason() -> None:
    crossing: Row = ("cross", (110.0, 20.0, 1.57, 4.6, 1.8), (0.0, -8.0))
    parked: Row = ("cross", (110.0, 20.0, 1.57, 4.6, 1.8), (0.0, 0.0))
    assert judged(NoProgress, waiting(60.0, objects=(crossing,)), JUNCTION).answer is Answer.KEPT
    assert judged(NoProgress, waiting(60.0, objects=(parked,)), JUNCTION).answer is Answer.VIOLATED
    assert judged(NoProgress, waiting(60.0, objects=(crossing,))).answer is Answer.VIOLATED


def test_standing_at_the_destination_is_fine() -> None:
    assert judged(NoProgress, waiting(60.0, station=249.0)).answer is Answer.KEPT


def test_the_time_counts_from_the_last_reason_on() -> None:
    gone = [moment(20.0 + 0.5 * k, 90.0, 0.0) for k in range(1, 62)]
    (violation,) = judged(NoProgress, waiting(20.0, objects=(car("lead", 95.0),)) + gone).violations
    assert violation.time == pytest.approx(50.0)


def test_it_cannot_tell_of_a_run_cut_before_the_time() -> None:
    assert judged(NoProgress, waiting(20.0), ended=Ending.CUT).answer is Answer.UNKNOWN
    assert judged(NoProgress, drive(20.0, 40.0, 1.0), ended=Ending.CUT).answer is Answer.UNKNOWN


def test_it_cannot_tell_when_the_signal_ahead_is_unknown() -> None:
    found = judged(NoProgress, waiting(60.0), SIGNAL)
    assert found.answer is Answer.UNKNOWN
    assert "signal" in found.reason
