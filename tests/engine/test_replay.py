"""The replay engine: records, glimpses, and what a user reads when a run cannot be made."""

import re
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from small_scenarios import EGO, TIMEOUT, driven, scenario_file
from small_stacks import CRASHING_SEED, RAISING_CYCLE

from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse, RunFailedError
from dvca_sumo.engine.replay import ReplayEngine
from dvca_sumo.interventions import Futures, Ideal, recorded_futures
from dvca_sumo.messages import COMPONENTS, Component
from dvca_sumo.roadmap import RoadMapError
from dvca_sumo.run import Task
from dvca_sumo.scenario import ScenarioError, load_scenario
from dvca_sumo.stack.reference import StackError
from dvca_sumo.stack.sources import StackSource

FAR = EGO.replace('depart="0"', 'depart="590"')
LATE = "".join(f'<vehicle id="v{time}" depart="{time}"><route edges="nb bs"/></vehicle>' for time in range(0, 580, 20))


def tasks(config: Path, *seeds: int) -> list[Task]:
    return [Task(load_scenario(config, seed=seed)) for seed in seeds]


def test_a_glimpse_is_of_the_same_run_as_a_record(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street)
    engine = ReplayEngine(street, StackSource(), 1, TIMEOUT)
    (task,) = tasks(config, 3)
    record = engine.record(task)
    (glimpse,) = engine.glimpses([task], lambda _row, _answer: None)
    assert isinstance(glimpse, Glimpse)
    assert glimpse.digest == record.digest
    assert (glimpse.violations, glimpse.judgements) == (tuple(record.violations), record.judgements)
    assert (glimpse.ending, glimpse.simulated) == (record.ending, record.simulated)
    assert (glimpse.passes, glimpse.residual) == (1, None)


def test_glimpses_come_in_the_order_of_their_tasks_and_are_heard_of_as_they_finish(
    tmp_path: Path, street: Path
) -> None:
    heard: dict[int, Glimpse | Failure] = {}
    engine = ReplayEngine(street, StackSource(), 2, TIMEOUT)
    found = engine.glimpses(tasks(scenario_file(tmp_path, street), 1, 2, 1), heard.__setitem__)
    digests = [one.digest for one in found if isinstance(one, Glimpse)]
    assert len(digests) == 3
    assert digests[0] == digests[2] != digests[1]
    assert [heard[row] for row in range(3)] == found


def test_a_crash_costs_its_own_run_alone(tmp_path: Path, street: Path) -> None:
    engine = ReplayEngine(street, StackSource("small_stacks:crashing_by_seed"), 2, TIMEOUT)
    found = engine.glimpses(tasks(scenario_file(tmp_path, street), 1, CRASHING_SEED, 2), lambda _row, _answer: None)
    assert [type(one) for one in found] == [Glimpse, Failure, Glimpse]
    crashed = found[1]
    assert isinstance(crashed, Failure)
    assert "SIGSEGV" in crashed.reason
    assert "last words" in crashed.said


def test_a_crash_of_the_factual_run_names_the_signal(tmp_path: Path, street: Path) -> None:
    config = scenario_file(tmp_path, street, seed=str(CRASHING_SEED))
    with pytest.raises(RunFailedError, match="the run failed: the process died of SIGSEGV"):
        driven(config, stack="small_stacks:crashing_by_seed")


def test_a_stack_that_leaves_is_a_failed_run(tmp_path: Path, street: Path) -> None:
    with pytest.raises(RunFailedError, match="the process ended with code 3 without an answer"):
        driven(scenario_file(tmp_path, street), stack="small_stacks:leaving")


def test_a_hanging_stack_is_ended(tmp_path: Path, street: Path) -> None:
    (task,) = tasks(scenario_file(tmp_path, street), 1)
    with pytest.raises(RunFailedError, match=r"no answer within 0\.6 s"):
        ReplayEngine(street, StackSource("small_stacks:hanging"), 1, timeout=0.6).record(task)


@pytest.mark.parametrize("component", COMPONENTS)
def test_a_component_that_raises_is_named_with_its_cycle_and_words(
    tmp_path: Path, street: Path, component: Component
) -> None:
    config = scenario_file(tmp_path, street)
    with pytest.raises(StackError) as raised:
        driven(config, stack=f"small_stacks:raising_{component}")
    assert str(raised.value).startswith(
        f"{component} raised ZeroDivisionError: the lidar said 0 in cycle {RAISING_CYCLE} ("
    )
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("stack", "words"),
    [
        ("silent_planning", "planning raised TypeError: its step returned NoneType, not Trajectory in cycle"),
        ("wordy_control", "control raised TypeError: its step returned str, not ControlCommand in cycle"),
        (
            "lost_localization",
            "localization raised ValueError: its estimate holds a number that is not finite in cycle",
        ),
        ("wild_control", "control command at .* must be finite.* in cycle"),
    ],
)
def test_a_component_that_answers_with_nonsense_is_named(tmp_path: Path, street: Path, stack: str, words: str) -> None:
    with pytest.raises(StackError, match=rf"{words} {RAISING_CYCLE}\b"):
        driven(scenario_file(tmp_path, street), stack=f"small_stacks:{stack}")


@pytest.mark.parametrize(
    ("stack", "words"),
    [
        ("flat_boxes", "perception raised ValueError: the shape of its boxes is (0, 4), and must be (0, 5) in cycle 0"),
        ("listed_velocities", "the shape of its velocities is that of a list, and must be (0, 2)"),
        ("brief_poses", "prediction raised ValueError: the shape of its poses is (0, 3, 3), and must be (0, 25, 3)"),
        ("unnamed_lanes", "the shape of its lanes is (1,), and must be (0,)"),
        ("short_points", "planning raised ValueError: the shape of its points is (80, 7), and must be (81, 7)"),
        ("undecided", "planning raised TypeError: its decision is of type object, not str in cycle 0 ("),
        ("uncertain", "prediction raised TypeError: its probabilities are of type object, not float64 in cycle 0 ("),
        ("hasty_points", "the times of its points are up to 8 s off, and must be TRAJECTORY_TIMES"),
    ],
)
def test_an_answer_of_another_shape_or_type_is_named(tmp_path: Path, street: Path, stack: str, words: str) -> None:
    """Whoever reads it next would fail in its place."""
    with pytest.raises(StackError, match=re.escape(words)):
        driven(scenario_file(tmp_path, street), stack=f"small_stacks:{stack}")


@pytest.mark.parametrize(("stack", "cycle"), [("buffering_planning", 1), ("scribbling_planning", 0)])
def test_a_component_that_writes_to_a_message_is_named(tmp_path: Path, street: Path, stack: str, cycle: int) -> None:
    """Else the record would show what was never said."""
    with pytest.raises(StackError, match=rf"planning raised ValueError: .*not to be written to\) in cycle {cycle} "):
        driven(scenario_file(tmp_path, street), stack=f"small_stacks:{stack}")


def test_a_failing_stack_is_an_unresolved_glimpse_with_its_reason(tmp_path: Path, street: Path) -> None:
    engine = ReplayEngine(street, StackSource("small_stacks:raising_planning"), 1, TIMEOUT)
    (found,) = engine.glimpses(tasks(scenario_file(tmp_path, street), 1), lambda _row, _answer: None)
    assert isinstance(found, Failure)
    assert "planning raised ZeroDivisionError" in found.reason
    assert isinstance(found.error, StackError)


def test_a_stack_reads_its_files_where_the_command_was_typed(
    tmp_path: Path, street: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("weights.txt").write_text("7")
    assert driven(scenario_file(tmp_path / "else", street), stack="small_stacks:reading_a_file").path


@pytest.mark.parametrize(
    ("factory", "words"),
    [
        ("refusing", "stack factory 'small_stacks:refusing' raised LookupError: no weights here"),
        ("returning_nonsense", "stack factory 'small_stacks:returning_nonsense' returned str, not a Stack"),
    ],
)
def test_a_factory_that_gives_no_stack_is_named(tmp_path: Path, street: Path, factory: str, words: str) -> None:
    with pytest.raises(StackError, match=words):
        driven(scenario_file(tmp_path, street), stack=f"small_stacks:{factory}")


@pytest.mark.parametrize(
    ("routes", "words"),
    [
        (EGO + "<vehicle", r"unterminated start tag 'vehicle' In file '.*routes\.rou\.xml' At line/column"),
        (
            EGO + '<vehicle id="x" depart="1"><route edges="zz"/></vehicle>',
            "edge 'zz' within the route for vehicle 'x'",
        ),
        (EGO + '<vehicle id="x" depart="soon"><route edges="bc"/></vehicle>', "Invalid departure time for vehicle 'x'"),
        (LATE + FAR + '<vehicle id="x" depart="700"><route edges="zz"/></vehicle>', "SUMO stopped at .* edge 'zz'"),
        (LATE + FAR + "<vehicle", r"SUMO stopped at .*unterminated start tag 'vehicle' In file '.*routes\.rou\.xml'"),
    ],
)
def test_malformed_routes_are_refused_in_one_line_with_sumos_words(
    tmp_path: Path, street: Path, routes: str, words: str
) -> None:
    with pytest.raises(ScenarioError, match=words) as refused:
        driven(scenario_file(tmp_path, street, routes))
    assert "\n" not in str(refused.value)


def test_an_option_that_sumo_does_not_know_is_named(tmp_path: Path, street: Path) -> None:
    with pytest.raises(ScenarioError, match=r"cannot start .*No option with the name 'osg-view' exists") as refused:
        driven(scenario_file(tmp_path, street, osg_view="true"))
    assert "\n" not in str(refused.value)


def test_a_detector_on_a_missing_lane_is_named(tmp_path: Path, street: Path) -> None:
    detector = '<inductionLoop id="d" lane="zz_0" pos="3" period="1" file="d.xml"/>'
    with pytest.raises(ScenarioError, match=r"cannot start .*lane with the id 'zz_0' is not known"):
        driven(scenario_file(tmp_path, street, additional=detector))


def test_a_malformed_additional_file_is_named(tmp_path: Path, street: Path) -> None:
    with pytest.raises(
        ScenarioError, match=r"unterminated start tag 'poi' In file '.*extra\.add\.xml' At line"
    ) as refused:
        driven(scenario_file(tmp_path, street, additional="<poi"))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", ["", "<net><edge", "<routes/>", '<net version="1.20"></net>'])
def test_a_net_that_is_none_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    net = tmp_path / "broken.net.xml"
    net.write_text(text)
    with pytest.raises(RoadMapError, match=r"^[^\n]*broken\.net\.xml[^\n]*$"):
        driven(scenario_file(tmp_path, net))


def test_a_net_cut_short_is_refused_in_one_line(tmp_path: Path, street: Path) -> None:
    net = tmp_path / "broken.net.xml"
    net.write_text(street.read_text()[:-200])
    with pytest.raises(RoadMapError, match=r"^[^\n]*broken\.net\.xml[^\n]*$"):
        driven(scenario_file(tmp_path, net))


def test_an_ideal_prediction_is_repeated_until_it_comes_true(tmp_path: Path, street: Path) -> None:
    ahead = '<vehicle id="ahead" depart="0" departPos="35" departSpeed="10"><route edges="bc"/></vehicle>'
    task = Task(load_scenario(scenario_file(tmp_path, street, EGO + ahead)), (Ideal(Component.PREDICTION),))
    engine = ReplayEngine(street, StackSource(), 1, TIMEOUT)
    factual = engine.record(task)
    (track,) = recorded_futures(factual.moments).tracks.values()
    elsewhere = Futures({"ahead": replace(track, poses=track.poses + np.array([3.0, 0.0, 0.0]))})
    (found,) = engine.glimpses([replace(task, futures=elsewhere)], lambda _row, _answer: None)
    assert isinstance(found, Glimpse)
    assert found.passes == 2
    assert found.residual is not None
    assert found.residual <= 0.5
    assert found.simulated == pytest.approx(2.0 * factual.simulated, rel=0.2)
