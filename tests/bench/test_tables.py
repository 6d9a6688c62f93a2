"""What a reader is shown: the paper beside ours, every wrong case with its reason and its command."""

import json

from bench.scores import score
from dvca_sumo.bench.tables import json_of, markdown_page, terminal_text

CONTRACT = {
    "suite",
    "name",
    "scenario",
    "expected_component",
    "component",
    "component_success",
    "message_success",
    "message_distance_s",
    "reduction_rate",
    "probes",
    "factual_wall_s",
    "attribution_wall_s",
    "mode",
}


def test_the_papers_figures_stand_beside_ours() -> None:
    control = score("control.lateral/cs5", "control", "control")
    (row,) = [line for line in terminal_text([control]).splitlines() if line.strip().startswith("control  ")][:1]
    assert "1/1" in row
    assert "80%" in row
    assert "78.7%" in row


def test_a_wrong_case_is_listed_with_its_reason_and_a_command() -> None:
    text = terminal_text([score(), score("prediction.wrong/cs2", "prediction", "control", has_message=False)])
    assert "prediction.wrong/cs2: control instead of prediction: why" in text
    assert "dvca-sumo run nets/cs1.sumocfg --fault perception.miss" in text
    assert "FAILS: components named right: 1 of 2" in text


def test_each_suite_and_mode_has_a_table_of_its_own() -> None:
    text = terminal_text([score(), score(mode="jitter", is_proven=None), score("apollo-3634", suite="real-bugs")])
    assert [line for line in text.splitlines() if " mode: " in line] == [
        "Injected faults, exact mode: 1 cases",
        "Injected faults, jitter mode: 1 cases",
        "Real bugs, exact mode: 1 cases",
    ]


def test_the_page_is_made_of_whole_markdown_tables() -> None:
    lines = markdown_page([score(), score("a/b", component=None)]).splitlines()
    widths = {line.count("|") for line in lines if line.startswith("|")}
    tables = "\n".join(lines).split("\n\n")
    for table in tables:
        assert len({line.count("|") for line in table.splitlines() if line.startswith("|")}) <= 1
    assert widths


def test_the_json_holds_what_the_contract_names_and_nothing_that_json_has_not() -> None:
    result = json_of([score(), score(component=None)])
    again = json.loads(json.dumps(result, allow_nan=False))
    assert again["schema"] == 1
    assert set(again["cases"][0]) >= CONTRACT
    assert again["summary"][0]["cases"] == 2
    assert again["missing"] == 0
