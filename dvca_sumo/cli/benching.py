"""`dvca-sumo bench`: how often the analysis is right, where the truth is known."""

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import click
import msgspec

from dvca_sumo.api import CPUS, REPEATS
from dvca_sumo.bench.baselines import BASELINES, available_baselines
from dvca_sumo.bench.benchmark import run_benchmark
from dvca_sumo.bench.cases import WRITTEN
from dvca_sumo.bench.places import BUILT_IN, HealthyDrive, Place, healthy_drives, places_of
from dvca_sumo.bench.random_faults import PATIENCE, Drawing, random_scores
from dvca_sumo.bench.runs import Setting
from dvca_sumo.bench.score import Score
from dvca_sumo.bench.tables import Gap, json_of, markdown_page, summaries, terminal_text
from dvca_sumo.cli.output import Folder, deliver, make_folder, tell
from dvca_sumo.store import Store


class _Countdown:
    """Progress on standard error: each new score, and about how long the rest will take."""

    def __init__(self) -> None:
        self._begin = time.perf_counter()
        self._new = 0
        self.heard: list[Score] = []

    def score(self, score: Score, left: int, is_new: bool) -> None:  # noqa: FBT001 - as its callers call it
        """Hear of one more."""
        self.heard.append(score)
        if not is_new:
            return
        self._new += 1
        remaining = (time.perf_counter() - self._begin) / self._new * left
        said = "right" if score.component_success and score.message_success else "WRONG"
        tell(f"{score.name} ({score.mode}): {said}; {left} left, about {remaining:.0f} s")


@click.command()
@click.argument("sumocfg", type=click.Path(path_type=Path), required=False)
@click.option("--suite", type=click.Choice([*WRITTEN, "all"]), help="Which of the written cases [default: all]")
@click.option("--random", "wanted", type=click.IntRange(1), metavar="N", help="N random faults that violate, instead.")
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), help="Of the random faults [default: 1]")
@click.option("--ego", metavar="ID|auto", help="The ego of SUMOCFG; see `run`.")
@click.option("--begin", type=float, metavar="T", help="Start of the simulation of SUMOCFG [s].")
@click.option("--jitter", is_flag=True, help="In jitter mode as well, the paper's setting.")
@click.option("--repeats", type=click.IntRange(1), help=f"Runs of each question in jitter mode [default: {REPEATS}]")
@click.option("--baselines", is_flag=True, help="Beside ours: observation, whole runs, the paper's procedure, ddmin.")
@click.option("--jobs", type=click.IntRange(1), default=CPUS, show_default=True, help="Cases at once.")
@click.option("-o", "--output", type=Folder(), help="Results; to go on from there.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else.")
def bench(
    sumocfg: Path | None,
    suite: str | None,
    wanted: int | None,
    seed: int | None,
    ego: str | None,
    begin: float | None,
    jitter: bool,  # noqa: FBT001
    repeats: int | None,
    baselines: bool,  # noqa: FBT001
    jobs: int,
    output: Path | None,
    as_json: bool,  # noqa: FBT001
) -> None:
    """How often the analysis is right, where the truth is known: the paper's tables, beside the paper's figures.

    With --random: the same on faults drawn at random, on the built-in scenarios or on any SUMOCFG, in drives that
    are clean without the fault. Where neither --ego nor the scenario names an ego, nor --begin a time, several are
    picked at times spread over its traffic.

    An interrupted benchmark goes on where it stopped when it is given the same folder again.

    \b
    Exit codes: 0 all checks hold; 1 some do not, or too few random faults violate; 2 usage; 3 bad input;
    70 internal error; 130 interrupted.
    """  # noqa: D301 - click wants the very character, not its escape
    if repeats is not None and not jitter:
        raise click.UsageError("--repeats goes with --jitter: in exact mode every run is the same")
    if wanted is None and (sumocfg, seed, ego, begin) != (None,) * 4:
        raise click.UsageError("SUMOCFG, --seed, --ego and --begin go with --random: the written cases have their own")
    if wanted is not None and suite is not None:
        raise click.UsageError("--suite is of written cases: it does not go with --random")
    if sumocfg is None and (ego, begin) != (None, None):
        raise click.UsageError("--ego and --begin go with a SUMOCFG: the built-in scenarios have their own")
    if output is not None:
        make_folder(output)
    settings = [Setting(has_controls=wanted is None, baselines=_beside() if baselines else ())]
    settings += [msgspec.structs.replace(settings[0], repeats=repeats or REPEATS)] if jitter else []
    store = None if output is None else Store(output / "scores.jsonl", Score)
    countdown = _Countdown()
    cases = [case for name, cases_of in WRITTEN.items() if suite in (None, name, "all") for case in cases_of()]
    asked = (len(cases) if wanted is None else wanted) * len(settings)
    scores: list[Score] = []
    try:
        if wanted is None:
            scores = run_benchmark(cases, settings, jobs, store, countdown.score)
        else:
            places = BUILT_IN if sumocfg is None else places_of(sumocfg, ego, begin)
            drives = None if output is None else Store(output / "healthy.jsonl", HealthyDrive)
            drawing = Drawing(1 if seed is None else seed, wanted)
            stores = (store, drives)
            for each in settings:
                scores += _random_scores(drawing, places, each, jobs, stores, countdown)
                countdown.heard.clear()
    except KeyboardInterrupt:
        scores += countdown.heard
        if scores:
            _publish(scores, Gap(asked - len(scores), "interrupted"), output, as_json=as_json)
        raise
    gap = _too_few(len(scores), asked) if wanted is not None else None
    _publish(scores, gap, output, as_json=as_json)
    sys.exit(0 if gap is None and all(check.holds for one in summaries(scores) for check in one.checks) else 1)


def _too_few(found: int, asked: int) -> Gap | None:
    reason = f"drawing stopped where none of the last {PATIENCE} faults violated"
    return Gap(asked - found, reason) if found < asked else None


def _publish(scores: Sequence[Score], gap: Gap | None, output: Path | None, *, as_json: bool) -> None:
    result = json.dumps(json_of(scores, gap), indent=1)
    files = {}
    if output is not None:
        files = {output / "benchmark.md": markdown_page(scores, gap), output / "benchmark.json": result + "\n"}
    deliver(result if as_json else terminal_text(scores, gap), files)
    if gap is not None:
        tell(gap.told(scores))


def _random_scores(
    drawing: Drawing,
    places: Sequence[Place],
    setting: Setting,
    jobs: int,
    stores: tuple[Store[Score] | None, Store[HealthyDrive] | None],
    countdown: _Countdown,
) -> list[Score]:
    store, drives = stores
    healthy = healthy_drives(places, setting, jobs, drives)
    for drive in healthy:
        if drive.complaint:
            tell(f"left out, not clean without a fault: {drive.place}: {drive.complaint}")
    clean = [drive for drive in healthy if not drive.complaint]
    tell(f"{len(clean)} clean drive(s) to plant faults in ({setting.mode} mode)")
    scores, drawn = random_scores(drawing, clean, setting, jobs, store, countdown.score)
    tell(f"{len(scores)} of {drawn} drawn faults violate")
    return scores


def _beside() -> tuple[str, ...]:
    """Names of the baselines that can be run; tells of the others."""
    names = tuple(one.name for one in available_baselines())
    for name, baseline in BASELINES.items():
        if name not in names:
            tell(f"{baseline.title} is left out: picire is not installed (pip install 'dvca-sumo[test]')")
    return names
