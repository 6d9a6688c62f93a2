"""Random faults: drawn from the whole library, kept when they cause a violation, then analysed.

Draw number k of a seed is the same fault on every machine, whatever was drawn before it and however
many run at once. The healthy drives are clean, so a violation with the fault is the fault's doing.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import TypeVar

import msgspec

from dvca_sumo.bench.benchmark import OnScore, question_key
from dvca_sumo.bench.cases import Case
from dvca_sumo.bench.places import HealthyDrive
from dvca_sumo.bench.runs import Setting, analysed
from dvca_sumo.bench.score import FAILED, Score
from dvca_sumo.geometry.randomness import key_of, uniforms
from dvca_sumo.interventions import FaultType, Parameter, fault_library
from dvca_sumo.interventions.targets import ALL, IN_WAY
from dvca_sumo.messages import COMPONENTS
from dvca_sumo.store import Store

Option = TypeVar("Option")

PATIENCE = 100  # draws in a row without a violation after which no more are made
_DECADES = 2.0  # of magnitudes below the end of a parameter's range
_SHORTEST = 0.3  # [s] of a window
_STREAM = key_of("random faults")
_DRAWS = 32  # more than one fault takes


class Drawing(msgspec.Struct, frozen=True):
    """Which faults, and how many of those that violate."""

    seed: int
    wanted: int


def drawn_case(seed: int, number: int, drives: Sequence[HealthyDrive]) -> Case:
    """Draw `number` of `seed`: a fault in one of the healthy `drives`, which may or may not do harm.

    Component, fault of that component, and drive are equally likely. Of several magnitudes each is drawn or
    left at its default; window and magnitude have logarithmically uniform sizes.
    """
    draws = iter(uniforms(seed, _STREAM, number, [0], _DRAWS)[0].tolist())
    drive = _pick(drives, next(draws))
    component = _pick(COMPONENTS, next(draws))
    name = _pick([name for name, entry in fault_library().items() if entry.component is component], next(draws))
    words = [*_window(drive.duration, draws), *_parameters(fault_library()[name], drive.objects, draws)]
    place = drive.place
    return Case(
        suite="random",
        name=f"{name}#{number}",
        scenario=place.scenario,
        component=component,
        fault=f"{name}:{','.join(words)}",
        ego=place.ego,
        begin=place.begin,
    )


def random_scores(
    drawing: Drawing,
    drives: Sequence[HealthyDrive],
    setting: Setting,
    jobs: int,
    store: Store[Score] | None,
    on_score: OnScore,
) -> tuple[list[Score], int]:
    """The scores of the first `drawing.wanted` draws that violate, in the order of drawing; and how many were drawn.

    They are fewer when `PATIENCE` draws in a row do no harm. What the store holds is not run again, and
    harmless draws are kept there as well. Of so many is told only when no earlier draw is open any more.
    """
    wanted = drawing.wanted
    answers: dict[int, Score] = {}
    begun: list[tuple[int, Case]] = []

    def take(number: int, score: Score, *, is_new: bool) -> None:
        answers[number] = score
        left = max(wanted - sum(map(is_violating, answers.values())), 0)
        if is_violating(score) and (left > 0 or _settled(answers, wanted)[1]):
            on_score(score, left, is_new)

    def cases() -> Iterator[Case]:
        for number in itertools.count():
            if sum(map(is_violating, answers.values())) >= wanted or _settled(answers, wanted)[1]:
                return
            case = drawn_case(drawing.seed, number, drives)
            known = store.find(question_key(case, setting)) if store else None
            if known is None:
                begun.append((number, case))
                yield case
            else:
                take(number, known, is_new=False)

    for row, score in analysed(cases(), setting, jobs):
        number, case = begun[row]
        if store is not None and score.verdict != FAILED:
            store.add(question_key(case, setting), score)
        take(number, score, is_new=True)
    settled, _ = _settled(answers, wanted)
    return [score for score in settled if is_violating(score)], len(settled)


def is_violating(score: Score) -> bool:
    """Whether a draw is a case: it violates by a message that the fault altered, or could not be run at all."""
    return score.verdict == FAILED or (score.violation is not None and score.altered_share > 0.0)


def _settled(answers: dict[int, Score], wanted: int) -> tuple[list[Score], bool]:
    """The answers of the first draws up to where drawing ends or one is still open; whether it ends there."""
    settled: list[Score] = []
    violating = idle = 0
    while violating < wanted and idle < PATIENCE:
        score = answers.get(len(settled))
        if score is None:
            return settled, False
        settled.append(score)
        violating += is_violating(score)
        idle = 0 if is_violating(score) else idle + 1
    return settled, True


def _window(duration: float, draws: Iterator[float]) -> list[str]:
    start = round(next(draws) * duration, 1)
    longest = max(duration - start, _SHORTEST)
    length = _SHORTEST * (longest / _SHORTEST) ** next(draws)
    return [f"start={start:g}", f"end={round(start + max(length, _SHORTEST), 1):g}"]


def _parameters(entry: FaultType, objects: Sequence[str], draws: Iterator[float]) -> list[str]:
    numbers = [name for name, parameter in entry.parameters.items() if parameter.kind == "number"]
    words = []
    for name, parameter in entry.parameters.items():
        if parameter.kind == "object":
            words.append(f"{name}={_object(objects, draws)}")
        elif not math.isinf(parameter.high) and (next(draws) < 0.5 or len(numbers) == 1):
            words.append(f"{name}={_magnitude(parameter, draws):g}")
    return words


def _object(objects: Sequence[str], draws: Iterator[float]) -> str:
    kind = next(draws)
    if kind < 0.5 or (kind < 0.75 and not objects):
        return IN_WAY
    return _pick(objects, next(draws)) if kind < 0.75 else ALL


def _magnitude(parameter: Parameter, draws: Iterator[float]) -> float:
    size = float(f"{parameter.high * 10.0 ** (_DECADES * (next(draws) - 1.0)):.3g}")
    return -size if next(draws) < 0.5 and parameter.low < 0.0 else size


def _pick(options: Sequence[Option], draw: float) -> Option:
    return options[int(draw * len(options))]
