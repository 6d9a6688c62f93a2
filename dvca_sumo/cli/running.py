"""`dvca-sumo run`: one scenario, its violation explained."""

import json
import sys
import time
from pathlib import Path

import click

from dvca_sumo import api
from dvca_sumo.analysis.attribution import Attribution, AttributionStoppedError, Progress
from dvca_sumo.analysis.components import Verdict
from dvca_sumo.analysis.dtest import Probe
from dvca_sumo.api import CPUS, REPEATS, FactualDrive, load_scenario
from dvca_sumo.cli.output import ExitCode, Folder, deliver, make_folder, tell
from dvca_sumo.record import Record
from dvca_sumo.report.result import Timing, result_of
from dvca_sumo.report.terminal import verdict_text
from dvca_sumo.stack.sources import StackSource

PARTIAL = "result.partial.json"  # of an interrupted analysis


class _Terminal(Progress):
    """Progress on standard error."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._begin = time.perf_counter()
        self._factual_wall = 0.0

    def factual(self, record: Record) -> None:
        self._factual_wall = time.perf_counter() - self._begin
        said = f"{len(record.violations)} violation(s)" if record.violations else "no violation"
        tell(f"factual run: {said}, {self._factual_wall:.1f} s")

    def probe(self, probe: Probe) -> None:
        ideal = "+".join(component.value for component in probe.question.ideal) or "nothing (the premise)"
        since = f" from #{probe.question.since.index}" if probe.question.since is not None else ""
        tell(f"probe {probe.id}: ideal {ideal}{since}: {probe.outcome.value}, {probe.wall:.1f} s")

    def timing(self, engine: str) -> Timing:
        """What it cost up to now."""
        attribution = time.perf_counter() - self._begin - self._factual_wall
        return Timing(self._factual_wall, attribution, engine, self._jobs)


@click.command()
@click.argument("sumocfg", type=click.Path(path_type=Path))
@click.option("--fault", "faults", multiple=True, metavar="NAME[:key=value,...]", help="Plant a fault; see `faults`.")
@click.option("--bug", metavar="NAME", help="A real bug for the reference stack to have; see `faults`.")
@click.option("--ego", metavar="ID|auto", help="The ego's vehicle id, or auto; see above.")
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), help="For SUMO's drivers and the ADS's sensors.")
@click.option("--stack", metavar="MODULE:FACTORY|FILE.toml", help="Your own stack, or parameters of the reference one.")
@click.option("--engine", type=click.Choice(list(api.ENGINES)), default=api.DEFAULT_ENGINE, show_default=True)
@click.option("--jobs", type=click.IntRange(1), default=CPUS, show_default=True, help="Runs at once.")
@click.option("--jitter", is_flag=True, help="Draw schedule and sensor noise anew for each run; majority of repeats.")
@click.option("--repeats", type=click.IntRange(1), help=f"Runs of each question in jitter mode [default: {REPEATS}]")
@click.option("--certify", is_flag=True, help="Ask the conclusion once more of the replay engine, from time 0.")
@click.option("--begin", type=float, metavar="T", help="Start of the simulation [s].")
@click.option("--end", type=float, metavar="T", help="Latest end of the simulation [s].")
@click.option("-o", "--output", type=Folder(), help=f"Folder for result.json; {PARTIAL} when interrupted.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else.")
def run(
    sumocfg: Path,
    faults: tuple[str, ...],
    bug: str | None,
    ego: str | None,
    seed: int | None,
    stack: str | None,
    engine: str,
    jobs: int,
    jitter: bool,  # noqa: FBT001
    repeats: int | None,
    certify: bool,  # noqa: FBT001
    begin: float | None,
    end: float | None,
    output: Path | None,
    as_json: bool,  # noqa: FBT001
) -> None:
    """Run a scenario; if a violation occurs, find the component and the message that caused it.

    SUMOCFG is any SUMO configuration. The ego is --ego, or the vehicle with the parameter
    dvca.ego=true, or the vehicle with the id "ego"; with --ego auto it is the first car that
    departs 60 s after the begin or later, to meet traffic, on a drivable trip of 500 m or more.
    Nothing is written beside the configuration.

    \b
    Exit codes: 0 no violation; 1 violation, attributed; 2 usage; 3 bad input;
    4 violation, but unresolved or not reproducible, or an oracle could not tell;
    70 internal error; 130 interrupted.
    """  # noqa: D301 - click wants the very character, not its escape
    if repeats is not None and not jitter:
        raise click.UsageError("--repeats goes with --jitter: in exact mode every run is the same")
    if bug is not None and not StackSource(stack).is_reference:
        raise click.UsageError("--bug is a switch of the reference stack: it does not go with --stack MODULE:FACTORY")
    if output is not None:
        make_folder(output)
    terminal = _Terminal(jobs)
    scenario = load_scenario(sumocfg, ego, seed, begin, end)
    drive = api.drive(scenario, faults, stack, (repeats or REPEATS) if jitter else None, jobs, engine, bug)
    try:
        found, is_whole = _attributed(drive, terminal, certify=certify), True
    except AttributionStoppedError as stopped:
        found, is_whole = stopped.partial, False
    except KeyboardInterrupt:  # before the first question
        found, is_whole = api.unattributed(drive), False
    _publish(drive, found, terminal.timing(drive.engine.name), output, as_json=as_json, is_whole=is_whole)
    if not is_whole:
        raise KeyboardInterrupt
    sys.exit(_exit_code(found))


def _attributed(drive: FactualDrive, terminal: _Terminal, *, certify: bool) -> Attribution:
    terminal.factual(drive.record)
    if drive.engine.fallback is not None:
        tell(f"engine {drive.engine.name}: {drive.engine.fallback}")
    return api.attribute(drive, terminal, certify=certify)


def _publish(
    drive: FactualDrive, found: Attribution, timing: Timing, output: Path | None, *, as_json: bool, is_whole: bool
) -> None:
    """Print it, and write it into its file; half an answer replaces no whole one of before."""
    result = json.dumps(result_of(drive.request, drive.source, found, timing), indent=1)
    text = result if as_json else verdict_text(found, timing, drive.source.bug)
    name = "result.json" if is_whole else PARTIAL
    deliver(text, {} if output is None else {output / name: result + "\n"})
    if output is not None and is_whole:
        (output / PARTIAL).unlink(missing_ok=True)


def _exit_code(found: Attribution) -> ExitCode:
    if found.verdict is Verdict.NONE:
        return ExitCode.NO_VIOLATION
    return ExitCode.ATTRIBUTED if found.verdict in (Verdict.COMPONENT, Verdict.PLANNING) else ExitCode.UNRESOLVED
