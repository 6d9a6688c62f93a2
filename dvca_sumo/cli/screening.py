"""`dvca-sumo screen`: how well the ADS drives a scenario's own trips, beside SUMO's drivers."""

import contextlib
import json
import os
import sys
import time
from pathlib import Path

import click

from dvca_sumo.api import CPUS, load_scenario
from dvca_sumo.cli.output import ExitCode, Folder, deliver, make_folder, tell
from dvca_sumo.scenario import AUTO
from dvca_sumo.screen.driving import Driven, Heard
from dvca_sumo.screen.screening import Progress, Setting, Stores, screened
from dvca_sumo.screen.tables import has_failed, has_gaps, json_of, terminal_text
from dvca_sumo.screen.trips import Draw
from dvca_sumo.stack.sources import StackSource
from dvca_sumo.store import Store

_PAUSE = 30.0  # [s] of wall time between two words of one simulation


class _Terminal(Progress):
    """Progress on standard error, from every simulation's own process too."""

    def __init__(self) -> None:
        self._descriptor = os.dup(2)  # a simulation's own standard error goes to its log

    def stage(self, what: str, simulations: int) -> None:
        self._begin, self._done = time.perf_counter(), 0
        tell(f"{what}: {simulations} simulation(s)")

    def over(self, left: int) -> None:
        self._done += 1
        remaining = (time.perf_counter() - self._begin) / self._done * left
        tell(f"simulation over; {left} left" + (f", about {remaining:.0f} s" if left else ""))

    def inside(self, number: int, begin: float, end: float, trips: int) -> Heard:
        started: float | None = None
        said = 0.0

        def hear(now: float, done: int) -> None:
            nonlocal started, said
            wall = time.perf_counter()
            if started is None:
                started = said = wall
            if wall - said >= _PAUSE:
                said = wall
                left = (wall - started) / max(now - begin, 1.0) * (end - now)
                hope = f"about {left:.0f} s left" if left > 0.0 else "held up"
                words = f"  simulation {number}: {now:.0f} s, {done} of {trips} trips over, {hope}\n"
                with contextlib.suppress(OSError):  # nobody listens any more
                    os.write(self._descriptor, words.encode())

        return hear


@click.command()
@click.argument("sumocfg", type=click.Path(path_type=Path))
@click.option("--egos", type=click.IntRange(1), default=20, show_default=True, help="Trips to drive.")
@click.option("--concurrent", type=click.IntRange(1), default=10, show_default=True, help="Egos in one simulation.")
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), help="For the draw, SUMO's drivers and the ADS's sensors.")
@click.option("--stack", metavar="MODULE:FACTORY|FILE.toml", help="Your own stack, or parameters of the reference one.")
@click.option("--begin", type=float, metavar="T", help="Start of the simulation [s].")
@click.option("--end", type=float, metavar="T", help="Trips are to be over by then, if they are not held up [s].")
@click.option("--jobs", type=click.IntRange(1), default=CPUS, show_default=True, help="Simulations at once.")
@click.option("-o", "--output", type=Folder(), help="Results; to go on from there.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON, and nothing else.")
def screen(
    sumocfg: Path,
    egos: int,
    concurrent: int,
    seed: int | None,
    stack: str | None,
    begin: float | None,
    end: float | None,
    jobs: int,
    output: Path | None,
    as_json: bool,  # noqa: FBT001
) -> None:
    """Drive trips of a scenario's own traffic with the ADS, and the same trips with SUMO's drivers.

    A trip is drivable when its vehicle is a car (7 m at most), its route is 300 m or longer (100 m, where there are too
    few) and can be driven, and SUMO's own driver is over it before the end, and well before an ego's patience is; stops
    on the way are made by nobody who drives it.
    An interrupted screening goes on where it stopped when it is given the same folder again; of a stack of your own,
    while its Python files are the same. Of a part of the trips nothing is printed.

    \b
    Exit codes: 0 nothing violated by the ADS's own doing; 1 something was; 2 usage; 3 bad input;
    4 nothing was, but trips could not be driven, or not to their end, or an oracle could not tell;
    70 internal error; 130 interrupted.
    """  # noqa: D301 - click wants the very character, not its escape
    if output is not None:
        make_folder(output)
    setting = Setting.of_window(load_scenario(sumocfg, AUTO, seed, begin, end), egos, concurrent, StackSource(stack))
    stores = Stores()
    if output is not None:
        stores = Stores(Store(output / "draws.jsonl", Draw), Store(output / "simulations.jsonl", Driven))
    try:
        screening = screened(setting, jobs, stores, _Terminal())
    except KeyboardInterrupt:  # the rates of whichever trips are over would mislead
        if output is None:
            tell("nothing is kept of what was simulated; with -o FOLDER it is, to go on from there")
        else:
            tell(f"simulations that are over are kept in {output}: the same command goes on from there")
        raise
    result, text = json.dumps(json_of(screening), indent=1), terminal_text(screening)
    files = {}
    if output is not None:
        files = {output / "screening.json": result + "\n", output / "screening.txt": text + "\n"}
    deliver(result if as_json else text, files)
    if has_failed(screening):
        sys.exit(ExitCode.ATTRIBUTED)
    sys.exit(ExitCode.UNRESOLVED if has_gaps(screening) else ExitCode.NO_VIOLATION)
