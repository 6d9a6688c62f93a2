"""The paper's own procedure, to the letter: Algorithm 1 of Wan et al., Driving Violation Cause Analysis.

What the letter says, and where:

- "Split the driving traces into a set of vehicle dynamic states": states of the whole trace, in the
  order in which the ego first meets them (Algorithm 1, main part; the section on state-based analysis).
- `dtest(M[prediction + localization + control][:])` violates: planning. Perception is not in that line
  of Algorithm 1, though the text says "all other components".
- Then "perception, prediction, control, localization", one by one: the first one whose substitution is
  enough is named, and no other is asked.
- `left = 1, right = n`, `while left + 1 < right`, `mid = (left + right) / 2`: bisection over states. The
  ends are assumed, not asked.
- "find a message in M[component] which belongs to State_left": any one will do, so here the first. Where
  there is none, "the message with the most similar vehicle states" (its results section).
- Of planning: the first message with `violationTest(m) = True`.

Every question is a whole run from time 0 to the end of the drive: the paper knows neither branches nor
a time after which a run has settled. A substitution begins when the run meets State_mid, or is past it.
"""

from dvca_sumo.analysis.attribution import setting_of
from dvca_sumo.analysis.bisection import Outcome
from dvca_sumo.analysis.dtest import Setting
from dvca_sumo.analysis.specification import first_violating_plan
from dvca_sumo.bench.baselines.probing import Probing
from dvca_sumo.bench.baselines.procedure import Baseline, Reply, Situation
from dvca_sumo.interventions import Ideal, Selection, State, state_of
from dvca_sumo.messages import Component, MessageId
from dvca_sumo.record import MessageMark, Record
from dvca_sumo.run import StopRule

_ALL_OTHERS = (Component.PREDICTION, Component.LOCALIZATION, Component.CONTROL)
_ONE_BY_ONE = (Component.PERCEPTION, Component.PREDICTION, Component.CONTROL, Component.LOCALIZATION)


def algorithm_1(situation: Situation) -> Reply:
    """The component and the message that the paper's algorithm names."""
    drive = situation.drive
    probing = Probing(drive.engine.witness, _whole(setting_of(drive.request, drive.record, situation.violation)))
    if probing.ask(*map(Ideal, _ALL_OTHERS)) is Outcome.VIOLATES:
        return probing.reply(_planning(situation))
    for component in _ONE_BY_ONE:
        if probing.ask(Ideal(component)) is Outcome.SAFE:
            message = _message(probing, drive.record, component, situation.violation.time)
            return probing.reply(Reply(component, message, f"ideal {component} alone prevents it"))
    return probing.reply(Reply(reason="no single substitution prevents it"))


def _whole(setting: Setting) -> Setting:
    """The same, but each run to the end of its drive, where every oracle can tell."""
    return Setting(
        scenario=setting.scenario,
        faults=setting.faults,
        futures=setting.futures,
        stop=StopRule(after_violation=0.0),
        start=setting.start,
        is_mission=True,
        jitters=setting.jitters,
    )


def _planning(situation: Situation) -> Reply:
    record = situation.drive.record
    roadmap = situation.drive.engine.roadmap
    finding = first_violating_plan(record, roadmap, record.thresholds, situation.violation)
    reason = "the violation stays although the others are ideal"
    return Reply(Component.PLANNING, None if finding is None else finding.mark, reason)


def _message(probing: Probing, record: Record, component: Component, time: float) -> MessageMark:
    states = _split(record, time)
    left, right = 0, len(states) - 1
    while left + 1 < right:
        mid = (left + right) // 2
        is_safe = probing.ask(Ideal(component, Selection(from_state=states[mid]))) is Outcome.SAFE
        left, right = (mid, right) if is_safe else (left, mid)
    marks = [record.mark(MessageId(component, index)) for index in range(len(record.executions[component]))]
    return min(marks, key=lambda mark: _unlike(mark.state, states[left]))


def _split(record: Record, time: float) -> list[State]:
    """The states of the trace up to `time` [s], each where it is first met."""
    path = [ego for ego in record.path if ego.time <= time]
    met = (
        state_of(station, ego.speed, ego.acceleration)
        for station, ego in zip(record.stations[: len(path)], path, strict=True)
    )
    return list(dict.fromkeys(met))


def _unlike(one: State, other: State) -> int:
    """0 for the same state."""
    return sum(abs(a - b) for a, b in zip(one, other, strict=True))


PAPER_PROCEDURE = Baseline(
    name="paper",
    title="the paper's Algorithm 1",
    names_component=True,
    names_message=True,
    explain=algorithm_1,
)
