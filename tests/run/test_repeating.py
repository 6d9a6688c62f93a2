"""Equal tasks give equal runs; and what an intervention changes is what it caused, no draw of chance."""

from itertools import pairwise
from pathlib import Path

import pytest
from small_scenarios import driven, scenario_file

from dvca_sumo.interventions import planted_fault
from dvca_sumo.messages import COMPONENTS, Component
from dvca_sumo.record import Record
from dvca_sumo.run import StopRule, Task
from dvca_sumo.scenario import load_scenario

EGO = '<trip id="ego" from="bc" to="bc" depart="0" departPos="20" departSpeed="8" departLane="0" arrivalPos="150"/>'
STOPPED = (
    '<vehicle id="stopped" depart="0" departPos="110"><route edges="bc"/>'
    '<stop lane="bc_0" endPos="111" duration="1000"/></vehicle>'
)
DAWDLING = '<flow id="many" begin="0" period="2" number="20" from="cb" to="ba" departLane="random" departPos="random"/>'
SHORT = StopRule(at=3.0)


@pytest.fixture
def config(tmp_path: Path, street: Path) -> Path:
    return scenario_file(tmp_path, street, EGO + STOPPED + DAWDLING)


def traffic(record: Record) -> list[list[float]]:
    return [moment.objects.boxes.ravel().tolist() for moment in record.moments[:20]]


def test_the_same_task_twice_gives_the_same_digest(config: Path) -> None:
    first, second = driven(config), driven(config)
    assert first.digest == second.digest
    assert first.digests == second.digests
    assert first.path == second.path


def test_another_seed_gives_other_noise_and_other_traffic(config: Path) -> None:
    first, other = driven(config, seed=1, stop=SHORT), driven(config, seed=2, stop=SHORT)
    assert first.digest != other.digest
    assert first.executions[Component.LOCALIZATION][0] != other.executions[Component.LOCALIZATION][0]
    assert traffic(first) != traffic(other)


def test_a_jitter_number_repeats_itself_and_differs_from_every_other(config: Path) -> None:
    runs = [driven(config, jitter=number, stop=SHORT) for number in (None, 0, 1, 0)]
    digests = [run.digest for run in runs]
    assert digests[1] == digests[3]
    assert len(set(digests)) == 3


def test_jitter_shifts_components_and_noise_but_not_sumos_drivers(config: Path) -> None:
    runs = [driven(config, jitter=number, stop=SHORT) for number in (None, *range(6))]
    for component, count in ((Component.PERCEPTION, 2), (Component.PREDICTION, 2), (Component.PLANNING, 2)):
        phases = {run.executions[component][0].tick % 10 for run in runs}
        assert len(phases) >= count
        for run in runs:
            ticks = [execution.tick for execution in run.executions[component]]
            assert {later - earlier for earlier, later in pairwise(ticks)} == {10}
    assert all(run.executions[component][0].tick == 0 for run in runs[:1] for component in COMPONENTS)
    assert all(traffic(run) == traffic(runs[0]) for run in runs)
    first_fixes = {str(run.executions[Component.LOCALIZATION][0].message) for run in runs}
    assert len(first_fixes) == len(runs)


def test_seeds_of_jittered_runs_do_not_meet_those_of_other_scenario_seeds(config: Path) -> None:
    seeds = [
        Task(load_scenario(config, seed=seed), jitter=jitter).seed for seed in range(50) for jitter in (None, 0, 1, 2)
    ]
    assert len(set(seeds)) == len(seeds)


def test_a_fault_of_perception_leaves_localization_alone_until_the_ego_moves_differently(config: Path) -> None:
    healthy, faulty = driven(config), driven(config, planted_fault("perception.miss:object=stopped"))
    parted = next(tick for tick, pair in enumerate(zip(healthy.path, faulty.path, strict=False)) if pair[0] != pair[1])
    first_altered = faulty.executions[Component.PERCEPTION][faulty.altered[Component.PERCEPTION][0]].tick
    assert 0 <= first_altered < parted
    for tick in range(parted):
        assert healthy.executions[Component.LOCALIZATION][tick] == faulty.executions[Component.LOCALIZATION][tick]
    assert healthy.executions[Component.LOCALIZATION][parted] != faulty.executions[Component.LOCALIZATION][parted]


def test_the_digest_of_every_step_covers_what_came_before(config: Path) -> None:
    healthy, faulty = driven(config), driven(config, planted_fault("planning.speed:factor=0.5,start=2"))
    same = [one == other for one, other in zip(healthy.digests, faulty.digests, strict=False)]
    assert same[:20] == [True] * 20
    assert not any(same[20:])
