"""A table of nets, each of them screened: one line a net."""

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

Net = TypeVar("Net")

_HEADER = "net                       completed  collisions  violations  travel time (median)  SUMO's driver: violations"


def table(nets: Mapping[str, Net], built: Callable[[Path, Net], Path], egos: int, *window: str) -> None:
    """Print it, of those nets that are asked for, each `built` in a folder of its own."""
    asked = _arguments(list(nets), egos)
    print(_HEADER)
    for name in asked.nets.split(","):
        print(_row(name, built(asked.folder / name, nets[name]), asked, *window), flush=True)


def configured(folder: Path, further: str, **files: str) -> Path:
    """The configuration of the net in a folder, with its other input `files` by kind, and `further` options."""
    others = "".join(f'<{kind}-files value="{names}"/>' for kind, names in files.items())
    config = folder / "run.sumocfg"
    config.write_text(f'<configuration><input><net-file value="net.net.xml"/>{others}</input>{further}</configuration>')
    return config


def _arguments(nets: list[str], egos: int) -> argparse.Namespace:
    """What is asked for: a folder to build in, some of the `nets` or all, so many `egos` each, a seed, jobs."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=Path)
    parser.add_argument("--nets", default=",".join(nets))
    parser.add_argument("--egos", default=str(egos))
    parser.add_argument("--seed", default="1")
    parser.add_argument("--jobs", default="1")
    asked = parser.parse_args()
    for name in asked.nets.split(","):
        if name not in nets:
            parser.error(f"no net {name!r} (allowed: {', '.join(nets)})")
    return asked


def run(program: str, options: list[str], folder: Path) -> None:
    """Run one of SUMO's own programs in a folder."""
    subprocess.run([program, *options], cwd=folder, check=True, capture_output=True)  # noqa: S603


def _row(name: str, config: Path, asked: argparse.Namespace, *window: str) -> str:
    """Screen a net, with further options of `dvca-sumo screen`; all of it stands in the folder `out` beside it."""
    words = ["screen", str(config), "--egos", asked.egos, "--seed", asked.seed, "--jobs", asked.jobs, *window]
    words += ["-o", str(config.parent / "out"), "--json"]
    done = subprocess.run([sys.executable, "-m", "dvca_sumo", *words], check=False, capture_output=True, text=True)  # noqa: S603
    if not done.stdout:
        raise SystemExit(done.stderr)
    found = json.loads(done.stdout)
    ads, theirs = found["ads"], found["sumo_driver"]
    completed = f"{ads['completed']['count']}/{ads['completed']['total']}"
    return (
        f"{name:<24}{completed:>11}{ads['at_fault_collisions']:>12}{ads['at_fault_violations']:>12}"
        f"{ads['travel_time_ratio']['median']:>22.2f}{theirs['at_fault_violations']:>27}"
    )
