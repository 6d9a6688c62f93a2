"""A user's own planner in the reference stack: driven, and blamed for what it does."""

from pathlib import Path

import pytest
from command_line import typed
from small_scenarios import scenario_file

from dvca_sumo.cli import ExitCode

HERE = Path(__file__).parent
STACK = "foreign_planner:stack"


def test_it_drives_a_free_road_to_its_destination(tmp_path: Path, street: Path) -> None:
    trip = '<trip id="ego" from="bc" to="bc" depart="0" departPos="20" departSpeed="10" arrivalPos="250"/>'
    said = typed("run", scenario_file(tmp_path / "free", street, trip), "--stack", STACK, "--json", folder=HERE)
    assert said.code == ExitCode.NO_VIOLATION, said
    assert {one["kind"]: one["answer"] for one in said.result["judgements"]}["destination"] == "kept"


@pytest.mark.parametrize(("scenario", "kind"), [("cs2", "collision"), ("cs5", "red_light")])
def test_it_is_blamed_for_what_it_does_not_heed(scenario: str, kind: str) -> None:
    said = typed("run", f"nets/{scenario}.sumocfg", "--stack", STACK, "--json", folder=HERE)
    assert said.code == ExitCode.ATTRIBUTED, said
    result = said.result
    assert result["violation"]["kind"] == kind
    assert result["verdict"] == result["component"] == result["message"]["component"] == "planning"
    assert result["message"]["time"] < result["violation"]["time"]
    assert result["planted"] is None
