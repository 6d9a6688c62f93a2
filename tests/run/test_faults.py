"""Interventions at work in a drive: which messages they touch, and what the record says of it."""

import math
from pathlib import Path

import msgspec
import numpy as np
import pytest
from small_scenarios import driven, scenario_file

from dvca_sumo.interventions import Fault, Ideal, Selection, planted_fault
from dvca_sumo.messages import COMPONENTS, Component, LocalizationEstimate, MessageId, TrackedObjects
from dvca_sumo.record import Execution, Record

EGO = '<trip id="ego" from="bc" to="bc" depart="0" departPos="40" departSpeed="10" departLane="0" arrivalPos="110"/>'
# It stands on the other side of the road: the ego's drive is the same whether it is seen or not.
ASIDE = (
    '<vehicle id="aside" depart="0" departPos="200"><route edges="cb"/>'
    '<stop lane="cb_0" startPos="200" endPos="201" duration="1000" parking="true"/></vehicle>'
)


@pytest.fixture
def config(tmp_path: Path, street: Path) -> Path:
    return scenario_file(tmp_path, street, EGO + ASIDE)


def changed(record: Record, healthy: Record, component: Component) -> list[int]:
    """Indices of messages that are not the healthy run's, of two runs with one and the same path."""
    assert record.path == healthy.path
    encoded = msgspec.msgpack.Encoder(enc_hook=lambda array: array.tobytes())
    pairs = zip(record.executions[component], healthy.executions[component], strict=True)
    return [row for row, (one, other) in enumerate(pairs) if encoded.encode(one) != encoded.encode(other)]


@pytest.mark.parametrize("where", ["", ",start=1.05,end=2", ",first=3,last=17", ",first=900", ",first=5,end=1"])
def test_exactly_the_altered_messages_are_recorded(config: Path, where: str) -> None:
    healthy, faulty = driven(config), driven(config, planted_fault(f"perception.miss:object=aside{where}"))
    altered = faulty.altered[Component.PERCEPTION]
    assert altered == changed(faulty, healthy, Component.PERCEPTION)
    assert all(not faulty.altered[component] for component in COMPONENTS if component is not Component.PERCEPTION)
    times = [faulty.mark(MessageId(Component.PERCEPTION, index)).time - faulty.start for index in altered]
    if "start" in where:
        assert (min(times), max(times)) == pytest.approx((1.1, 1.9))
    elif "last" in where:
        assert set(altered) <= set(range(3, 18))
        assert altered[-1] == 17
    elif "end" in where:
        assert altered == [5, 6, 7, 8, 9]
    else:
        assert (altered == []) == ("900" in where)


def test_a_state_selects_the_messages_made_in_it(config: Path) -> None:
    healthy = driven(config)
    messages = [MessageId(Component.LOCALIZATION, index) for index in range(len(healthy.path))]
    wanted = healthy.mark(messages[150]).state
    inside = [message.index for message in messages if healthy.mark(message).state == wanted]
    assert 5 < len(inside) < 60
    fault = planted_fault(f"perception.miss:object=aside,state={wanted}")
    altered = driven(config, fault).altered[Component.PERCEPTION]
    ticks = [healthy.executions[Component.PERCEPTION][index].tick for index in altered]
    assert ticks == [index for index in inside if index % 10 == 0]


def test_two_faults_on_one_message_count_it_once(config: Path) -> None:
    fault = planted_fault("localization.lateral:left=0.1,first=10,last=12")
    assert driven(config, fault, fault).altered[Component.LOCALIZATION] == [10, 11, 12]


def test_a_lost_trajectory_leaves_the_last_one_in_force(config: Path) -> None:
    record = driven(config, planted_fault("planning.none:first=10,last=14"))
    planned = record.executions[Component.PLANNING]
    assert [row for row, execution in enumerate(planned) if execution.message is None] == [10, 11, 12, 13, 14]
    assert record.altered[Component.PLANNING] == [10, 11, 12, 13, 14]
    assert [execution.tick for execution in planned] == list(range(0, 10 * len(planned), 10))
    healthy = driven(config)
    assert record.path[:101] == healthy.path[:101]
    assert record.path[:160] != healthy.path[:160]
    assert math.dist((record.path[150].x, record.path[150].y), (healthy.path[150].x, healthy.path[150].y)) < 0.2


def test_a_lost_control_command_leaves_the_last_one_in_force(config: Path) -> None:
    noise = Fault("lost", Component.CONTROL, "publish_nothing", {}, Selection(first=100, last=109))
    record = driven(config, noise)
    assert [execution.message for execution in record.executions[Component.CONTROL][100:110]] == [None] * 10
    assert len(record.path) > 200


def test_a_component_whose_messages_are_lost_from_the_start_gives_its_successors_nothing(config: Path) -> None:
    silent = Fault("lost", Component.PERCEPTION, "publish_nothing", {}, Selection(last=19))
    record = driven(config, silent)
    assert record.executions[Component.PREDICTION][0].tick == 200
    assert record.executions[Component.PLANNING][0].tick == 200
    assert record.executions[Component.CONTROL][0].tick == 0


@pytest.mark.parametrize("silent", [Component.LOCALIZATION, Component.CONTROL])
def test_until_there_is_a_command_the_ego_rolls_straight_on(config: Path, silent: Component) -> None:
    record = driven(config, Fault("lost", silent, "publish_nothing", {}, Selection(end=2.0)))
    rolling, begin = record.path[:200], record.path[0]
    assert {(ego.speed, ego.y, ego.heading, ego.steering) for ego in rolling} == {
        (begin.speed, begin.y, begin.heading, 0.0)
    }
    first = next(one for one in record.executions[Component.CONTROL] if one.message is not None)
    assert first.tick == 200
    assert record.path[-1].speed == 0.0


def test_a_fault_within_an_ideal_component_alters_nothing_that_is_published(config: Path) -> None:
    fault = planted_fault("localization.lateral:left=2.0")
    record = driven(config, fault, Ideal(Component.LOCALIZATION))
    for tick, execution in enumerate(record.executions[Component.LOCALIZATION]):
        assert isinstance(execution.message, LocalizationEstimate)
        truth = record.path[tick]
        assert (execution.message.x, execution.message.y) == (truth.x, truth.y)


def test_a_substitute_begins_when_its_state_is_reached_and_not_before(config: Path) -> None:
    healthy = driven(config)
    at = healthy.mark(MessageId(Component.PERCEPTION, 12))
    record = driven(config, Ideal(Component.PERCEPTION, Selection(from_state=at.state)))
    assert record.substituted is not None
    assert record.substituted <= at.time
    first = next(
        execution.tick
        for execution, other in zip(
            record.executions[Component.PERCEPTION], healthy.executions[Component.PERCEPTION], strict=False
        )
        if not _is_same(execution, other)
    )
    mark = record.mark(MessageId(Component.PERCEPTION, first // 10))
    assert mark.state == at.state or mark.state.position > at.state.position
    assert record.path[first].time == record.substituted


def _is_same(one: Execution, other: Execution) -> bool:
    assert isinstance(one.message, TrackedObjects)
    assert isinstance(other.message, TrackedObjects)
    return np.array_equal(one.message.boxes, other.message.boxes)
