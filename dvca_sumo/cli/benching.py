"""`dvca-sumo bench`: how often the analysis is right, where the truth is known."""

import json
import sys
import time
from pathlib import Path

import click

from dvca_sumo.api import CPUS
from dvca_sumo.bench.baselines import BASELINES, available_baselines
from dvca_sumo.bench.benchmark import run_benchmark
from dvca_sumo.bench.cases import WRITTEN
from dvca_sumo.bench.runs import Setting
from dvca_sumo.bench.score import Score
from dvca_sumo.bench.store import Store
from dvca_sumo.bench.tables import json_of, markdown_page, summaries, terminal_text
from dvca_sumo.cli.output import make_folder, tell, write_whole
from dvca_sumo.cli.running import REPEATS


class _Countdown:
    """Progress on standard error: each score, and about how long the rest will take."""

    def __init__(self) -> None:
        self._begin = time.perf_counter()
        self._done = 0

    def score(self, score: Score, left: int) -> None:
        """Hear of one more."""
        self._done += 1
        remaining = (time.perf_counter() - self._begin) / self._done * left
        said = "right" if score.component_success and score.message_success else "WRONG"
        tell(f"{score.name} ({score.mode}): {said}; {left} left, about {remaining:.0f} s")


@click.command()
@click.option("--suite", type=click.Choice([*WRITTEN, "all"]), default="all", show_default=True, help="Which cases.")
@click.option("--jitter", is_flag=True, help="In jitter mode as well, the paper's setting.")
@click.option("--repeats", type=click.IntRange(1), help=f"Runs of each question in jitter mode [default: {REPEATS}]")
@click.option("--baselines", is_flag=True, help="Beside ours: observation, whole runs, the paper's procedure, ddmin.")
@click.option("--jobs", type=click.IntRange(1), default=CPUS, show_default=True, help="Cases at once.")
@click.option("-o", "--output", type=click.Path(path_type=Path, file_okay=False), help="Results; to go on from there.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else.")
def bench(
    suite: str,
    jitter: bool,  # noqa: FBT001
    repeats: int | None,
    baselines: bool,  # noqa: FBT001
    jobs: int,
    output: Path | None,
    as_json: bool,  # noqa: FBT001
) -> None:
    r"""How often the analysis is right, where the truth is known: the paper's tables, beside the paper's figures.

    An interrupted benchmark goes on where it stopped when it is given the same folder again.

    \b
    Exit codes: 0 all checks hold; 1 some do not; 2 usage; 3 bad input; 70 internal error; 130 interrupted.
    """
    if repeats is not None and not jitter:
        raise click.UsageError("--repeats goes with --jitter: in exact mode every run is the same")
    if output is not None:
        make_folder(output)
    cases = [case for name, cases_of in WRITTEN.items() if suite in (name, "all") for case in cases_of()]
    beside = _beside() if baselines else ()
    settings = [Setting(repeats=count, baselines=beside) for count in (None, *([repeats or REPEATS] if jitter else []))]
    store = None if output is None else Store(output / "scores.jsonl")
    scores = run_benchmark(cases, settings, jobs, store, _Countdown().score)
    result = json.dumps(json_of(scores), indent=1)
    if output is not None:
        write_whole(output / "benchmark.md", markdown_page(scores))
        write_whole(output / "benchmark.json", result + "\n")
    click.echo(result if as_json else terminal_text(scores))
    sys.exit(0 if all(check.holds for one in summaries(scores) for check in one.checks) else 1)


def _beside() -> tuple[str, ...]:
    """Names of the baselines that can be run; tells of the others."""
    names = tuple(one.name for one in available_baselines())
    for name, baseline in BASELINES.items():
        if name not in names:
            tell(f"{baseline.title} is left out: picire is not installed (pip install 'dvca-sumo[test]')")
    return names
