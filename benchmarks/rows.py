"""A table of nets, each of them screened: one line a net."""

import argparse
import json
import subprocess
import sys
from pathlib import Path

HEADER = "net                       completed  collisions  violations  travel time (median)  SUMO's driver: violations"
_SCREEN = "from dvca_sumo.cli import main; main()"


def arguments(nets: list[str], egos: int) -> argparse.Namespace:
    """What is asked for: a folder to build in, some of the `nets` or all, so many `egos` each, a seed, jobs."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--nets", default=",".join(nets))
    parser.add_argument("--egos", default=str(egos))
    parser.add_argument("--seed", default="1")
    parser.add_argument("--jobs", default="1")
    return parser.parse_args()


def run(program: str, options: list[str], folder: Path) -> None:
    """Run one of SUMO's own programs in a folder."""
    subprocess.run([program, *options], cwd=folder, check=True, capture_output=True)  # noqa: S603


def row(name: str, config: Path, asked: argparse.Namespace, *window: str) -> str:
    """Screen a net, with further options of `dvca-sumo screen`; all of it stands in the folder `out` beside it."""
    words = ["screen", str(config), "--egos", asked.egos, "--seed", asked.seed, "--jobs", asked.jobs, *window]
    words += ["-o", str(config.parent / "out"), "--json"]
    done = subprocess.run([sys.executable, "-c", _SCREEN, *words], check=False, capture_output=True, text=True)  # noqa: S603
    if not done.stdout:
        raise SystemExit(done.stderr)
    found = json.loads(done.stdout)
    ads, theirs = found["ads"], found["sumo_driver"]
    completed = f"{ads['completed']['count']}/{ads['completed']['total']}"
    return (
        f"{name:<24}{completed:>11}{ads['at_fault_collisions']:>12}{ads['at_fault_violations']:>12}"
        f"{ads['travel_time_ratio']['median']:>22.2f}{theirs['at_fault_violations']:>27}"
    )
