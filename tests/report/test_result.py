"""The JSON contract: every verdict's result obeys the schema that is kept with it."""

import importlib
import json
import math
from importlib import resources
from typing import Any

import pytest
from analysis.scenes import (
    CRASHED,
    FATAL,
    FAULTY,
    HIT,
    SAFE,
    SCENARIO,
    START,
    Answers,
    answering,
    attributed,
    breach,
    drive,
    faulty_drive,
    glimpse,
    unknown,
)
from msgspec.structs import replace

from dvca_sumo.analysis.attribution import LEAST_SETTLE, PAST, SETTLE, Attribution, AttributionStoppedError, Request
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.interventions import Fault, planted_fault
from dvca_sumo.messages import COMPONENTS, Component
from dvca_sumo.oracles.destination import Destination
from dvca_sumo.record import Record
from dvca_sumo.report.result import Timing, result_of
from dvca_sumo.run import Task
from dvca_sumo.scenario import Override
from dvca_sumo.stack.sources import StackSource
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.violations import Category, Contact, Violation

PERCEPTION = Component.PERCEPTION
TIMING = Timing(factual_wall_s=0.5, attribution_wall_s=2.0, engine="replay", jobs=2)
SCHEMA = json.loads(resources.files("dvca_sumo.report").joinpath("result.schema.json").read_text())
VALIDATOR = importlib.import_module("jsonschema").Draft202012Validator

# What design and README promise, never to go away.
CONTRACT = {
    "": (
        "schema scenario faults violations verdict component alternatives message interval probes messages "
        "reduction_rate planted timing reproducible digest versions"
    ),
    "scenario": "config ego seed step_length begin end overrides",
    "faults": "name component parameters",
    "violations": "kind category time object position lane value threshold",
    "message": "component index time state",
    "interval": "last_safe first_violating",
    "probes": "id ideal from outcome violation simulated_s wall_s",
    "messages": "total localization perception prediction planning control",
    "planted": "component altered component_success message_success message_distance_s",
    "timing": "factual_wall_s attribution_wall_s ratio simulated_s engine jobs",
    "versions": "dvca_sumo sumo python",
}


def told(found: Attribution, faults: tuple[Fault, ...] = ()) -> dict[str, Any]:
    """A result as a reader of the JSON gets it: strict, and of the schema."""
    text = json.dumps(result_of(Request(SCENARIO, faults), StackSource(), found, TIMING), allow_nan=False)
    result: dict[str, Any] = json.loads(text)
    VALIDATOR(SCHEMA).validate(result)
    return result


def perception_missed(answers: Answers | None = None, **more: Any) -> dict[str, Any]:
    record = faulty_drive()
    given = answering(record, {PERCEPTION: FATAL}) if answers is None else answers
    return told(attributed(record, given, faults=(FAULTY,), **more), (FAULTY,))


@pytest.mark.parametrize(
    ("source", "repeats", "says"),
    [
        (StackSource(), None, {"stack": None, "bug": None, "jitter": False, "repeats": 1}),
        (StackSource("mine.toml", "apollo-6826"), 1, {"stack": "mine.toml", "bug": "apollo-6826", "repeats": 1}),
        (StackSource("my_module:my_stack"), 5, {"stack": "my_module:my_stack", "jitter": True, "repeats": 5}),
    ],
)
def test_what_drove_and_in_which_mode_is_told(source: StackSource, repeats: int | None, says: dict[str, Any]) -> None:
    result = result_of(Request(SCENARIO, (), repeats), source, attributed(drive(), lambda _: SAFE), TIMING)
    VALIDATOR(SCHEMA).validate(result)
    assert result["jitter"] is (repeats is not None)
    assert {key: result[key] for key in says} == says


def test_the_schema_is_a_schema_of_2020_12_and_ships_with_the_package() -> None:
    assert SCHEMA["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    VALIDATOR.check_schema(SCHEMA)


@pytest.mark.parametrize(("part", "keys"), CONTRACT.items())
def test_every_key_of_the_contract_is_there_and_required(part: str, keys: str) -> None:
    result = perception_missed()
    value = result[part] if part else result
    value = value[0] if isinstance(value, list) else value
    assert set(keys.split()) <= set(value)
    for key in keys.split():
        broken = json.loads(json.dumps(result))
        inside = broken[part] if part else broken
        del (inside[0] if isinstance(inside, list) else inside)[key]
        assert not VALIDATOR(SCHEMA).is_valid(broken), f"{part} without {key} is let through"


def test_new_keys_may_come_at_the_top_and_values_of_the_wrong_kind_may_not() -> None:
    result = perception_missed()
    assert VALIDATOR(SCHEMA).is_valid({**result, "carbon": 1.0})
    for wrong in (
        {"schema": 2},
        {"verdict": "maybe"},
        {"verdict": "none"},
        {"verdict": "not_reproducible"},
        {"component": "perceptron"},
        {"component": None},
        {"message": {**result["message"], "state": [1, 2]}},
        {"message": {**result["message"], "index": -1}},
        {"reduction_rate": 1.5},
        {"digest": "none"},
        {"probes": [{**result["probes"][0], "outcome": "PASS"}]},
        {"planted": {**result["planted"], "altered": [[1, 2, 3]]}},
    ):
        assert not VALIDATOR(SCHEMA).is_valid({**result, **wrong}), wrong


@pytest.mark.parametrize(
    ("violation", "fault", "reason"),
    [
        (HIT, "driver", ""),
        (replace(HIT, contact=Contact.STOPPED_EGO), "other", "ran into the standing ego"),
        (breach(Destination.not_reached, Category.MISSION, START + 4.4), None, ""),
    ],
)
def test_whose_doing_a_violation_is_is_told(violation: Violation, fault: str | None, reason: str) -> None:
    record = faulty_drive(violation)
    result = told(attributed(record, answering(record, {PERCEPTION: FATAL})))
    for one in (result["violation"], *result["violations"]):
        assert (one["fault"], one["reason"]) == (fault, reason)


def test_when_a_probe_is_safe_is_told() -> None:
    result = perception_missed()
    settled = (result["settled_at"], result["settled_from"], result["settled_past"])
    assert settled == (HIT.time + SETTLE, HIT.time + LEAST_SETTLE, PAST)


def test_nothing_to_explain() -> None:
    result = told(attributed(drive(), lambda _: SAFE))
    assert (result["verdict"], result["component"], result["message"]) == ("none", None, None)
    assert (result["violations"], result["probes"], result["interval"]) == ([], [], None)
    assert result["reduction_rate"] == 0.0
    assert result["messages"] == {
        "total": 1380,
        "localization": 600,
        "perception": 60,
        "prediction": 60,
        "planning": 60,
        "control": 600,
    }


def test_a_component_with_its_message_and_the_probes_that_prove_it() -> None:
    result = perception_missed()
    assert (result["verdict"], result["component"]) == ("component", "perception")
    assert (result["message"]["component"], result["message"]["index"]) == ("perception", FATAL)
    assert result["message"] == result["interval"]["last_safe"]
    assert result["interval"]["first_violating"]["index"] == FATAL + 1
    by_id = {probe["id"]: probe for probe in result["probes"]}
    ends = [by_id[number] for number in result["interval"]["probes"]]
    assert [(end["from"]["index"], end["outcome"]) for end in ends] == [(FATAL, "SAFE"), (FATAL + 1, "VIOLATES")]
    assert all(end["ideal"] == ["perception"] for end in ends)
    assert ends[0]["violation"] is None
    assert ends[1]["violation"]["kind"] == "collision"
    assert result["substitutions"]["perception"] == "SAFE"
    assert result["substitutions"]["all"] == "SAFE"
    assert result["reduction_rate"] == pytest.approx(1.0 - 1.0 / 1380.0)
    assert "ped missing" in result["differences"][0]["text"]


def test_a_planted_fault_with_the_messages_it_altered_as_ranges() -> None:
    record = faulty_drive()
    record.altered[PERCEPTION] = [3, 5, 6, 7, 9, *range(20, 40)]
    found = attributed(record, answering(record, {PERCEPTION: FATAL}), faults=(FAULTY,))
    planted = told(found, (FAULTY,))["planted"]
    assert planted["altered"] == [3, [5, 7], 9, [20, 39]]
    assert (planted["component"], planted["component_success"], planted["message_success"]) == (
        "perception",
        True,
        True,
    )
    assert planted["message_distance_s"] == 0.0


def test_messages_that_two_faults_touched_count_once() -> None:
    record = faulty_drive()
    record.altered[PERCEPTION] = [4, 4, 5, 5]
    found = attributed(record, answering(record, {PERCEPTION: FATAL}), faults=(FAULTY, FAULTY))
    assert told(found)["planted"]["altered"] == [[4, 5]]


def test_a_wrong_message_reduces_nothing() -> None:
    record = faulty_drive()
    result = told(attributed(record, answering(record, {PERCEPTION: 5}), faults=(FAULTY,)), (FAULTY,))
    assert not result["planted"]["message_success"]
    assert result["planted"]["message_distance_s"] == pytest.approx(0.5)
    assert result["reduction_rate"] == 0.0


def test_the_end_of_an_interval_may_be_the_run_as_driven() -> None:
    record = faulty_drive()
    result = told(attributed(record, answering(record, {PERCEPTION: 999})))
    assert result["interval"]["first_violating"] is None
    assert len(result["interval"]["probes"]) == 1


def test_planning_with_its_message_and_without_an_interval() -> None:
    record = drive(violations=[breach("lane_departure", Category.TRAFFIC_RULE, 9.0)])
    record.executions[Component.PLANNING][17] = replace(record.executions[Component.PLANNING][17], message=None)
    result = told(attributed(record, answering(record, {})))
    assert (result["verdict"], result["component"], result["interval"]) == ("planning", "planning", None)
    assert (result["message"]["component"], result["message"]["index"]) == ("planning", 17)
    assert result["differences"] == [{"field": "trajectory", "text": "no trajectory was published"}]


def test_unresolved_says_why_and_names_nobody() -> None:
    def together_only(task: Task) -> Glimpse:
        return SAFE if len(task.interventions) == 5 else glimpse(*faulty_drive().violations, steps=44)

    result = perception_missed(together_only)
    assert (result["verdict"], result["component"], result["message"]) == ("unresolved", None, None)
    assert "more than one component" in result["reason"]
    assert result["reproducible"] is True
    assert result["planted"]["component_success"] is False


def test_unresolved_where_an_oracle_could_not_judge_a_run_without_violation() -> None:
    result = told(attributed(replace(drive(), judgements=(unknown("red_light"),)), lambda _: SAFE))
    assert (result["verdict"], result["violations"]) == ("unresolved", [])
    assert result["judgements"] == [{"kind": "red_light", "answer": "unknown", "reason": "it was dark"}]


def test_not_reproducible() -> None:
    result = perception_missed(lambda _: glimpse(steps=44))
    assert (result["verdict"], result["component"], result["reproducible"]) == ("not_reproducible", None, False)
    assert result["probes"][0]["outcome"] == "SAFE"


def test_unresolved_where_the_repetition_could_not_be_told() -> None:
    result = perception_missed(lambda _: CRASHED)
    assert (result["verdict"], result["component"], result["reproducible"]) == ("unresolved", None, True)
    assert result["probes"][0]["outcome"] == "UNRESOLVED"
    assert "boom" in result["probes"][0]["reason"]
    assert result["probes"][0]["digest"] is None


def test_jitter_mode_tells_which_schedule_and_noise_a_probe_had() -> None:
    result = perception_missed(repeats=3)
    assert len({probe["jitter"] for probe in result["probes"]}) == len(result["probes"]) > 3
    assert result["message"] == result["interval"]["last_safe"]
    assert result["message"]["index"] < result["interval"]["first_violating"]["index"]


def test_a_certificate_tells_what_the_witness_said() -> None:
    record = faulty_drive()
    answers = answering(record, {PERCEPTION: FATAL})
    certificate = perception_missed(answers, witness=answers)["certificate"]
    assert certificate["agrees"] is True
    assert [check["from"] and check["from"]["index"] for check in certificate["checks"]] == [FATAL, FATAL + 1, None]
    refuted = perception_missed(answers, witness=answering(record, {}))
    assert refuted["certificate"]["agrees"] is False
    assert (refuted["verdict"], refuted["component"], refuted["message"]) == ("unresolved", None, None)


def test_an_interrupted_attribution_is_a_whole_result() -> None:
    record = faulty_drive()
    answers, made = answering(record, {PERCEPTION: FATAL}), []

    def interrupted(task: Task) -> Any:
        made.append(task)
        if len(made) > 5:
            raise KeyboardInterrupt
        return answers(task)

    with pytest.raises(AttributionStoppedError) as caught:
        attributed(record, interrupted, faults=(FAULTY,))
    assert told(caught.value.partial, (FAULTY,))["reason"].startswith("interrupted")


def test_endless_limits_are_null() -> None:
    mission = breach("no_progress", Category.MISSION, 9.0)
    record = replace(faulty_drive(mission), thresholds=Thresholds(no_progress_time=math.inf, ttc=math.nan))
    found = attributed(record, answering(record, {PERCEPTION: 3}))
    text = json.dumps(
        result_of(Request(replace(SCENARIO, end=math.inf)), StackSource(), found, TIMING), allow_nan=False
    )
    result = json.loads(text)
    assert result["settled_at"] is result["settled_from"] is result["settled_past"] is None
    assert result["scenario"]["end"] is None
    assert result["scenario"]["thresholds"]["no_progress_time"] is None
    assert result["scenario"]["thresholds"]["ttc"] is None
    VALIDATOR(SCHEMA).validate(result)


def test_measured_values_without_a_finite_one_are_null() -> None:
    endless = replace(breach("ttc", Category.SAFETY, 9.0), value=math.inf, threshold=math.nan)
    found = attributed(drive(violations=[endless]), lambda _: CRASHED)
    (violation,) = told(found)["violations"]
    assert (violation["value"], violation["threshold"]) == (None, None)


def test_scenario_overrides_and_faults_are_told() -> None:
    override = Override("begin", None, "5", "asked for")
    faults = (planted_fault("perception.miss:end=4,state=10:5:-1"), planted_fault("planning.speed:error=3"))
    request = Request(replace(SCENARIO, overrides=(override,)), faults)
    result = result_of(request, StackSource(), attributed(drive(), lambda _: SAFE), TIMING)
    VALIDATOR(SCHEMA).validate(json.loads(json.dumps(result, allow_nan=False)))
    assert result["scenario"]["overrides"] == [  # type: ignore[index]
        {"option": "begin", "configured": None, "used": "5", "reason": "asked for"}
    ]
    first, second = json.loads(json.dumps(result["faults"]))
    assert first["parameters"] == {"object": "in_way"}
    assert first["selection"] == {"start": 0.0, "end": 4.0, "first": 0, "state": [10, 5, -1]}
    assert second["parameters"] == {"factor": 1.0, "error": 3.0}
    assert "end" not in second["selection"]


def test_stops_that_the_ego_did_not_make_are_told() -> None:
    found = attributed(replace(drive(), stops=("bc_0 at 110 m", "market")), lambda _: SAFE)
    assert told(found)["scenario"]["stops"] == ["bc_0 at 110 m", "market"]


def test_timing_counts_every_run() -> None:
    result = perception_missed()
    assert result["timing"]["ratio"] == pytest.approx(4.0)
    record: Record = faulty_drive()
    assert result["timing"]["simulated_s"] == pytest.approx(record.simulated + 10.0 * len(result["probes"]))
    assert set(result["messages"]) == {"total", *COMPONENTS}
