"""The verdict a person reads: the facts it must hold, whatever the words around them."""

import re

import pytest
from analysis.scenes import (
    CRASHED,
    FATAL,
    FAULTY,
    HIT,
    SAFE,
    START,
    Answers,
    answering,
    attributed,
    breach,
    drive,
    faulty_drive,
    first_substituted,
    glimpse,
    ideals,
    unknown,
)
from msgspec.structs import replace

from dvca_sumo.analysis.attribution import Attribution, unexplained
from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.messages import Component
from dvca_sumo.oracles.destination import Destination
from dvca_sumo.report.result import Timing
from dvca_sumo.report.terminal import verdict_text
from dvca_sumo.run import Task
from dvca_sumo.violations import Category, Contact, Ending, Violation

PERCEPTION, PREDICTION, CONTROL = Component.PERCEPTION, Component.PREDICTION, Component.CONTROL
TIMING = Timing(factual_wall_s=0.5, attribution_wall_s=2.0, engine="fork", jobs=2)


def text(found: Attribution) -> str:
    return verdict_text(found, TIMING)


def explained(answers: Answers | None = None, **more: object) -> Attribution:
    record = faulty_drive()
    given = answering(record, {PERCEPTION: FATAL}) if answers is None else answers
    return attributed(record, given, faults=(FAULTY,), **more)  # type: ignore[arg-type]


def line(of: str, beginning: str) -> str:
    found = [one for one in of.splitlines() if one.strip().startswith(beginning)]
    assert len(found) == 1, f"{len(found)} lines begin with {beginning!r} in\n{of}"
    return found[0]


def test_every_line_fits_a_terminal_and_has_no_blanks_at_its_end() -> None:
    for found in (explained(), explained(lambda _: CRASHED), attributed(drive(), lambda _: SAFE)):
        said = text(found)
        assert not said.endswith("\n")
        for one in said.splitlines():
            assert one == one.rstrip()
            assert len(one) <= 120


def test_a_clean_run_says_so_and_how_it_ended() -> None:
    said = text(attributed(drive(ending=Ending.ARRIVED), lambda _: SAFE))
    assert "No violation." in said
    assert "arrived after 6.0 s" in said
    assert "1 run, 0.5 s" in said
    assert "on its way" in text(attributed(drive(ending=Ending.TIME_OVER), lambda _: SAFE))


@pytest.mark.parametrize(
    ("violation", "says"),
    [
        (replace(HIT, contact=Contact.STOPPED_EGO), "the other one's: ran into the standing ego"),
        (breach(Destination.not_reached, Category.MISSION, START + 4.4), "not known"),
    ],
)
def test_whose_doing_it_is_stands_there_unless_it_is_the_egos(violation: Violation, says: str) -> None:
    record = faulty_drive(violation)
    assert says in line(text(attributed(record, answering(record, {PERCEPTION: FATAL}))), "doing")
    assert "doing" not in text(explained())
    assert "doing" not in text(unexplained(faulty_drive(HIT)))  # interrupted before anybody asked


def test_a_run_that_could_not_be_judged_is_not_called_clean() -> None:
    said = text(attributed(replace(drive(), judgements=(unknown("red_light"),)), lambda _: SAFE))
    assert "No violation." not in said
    assert "could not be told" in said
    assert "red_light" in said


def test_a_harmless_fault_is_mentioned() -> None:
    record = drive()
    record.altered[PERCEPTION] = [1, 2, 3]
    said = text(attributed(record, lambda _: SAFE, faults=(FAULTY,)))
    assert "No violation." in said
    assert "3 messages altered" in said


def test_a_fault_that_never_acted_is_told_so() -> None:
    said = text(attributed(drive(), lambda _: SAFE, faults=(FAULTY,)))
    assert "which never acted: no message altered" in line(said, "planted")


def test_the_bug_of_the_build_is_held_against_the_answer() -> None:
    assert line(verdict_text(explained(), TIMING, "apollo-3634"), "BUG").endswith(
        "apollo-3634 (perception): component found"
    )
    assert line(verdict_text(explained(), TIMING, "apollo-6826"), "BUG").endswith("(planning): component NOT found")
    assert "BUG" not in text(explained())


def test_a_harmless_bug_is_mentioned() -> None:
    said = verdict_text(attributed(drive(), lambda _: SAFE), TIMING, "apollo-6826")
    assert line(said, "bug").split() == ["bug", "apollo-6826", "(planning),", "to", "no", "violation"]


def test_what_happened_tells_kind_time_place_and_with_whom() -> None:
    said = text(explained())
    assert line(said, "VIOLATION").split() == ["VIOLATION", "collision", "with", "person:ped", "at", "9.4", "s"]
    assert "(60.0, 0.0), lane in_0" in line(said, "where")
    assert HIT.detail in line(said, "what")
    assert "active front: the ego ran into it" in line(said, "contact")


@pytest.mark.parametrize(
    ("contact", "words"),
    [
        (Contact.STOPPED_EGO, "the other one ran into the standing ego"),
        (Contact.HIT_FROM_BEHIND, "the other one ran into the ego from behind"),
        (Contact.ACTIVE_SIDE, "the ego touched it with its side"),
    ],
)
def test_who_made_the_contact_is_visible(contact: Contact, words: str) -> None:
    record = faulty_drive(replace(HIT, contact=contact))
    assert words in line(text(attributed(record, answering(record, {PERCEPTION: FATAL}))), "contact")


@pytest.mark.parametrize("found", [explained(), attributed(drive(), lambda _: SAFE)], ids=["violating", "clean"])
def test_stops_that_the_ego_did_not_make_are_told_in_a_line(found: Attribution) -> None:
    assert "stops" not in text(found)
    stopping = replace(found, record=replace(found.record, stops=("bc_0 at 110 m", "market")))
    assert line(text(stopping), "stops").endswith("not made, the vehicle's own: bc_0 at 110 m, market")


def test_further_violations_are_listed_briefly() -> None:
    others = [breach("speed_limit", Category.TRAFFIC_RULE, START + 5.0 + 0.1 * row) for row in range(6)]
    record = faulty_drive(HIT, *others)
    said = line(text(attributed(record, answering(record, {PERCEPTION: FATAL}))), "also")
    assert said.count("speed limit at") == 4
    assert said.endswith("...")


def test_a_violation_off_the_road_with_nobody_has_neither_lane_nor_contact() -> None:
    record = faulty_drive(replace(breach("lane_departure", Category.TRAFFIC_RULE, START + 4.0), lane=None))
    said = text(attributed(record, answering(record, {PERCEPTION: FATAL})))
    assert "lane departure at 9.0 s" in line(said, "VIOLATION")
    assert "lane in_0" not in said
    assert "contact " not in said


def test_the_component_is_told_with_the_whole_vector_of_counterfactuals() -> None:
    said = text(explained())
    assert line(said, "COMPONENT").split() == ["COMPONENT", "perception"]
    assert "ideal perception alone prevents it" in line(said, "because")
    assert "safe" in line(said, "all four ideal")
    assert "safe" in line(said, "ideal perception ")
    for other in ("localization", "prediction", "control"):
        assert "still violates" in line(said, f"ideal {other} ")


def test_alternatives_are_told() -> None:
    record = faulty_drive()
    said = text(attributed(record, answering(record, {PERCEPTION: FATAL, PREDICTION: FATAL})))
    assert "prediction" in line(said, "also enough")


def test_the_message_is_told_with_time_ego_state_difference_and_proof() -> None:
    said = text(explained())
    message = line(said, "MESSAGE")
    assert f"perception #{FATAL} at 7.90 s" in message
    assert "(49.0, 0.0), 10.0 m/s" in line(said, "ego ")
    assert "24:10:0" in line(said, "state")
    assert "object ped missing; truth: 17.4 m ahead, 1.7 m right, standing" in line(said, "wrong")
    proof = said[said.index("proof") :].splitlines()[:2]
    assert re.search(rf"probe \d+: ideal perception from #{FATAL} on -> safe", proof[0])
    assert re.search(rf"probe \d+: ideal perception from #{FATAL + 1} on -> violates \(collision at 9.4 s\)", proof[1])


def test_the_probes_that_are_quoted_are_those_of_the_result() -> None:
    found = explained()
    quoted = [int(number) for number in re.findall(r"probe (\d+):", text(found))]
    assert [found.probes[number].question for number in quoted] == [probe.question for probe in found.evidence]


def test_a_proof_that_ends_with_the_run_as_driven_says_so() -> None:
    record = faulty_drive()
    said = text(attributed(record, answering(record, {PERCEPTION: 999})))
    assert "as driven" in said


def test_a_component_that_must_be_ideal_from_the_start_says_so() -> None:
    record = faulty_drive()
    said = text(attributed(record, answering(record, {PERCEPTION: 0})))
    assert "MESSAGE    perception #0" in said
    assert "from the start on -> safe" in said


def test_an_answer_that_is_not_monotone_is_noted() -> None:
    record = faulty_drive()

    def answers(task: Task) -> Glimpse:
        substituted = ideals(task)
        begun = first_substituted(record, substituted[PERCEPTION]) if PERCEPTION in substituted else 60
        return SAFE if begun == 24 else glimpse(HIT, steps=44)

    assert "not monotone" in line(text(attributed(record, answers)), "note")


def test_planning_is_told_with_its_message_and_how_it_breaks_the_specification() -> None:
    record = drive(violations=[HIT])
    record.executions[Component.PLANNING][17] = replace(record.executions[Component.PLANNING][17], message=None)
    said = text(attributed(record, answering(record, {})))
    assert line(said, "COMPONENT").split() == ["COMPONENT", "planning"]
    assert "planning #17 at 6.70 s" in line(said, "MESSAGE")
    assert "no trajectory was published" in line(said, "wrong")
    assert "proof" not in said


def test_unresolved_names_no_component_and_no_message() -> None:
    said = text(explained(lambda task: SAFE if len(ideals(task)) == 4 else glimpse(HIT, steps=44)))
    assert "could not be told" in line(said, "COMPONENT")
    assert "more than one component" in line(said, "because")
    assert "MESSAGE" not in said
    assert "NOT found" in line(said, "PLANTED")


def test_a_probe_that_could_not_be_told_is_shown_as_such() -> None:
    record = faulty_drive()
    answers = answering(record, {PERCEPTION: FATAL})

    def crashing(task: Task) -> Glimpse | Failure:
        substituted = ideals(task)
        is_early = tuple(substituted) == (CONTROL,) and first_substituted(record, substituted[CONTROL]) < 10 * FATAL
        return CRASHED if is_early else answers(task)

    said = text(attributed(record, crashing))
    assert "could not be told" in line(said, "ideal control ")
    assert line(said, "COMPONENT").endswith("perception")


def test_not_reproducible_says_why_and_names_nobody() -> None:
    said = text(explained(lambda _: glimpse(steps=44)))
    assert "not reproducible" in line(said, "COMPONENT")
    assert "shows no violation" in line(said, "because")
    assert "MESSAGE" not in said


def test_a_repetition_that_could_not_be_told_says_so_and_names_nobody() -> None:
    said = text(explained(lambda _: CRASHED))
    assert line(said, "COMPONENT") == "COMPONENT  could not be told"
    assert "the repeated run could not be told: killed by SIGSEGV" in line(said, "because")
    assert "MESSAGE" not in said


def test_a_planted_fault_is_held_against_the_answer() -> None:
    said = line(text(explained()), "PLANTED")
    assert "perception" in said
    assert "50 messages altered" in said
    assert "component found" in said
    assert "NOT" not in said
    record = faulty_drive()
    missed = line(text(attributed(record, answering(record, {PERCEPTION: 5}), faults=(FAULTY,))), "PLANTED")
    assert "component found" in missed
    assert "NOT one that the fault altered" in missed


def test_a_certificate_is_told() -> None:
    record = faulty_drive()
    answers = answering(record, {PERCEPTION: FATAL})
    assert "3 of 3" in line(text(explained(answers, witness=answers)), "CERTIFIED")
    refuted = text(explained(answers, witness=answering(record, {})))
    assert "1 of 3" in line(refuted, "CERTIFIED")
    assert "could not be told" in line(refuted, "COMPONENT")


def test_the_cost_is_told_in_runs_and_seconds() -> None:
    found = explained()
    last = text(found).splitlines()[-1]
    assert last.endswith("safe means: none until 13.4 s, or 11.9 s once 10 m past the place")
    assert f"1 + {len(found.probes)} runs, 2.5 s with 2 jobs, engine fork" in last


def test_no_place_is_named_where_a_safe_run_is_one_that_goes_on_to_its_end() -> None:
    record = faulty_drive(breach("no_progress", Category.MISSION, START + 4.4))
    assert "safe means" not in text(attributed(record, answering(record, {PERCEPTION: FATAL})))
