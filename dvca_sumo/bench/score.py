"""How an attribution compares with the truth about its case."""

from typing import Literal

import msgspec

from dvca_sumo.analysis.attribution import Attribution
from dvca_sumo.bench.cases import Case
from dvca_sumo.messages import MessageId
from dvca_sumo.record import MessageMark, Record

Mode = Literal["exact", "jitter"]

FAILED = "failed"  # verdict of a case that could not be analysed


class Controls(msgspec.Struct, frozen=True):
    """The three runs that show the defect to be the cause; None: could not be told."""

    without: bool | None  # the drive without the defect is safe
    defective: bool | None  # the drive with it violates
    harmless: bool | None  # the same defect where it does no harm is safe

    @property
    def hold(self) -> bool:
        """Whether all three came out as they must."""
        return self.without is True and self.defective is True and self.harmless is True


class BaselineScore(msgspec.Struct, frozen=True):
    """What a baseline made of one case."""

    component: str | None  # None: none was named
    component_success: bool | None  # None: it was told which one it is
    message_success: bool | None  # None: it names components only
    message_distance_s: float | None  # as in `Score`
    probes: int
    simulated_s: float
    wall_s: float
    reason: str


class Score(msgspec.Struct, frozen=True):
    """One case, analysed."""

    suite: str
    name: str
    scenario: str
    mode: Mode
    seed: int | None  # of the scenario; None: its own
    expected_component: str
    component: str | None  # None: none was named
    component_success: bool
    message_success: bool
    message_distance_s: float | None  # [s] to the nearest altered message; None without one, or without an answer
    altered_share: float  # of the component's messages: guessing succeeds so often
    reduction_rate: float  # 1 - 1 / messages of the run; 0 where the message is wrong
    component_reduction_rate: float  # the same over the messages of the component alone
    probes: int
    simulated_s: float
    factual_wall_s: float
    attribution_wall_s: float
    violation: str | None  # kind of the one that was explained; None: there was none
    verdict: str
    reason: str
    is_proven: bool | None  # by runs of their own, of the definition of the reported message; None: not asked
    controls: Controls | None  # None: not run
    command: str  # that shows this case alone
    baselines: dict[str, BaselineScore] = {}  # by name; empty: not asked for


def scored(
    case: Case,
    found: Attribution,
    altered: tuple[int, ...],
    *,
    repeats: int | None,
    seed: int,
    walls: tuple[float, float],
    is_proven: bool | None,
    controls: Controls | None,
    baselines: dict[str, BaselineScore],
) -> Score:
    """Hold an attribution against the messages that the defect `altered`.

    Args:
        case: What was analysed.
        found: The answer.
        altered: Indices of the expected component's messages that the defect changed.
        repeats: Runs of each question in jitter mode; None: it was run in exact mode.
        seed: Of the scenario.
        walls: [s] of the factual run, of the attribution.
        is_proven: See `Score`.
        controls: What the control runs said.
        baselines: What others made of it.
    """
    record, component = found.record, case.component
    named = None if found.components is None else found.components.component
    is_right = named is component
    is_message_right = is_right and found.message is not None and found.message.index in altered
    counts = record.message_counts
    return msgspec.structs.replace(
        failed(case, repeats, seed, found.reason),
        component=None if named is None else named.value,
        component_success=is_right,
        message_success=is_message_right,
        message_distance_s=distance(record, found.message, altered) if is_right else None,
        altered_share=len(altered) / counts[component] if counts[component] else 0.0,
        reduction_rate=1.0 - 1.0 / sum(counts.values()) if is_message_right else 0.0,
        component_reduction_rate=1.0 - 1.0 / counts[component] if is_message_right else 0.0,
        probes=len(found.probes),
        simulated_s=sum(probe.simulated for probe in found.probes),
        factual_wall_s=walls[0],
        attribution_wall_s=walls[1],
        violation=None if found.violation is None else found.violation.kind,
        verdict=found.verdict.value,
        is_proven=is_proven,
        controls=controls,
        baselines=baselines,
    )


def failed(case: Case, repeats: int | None, seed: int | None, reason: str) -> Score:
    """The score of a case that could not be analysed: no success of any kind."""
    return Score(
        suite=case.suite,
        name=case.name,
        scenario=case.scenario,
        mode=mode_of(repeats),
        seed=seed,
        expected_component=case.component.value,
        component=None,
        component_success=False,
        message_success=False,
        message_distance_s=None,
        altered_share=0.0,
        reduction_rate=0.0,
        component_reduction_rate=0.0,
        probes=0,
        simulated_s=0.0,
        factual_wall_s=0.0,
        attribution_wall_s=0.0,
        violation=None,
        verdict=FAILED,
        reason=reason,
        is_proven=None,
        controls=None,
        command=case.command(seed, repeats),
    )


def mode_of(repeats: int | None) -> Mode:
    """The mode with so many runs of each question; None: without any repeats."""
    return "exact" if repeats is None else "jitter"


def distance(record: Record, message: MessageMark | None, altered: tuple[int, ...]) -> float | None:
    """[s] from a message to the nearest one of the same component that is `altered`; None without either."""
    if message is None or not altered:
        return None
    times = (record.mark(MessageId(message.component, index)).time for index in altered)
    return min(abs(time - message.time) for time in times)
