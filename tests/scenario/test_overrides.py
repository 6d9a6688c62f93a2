"""What a run needs to be truthful is set, and said."""

import os
from pathlib import Path

import pytest
from small_scenarios import scenario_file

from dvca_sumo.scenario import Scenario, ScenarioError, load_scenario


@pytest.fixture
def net(tmp_path: Path) -> Path:
    path = tmp_path / "some.net.xml"
    path.write_text("<net/>")
    return path


def changes(scenario: Scenario) -> dict[str, tuple[str | None, str]]:
    return {one.option: (one.configured, one.used) for one in scenario.overrides}


@pytest.mark.parametrize("step", ["1", "0.5", "0.05"])
def test_another_step_becomes_the_world_step(tmp_path: Path, net: Path, step: str) -> None:
    changed = changes(load_scenario(scenario_file(tmp_path, net, step_length=step)))
    assert changed["step-length"] == (step, "0.1")


def test_an_unset_step_is_sumos_second(tmp_path: Path, net: Path) -> None:
    changed = changes(load_scenario(scenario_file(tmp_path, net)))
    assert changed["step-length"] == (None, "0.1")


def test_the_world_step_itself_is_no_override(tmp_path: Path, net: Path) -> None:
    changed = changes(load_scenario(scenario_file(tmp_path, net, step_length="0.1")))
    assert "step-length" not in changed


def test_junctions_are_driven_over_even_where_sumo_is_told_to_jump_them(tmp_path: Path, net: Path) -> None:
    changed = changes(load_scenario(scenario_file(tmp_path, net, no_internal_links="true")))
    assert changed["no-internal-links"] == ("true", "false")
    assert "no-internal-links" not in changes(load_scenario(scenario_file(tmp_path, net)))


def test_colliding_vehicles_do_not_vanish_whatever_is_configured(tmp_path: Path, net: Path) -> None:
    config = scenario_file(tmp_path, net, collision__action="remove", collision__mingap_factor="1")
    changed = changes(load_scenario(config))
    assert changed["collision.action"] == ("remove", "warn")
    assert changed["collision.check-junctions"] == (None, "true")
    assert changed["collision.mingap-factor"] == ("1", "0")


def test_the_run_repeats_and_waits_for_nobody(tmp_path: Path, net: Path) -> None:
    config = scenario_file(tmp_path, net, random="true", seed="7", remote_port="8813", threads="4", end="50")
    scenario = load_scenario(config)
    changed = changes(scenario)
    assert changed["random"] == ("true", "false")
    assert changed["remote-port"] == ("8813", "0")
    assert changed["threads"] == ("4", "1")
    assert changed["end"] == ("50", "-1")
    assert "seed" not in changed
    assert scenario.seed == 7


def test_an_asked_for_seed_wins(tmp_path: Path, net: Path) -> None:
    scenario = load_scenario(scenario_file(tmp_path, net, seed="7"), seed=8)
    assert scenario.seed == 8
    assert changes(scenario)["seed"] == ("7", "8")


def test_without_any_seed_it_is_sumos_own(tmp_path: Path, net: Path) -> None:
    assert load_scenario(scenario_file(tmp_path, net)).seed == 23423


def test_a_seed_that_is_no_number_is_refused(tmp_path: Path, net: Path) -> None:
    with pytest.raises(ScenarioError, match="option seed is no whole number: 'abc'"):
        load_scenario(scenario_file(tmp_path, net, seed="abc"))


def test_outputs_go_nowhere_and_states_are_never_saved(tmp_path: Path, net: Path) -> None:
    config = scenario_file(
        tmp_path,
        net,
        fcd_output="f.xml",
        log="l.txt",
        vtk_output="v",
        elechybrid_output="e.xml",
        save_state__times="10,20",
        save_state__files="a.xml,b.xml",
        output_prefix="TIME",
    )
    changed = changes(load_scenario(config))
    assert changed["fcd-output"] == ("f.xml", os.devnull)
    assert changed["log"] == ("l.txt", os.devnull)
    assert changed["output-prefix"] == ("TIME", "")
    for several in ("vtk-output", "elechybrid-output"):
        assert not Path(changed[several][1]).is_absolute()
    assert changed["save-state.times"][1] == "1e9"
    assert changed["save-state.files"][1] == os.devnull


def test_begin_is_overridden_only_when_it_changes(tmp_path: Path, net: Path) -> None:
    config = scenario_file(tmp_path, net, begin="0:0:10")
    assert load_scenario(config).begin == 10.0
    assert "begin" not in changes(load_scenario(config))
    assert changes(load_scenario(config, begin=1234567.25))["begin"] == ("0:0:10", "1234567.25")


@pytest.mark.parametrize(
    ("configured", "asked", "expected"),
    [("50", None, 50.0), ("50", 30.0, 30.0), ("-1", None, None), ("1:0:0", None, 3600.0)],
)
def test_end_is_the_asked_for_one_or_the_configured_one(
    tmp_path: Path, net: Path, configured: str, asked: float | None, expected: float | None
) -> None:
    assert load_scenario(scenario_file(tmp_path, net, end=configured), end=asked).end == expected


def test_an_end_before_the_begin_is_refused(tmp_path: Path, net: Path) -> None:
    with pytest.raises(ScenarioError, match="ends at 10 s, not after its begin at 20 s"):
        load_scenario(scenario_file(tmp_path, net, end="10"), begin=20.0)


def test_equal_words_make_equal_scenarios(tmp_path: Path, net: Path) -> None:
    config = scenario_file(tmp_path, net)
    assert load_scenario(config, seed=3) == load_scenario(config, seed=3)
    assert load_scenario(config, seed=3) != load_scenario(config, seed=4)
