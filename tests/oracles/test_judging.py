import pickle
from typing import cast

import pytest
from oracle_scenes import BareMap, car, drive, stop_line, straight_road

from dvca_sumo.messages import SignalColour
from dvca_sumo.oracles import ORACLES, Places, judge, judges
from dvca_sumo.roadmap import Control, RoadMap
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Answer, Ending

ROUTE = straight_road(stop_lines=(stop_line(60.0, Control.SIGNAL, "tls/3"), stop_line(120.0, Control.STOP)))
ROADMAP = cast("RoadMap", BareMap())


def reckless() -> list[Moment]:
    return drive(20.0, 200.0, 16.0, signals={"tls/3": SignalColour.RED}, objects=[car("lead", 150.0)])


def test_one_run_is_judged_by_every_oracle() -> None:
    found = judge(reckless(), judges(Places(ROUTE, ROADMAP), Thresholds()), Ending.CUT)
    assert [judgement.kind for judgement in found] == [
        "collision",
        "ttc",
        "speed_limit",
        "lane_departure",
        "red_light",
        "stop_line",
        "destination",
        "no_progress",
    ]
    answers = {judgement.kind: judgement.answer for judgement in found}
    violated = {kind for kind, answer in answers.items() if answer is Answer.VIOLATED}
    assert violated == {"collision", "ttc", "speed_limit", "red_light", "stop_line"}
    assert answers["lane_departure"] is Answer.KEPT
    assert answers["destination"] is answers["no_progress"] is Answer.UNKNOWN


@pytest.mark.parametrize("moments", [reckless(), reckless()[:2], []], ids=["violating", "short", "none"])
def test_only_the_oracles_of_missions_need_the_end_of_a_drive(moments: list[Moment]) -> None:
    found = judge(moments, judges(Places(ROUTE, ROADMAP), Thresholds()), Ending.CUT)
    assert [judgement.kind for judgement in found if judgement.needs_end] == ["destination", "no_progress"]


def test_every_violation_is_returned_once_and_kept_in_the_judgement() -> None:
    oracles = judges(Places(ROUTE, ROADMAP), Thresholds())
    returned = [found for moment in reckless() for oracle in oracles if (found := oracle.observe(moment)) is not None]
    concluded = [found for oracle in oracles for found in oracle.conclude(Ending.CUT).violations]
    assert sorted(returned, key=str) == sorted(concluded, key=str)


def test_a_copy_made_in_mid_run_goes_on_to_the_same_answers() -> None:
    oracles = judges(Places(ROUTE, ROADMAP), Thresholds())
    moments = reckless()
    judge(moments[:50], oracles, Ending.CUT)
    copies = pickle.loads(pickle.dumps(oracles))  # noqa: S301
    assert judge(moments[50:], copies, Ending.CUT) == judge(moments[50:], oracles, Ending.CUT)


def test_each_oracle_is_listed_once() -> None:
    assert len({oracle.__module__ for oracle in ORACLES}) == len(ORACLES) == 8
