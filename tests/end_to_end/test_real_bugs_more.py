"""Real bugs of the reference stack: each is found where it is, and harms only where it can."""

import itertools
from functools import cache
from typing import NamedTuple

import pytest
from command_line import Result, typed

import dvca_sumo
from dvca_sumo.cli import ExitCode
from dvca_sumo.messages import Component, PredictedObjects, Trajectory
from dvca_sumo.record import Record
from dvca_sumo.stack.bugs import BUGS
from dvca_sumo.stack.planning import Planner, PlanningConfig


class Row(NamedTuple):
    bug: str
    violation: str  # of the buggy build in the scenario made for it
    harmless: str  # a scenario in which the build has nothing to go wrong with

    @property
    def scenario(self) -> str:
        return f"nets/bug-{self.bug}.sumocfg"


ROWS = (
    Row("apollo-3634", "collision", "cs3"),
    Row("planfuzz-v1", "no_progress", "cs3"),
    Row("planfuzz-v7", "no_progress", "cs2"),
    Row("apollo-c803010", "destination_overrun", "bug-apollo-c803010-harmless"),
)


@cache
def _analysed(row: Row) -> tuple[int, Result]:
    said = typed("run", row.scenario, "--bug", row.bug, "--json")
    return said.code, said.result


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.bug)
def test_a_real_bug_violates_and_its_component_is_found(row: Row) -> None:
    code, result = _analysed(row)
    assert code == ExitCode.ATTRIBUTED
    assert result["violation"]["kind"] == row.violation
    assert result["component"] == BUGS[row.bug].component.value


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.bug)
def test_the_fixed_build_is_safe_and_arrives(row: Row) -> None:
    said = typed("run", row.scenario, "--json")
    assert said.code == ExitCode.NO_VIOLATION, said
    assert {one["answer"] for one in said.result["judgements"]} == {"kept"}


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.bug)
def test_the_buggy_build_is_safe_and_arrives_elsewhere(row: Row) -> None:
    said = typed("run", f"nets/{row.harmless}.sumocfg", "--bug", row.bug, "--json")
    assert said.code == ExitCode.NO_VIOLATION, said
    assert {one["answer"] for one in said.result["judgements"]} == {"kept"}


def test_the_message_named_for_swapped_boxes_holds_one() -> None:
    _, result = _analysed(ROWS[0])
    assert result["message"]["component"] == "perception"
    assert "stalled_car is 1.8 x 4.7 m; truth: 4.7 x 1.8 m" in result["differences"][0]["text"]


@pytest.mark.parametrize("row", ROWS[1:3], ids=lambda row: row.bug)
def test_a_fixed_planner_would_not_have_put_out_the_message_named(row: Row) -> None:
    _, result = _analysed(row)
    index = result["message"]["index"]
    driven = dvca_sumo.drive(dvca_sumo.load_scenario(row.scenario), bug=row.bug, engine="replay")
    driven.engine.close()
    told = driven.record.executions[Component.PLANNING][index].message
    assert isinstance(told, Trajectory)
    assert _planned(driven.record, index).decision != told.decision


def _planned(record: Record, index: int) -> Trajectory:
    """What a fixed planner puts out at `index`, given all that the recorded one was given."""
    planner = Planner(PlanningConfig(), record.route, record.moments[0].shape)
    executions = zip(record.executions[Component.PLANNING], record.executions[Component.PREDICTION], strict=True)
    plans = []
    for planning, prediction in itertools.islice(executions, index + 1):
        predicted = prediction.message
        assert isinstance(predicted, PredictedObjects)
        plans.append(planner.step(record.believed_at(planning.tick), predicted, predicted.objects.signals))
    return plans[-1]
