"""What a run leaves: marks, beliefs and truth at any tick, and a digest that notices everything."""

import operator
import pickle
from pathlib import Path

import msgspec
import numpy as np
import pytest
from small_scenarios import driven, scenario_file

from dvca_sumo.interventions import Fault, Selection
from dvca_sumo.messages import COMPONENTS, Component, MessageId, TrackedObjects
from dvca_sumo.record import Digest, Record, moved_on

EGO = '<trip id="ego" from="bc" to="bc" depart="0" departPos="20" departSpeed="10" arrivalPos="60"/>'
ONCOMING = '<vehicle id="oncoming" depart="0" departPos="150" departSpeed="10"><route edges="cb"/></vehicle>'


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory, street: Path) -> Record:
    lost = Fault("lost", Component.LOCALIZATION, "publish_nothing", {}, Selection(first=100, last=119))
    return driven(scenario_file(tmp_path_factory.mktemp("record"), street, EGO + ONCOMING), lost)


def test_there_is_a_path_entry_a_tick_and_a_moment_a_step(record: Record) -> None:
    steps = len(record.moments) - 1
    assert len(record.path) == len(record.stations) == 10 * steps
    assert len(record.digests) == steps
    assert record.message_counts == {
        Component.LOCALIZATION: 10 * steps,
        Component.PERCEPTION: steps,
        Component.PREDICTION: steps,
        Component.PLANNING: steps,
        Component.CONTROL: 10 * steps,
    }
    assert record.path[0].time == pytest.approx(record.start)
    assert np.diff([ego.time for ego in record.path]) == pytest.approx(0.01)
    assert [record.path[10 * step].time for step in range(steps)] == pytest.approx(
        [moment.time for moment in record.moments[:-1]]
    )


@pytest.mark.parametrize(("component", "index", "tick"), [(Component.PLANNING, 7, 70), (Component.CONTROL, 73, 73)])
def test_a_mark_tells_when_and_in_which_state_a_message_was_made(
    record: Record, component: Component, index: int, tick: int
) -> None:
    mark = record.mark(MessageId(component, index))
    assert (mark.component, mark.index) == (component, index)
    assert mark.time == record.path[tick].time
    assert mark.state.position == int(record.stations[tick] // 2.0)
    assert mark.state.speed == int(record.path[tick].speed)


def test_the_belief_in_force_is_the_last_one_published(record: Record) -> None:
    for tick, wanted in ((99, 99), (100, 99), (119, 99), (120, 120)):
        assert record.believed_at(tick).time == pytest.approx(record.path[wanted].time)


def test_truth_between_two_steps_moves_the_ego_as_it_was_and_the_others_on(record: Record) -> None:
    moment, step = record.moment_at(74), record.moments[7]
    assert moment.ego == record.path[74]
    assert moment.objects.time == moment.ego.time
    moved = moment.objects.boxes[:, :2] - step.objects.boxes[:, :2]
    assert moved == pytest.approx(0.04 * step.objects.velocities, abs=1e-6)
    assert record.moment_at(70) is step


def test_truth_at_the_very_moment_is_that_moment(record: Record) -> None:
    moment = record.moments[3]
    assert moved_on(moment, moment.ego) is moment


def test_a_digest_notices_every_part_and_the_order() -> None:
    def digest(*parts: object) -> bytes:
        made = Digest()
        return [made.step(part) for part in parts][-1]

    boxes = np.arange(5.0)
    assert digest(boxes, {"a": 1}) == digest(boxes.copy(), {"a": 1})
    assert digest(boxes, {"a": 1}) != digest({"a": 1}, boxes)
    changed = boxes.copy()
    changed[3] = np.nextafter(changed[3], 9.0)
    assert digest(boxes) != digest(changed)
    assert digest({"a": 1, "b": 2}) == digest({"b": 2, "a": 1})


def test_a_digest_covers_all_steps_before() -> None:
    one, other = Digest(), Digest()
    assert one.step("a") != other.step("b")
    assert one.step("c") != other.step("c")


def test_what_has_no_canonical_bytes_is_refused() -> None:
    with pytest.raises(TypeError, match="a record holds a object, which has no canonical bytes"):
        Digest().step(object())


def test_the_digest_of_a_record_includes_its_violations(record: Record) -> None:
    assert record.violations == []
    worse = msgspec.structs.replace(record, violations=["anything"])
    assert worse.digest != record.digest


def test_a_record_survives_the_way_between_processes(record: Record) -> None:
    # It came out of a child process, arrays and route included.
    assert {execution.tick for component in COMPONENTS for execution in record.executions[component]} == set(
        range(len(record.path))
    )
    message = record.executions[Component.PERCEPTION][-1].message
    assert isinstance(message, TrackedObjects)
    assert message.boxes.shape == (len(message.ids), 5)
    assert record.route.line.length > 60.0


def test_a_record_comes_out_of_another_process_as_it_was(record: Record) -> None:
    sent = pickle.loads(pickle.dumps(record))  # noqa: S301 - made in the line itself
    everything = operator.attrgetter("executions", "path", "stations", "moments", "violations", "judgements", "digests")
    assert Digest().step(everything(sent)) == Digest().step(everything(record))
    assert sent.path == record.path
    assert sent.digest == record.digest
    for component in COMPONENTS:
        for one, other in zip(sent.executions[component], record.executions[component], strict=True):
            assert (one.tick, type(one.message)) == (other.tick, type(other.message))
    assert sent.moments[3].objects.boxes.shape == record.moments[3].objects.boxes.shape
