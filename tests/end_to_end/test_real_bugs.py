"""Real bugs of the reference stack: each is found where it is, and harms only where it can."""

from typing import NamedTuple

import pytest
from command_line import typed

import dvca_sumo
from dvca_sumo.analysis.attribution import Attribution
from dvca_sumo.bench.cases import Case, real_bug_cases
from dvca_sumo.bench.ground_truth import altered_messages
from dvca_sumo.cli import ExitCode
from dvca_sumo.record import Record

# What the buggy build does in the scenario made for it.
VIOLATIONS = {
    "apollo-6826": "collision",
    "apollo-3634": "collision",
    "apollo-3257": "stop_line",
    "apollo-10706": "speed_limit",
    "planfuzz-v1": "no_progress",
    "planfuzz-v7": "no_progress",
    "apollo-c803010": "destination_overrun",
    "apollo-cc890a4": "collision",
}


class Analysed(NamedTuple):
    """A case as it was driven and explained."""

    case: Case
    record: Record
    found: Attribution


@pytest.fixture(scope="module", params=real_bug_cases(), ids=lambda case: case.name)
def analysed(request: pytest.FixtureRequest) -> Analysed:
    case: Case = request.param
    driven = dvca_sumo.drive(dvca_sumo.load_scenario(case.scenario), bug=case.bug)
    return Analysed(case, driven.record, dvca_sumo.attribute(driven))


def test_it_violates_and_its_component_is_found(analysed: Analysed) -> None:
    case, _, found = analysed
    assert found.violation is not None
    assert found.violation.kind == VIOLATIONS[case.name]
    assert found.components is not None
    assert found.components.component is case.component
    assert found.is_reproducible


def test_the_fixed_build_would_not_have_put_out_the_message_named(analysed: Analysed) -> None:
    case, record, found = analysed
    assert found.message is not None
    assert found.message.component is case.component
    assert found.message.index in altered_messages(case, dvca_sumo.load_scenario(case.scenario), record)


@pytest.mark.parametrize("case", real_bug_cases(), ids=lambda case: case.name)
def test_the_fixed_build_is_safe_and_arrives(case: Case) -> None:
    said = typed("run", case.scenario, "--json")
    assert said.code == ExitCode.NO_VIOLATION, said
    assert {one["answer"] for one in said.result["judgements"]} == {"kept"}
    assert said.result["bug"] is None


@pytest.mark.parametrize("case", real_bug_cases(), ids=lambda case: case.name)
def test_the_buggy_build_is_safe_and_arrives_elsewhere(case: Case) -> None:
    said = typed("run", case.harmless_scenario, "--bug", case.bug, "--json")
    assert said.code == ExitCode.NO_VIOLATION, said
    assert {one["answer"] for one in said.result["judgements"]} == {"kept"}
    assert said.result["bug"] == case.bug
