"""A real SUMO world in a child process, in which the ego goes straight on, or stands, without any stack."""

import contextlib
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from small_scenarios import in_child

from dvca_sumo.messages import ControlCommand, PoseStep
from dvca_sumo.roadmap import RoadMap
from dvca_sumo.scenario import load_scenario
from dvca_sumo.truth import Moment
from dvca_sumo.world import Entry, VehicleLimits, World

STEP = 0.1  # [s]
STANDING = '<trip id="ego" from="bc" to="bc" depart="0" departPos="20" departSpeed="0" departLane="0"/>'


def entered(config: Path, ego: str | None = None, settings: tuple[str, ...] = ()) -> Entry:
    """How the ego of the scenario departs."""
    return in_child(lambda: _world(config, ego, settings)[1])


def watched(config: Path, steps: int, speed: float = 0.0, left: float = 0.0) -> list[Moment]:
    """What is seen around an ego that goes on at `speed`, and `left` of it, at its departure and after every step."""
    return in_child(lambda: watch(config, steps, speed, left))


def asked(config: Path, steps: int, question: Callable[[Any], Any], speed: float = 0.0, left: float = 0.0) -> Any:
    """What libsumo answers to `question(libsumo)` after so many steps of such an ego."""

    def job() -> Any:
        import libsumo  # noqa: PLC0415 one simulation a process: never in the tests' own

        watch(config, steps, speed, left)
        return question(libsumo)

    return in_child(job)


def objects_of(moment: Moment) -> dict[str, int]:
    """Row by id."""
    return {name: row for row, name in enumerate(moment.objects.ids)}


def _world(config: Path, ego: str | None, settings: tuple[str, ...]) -> tuple[World, Entry]:
    scenario = load_scenario(config, ego)
    with contextlib.chdir(tempfile.mkdtemp(dir=config.parent)):
        world = World(scenario, Path.cwd())
        return world, world.await_ego(settings, lambda _: True)


def watch(config: Path, steps: int, speed: float, left: float) -> list[Moment]:
    """`watched`, in this process."""
    world, entry = _world(config, None, ())
    roadmap = RoadMap.load(load_scenario(config).configuration.net, entry.vehicle_class)
    end = roadmap.lanes[f"{entry.edges[-1]}_0"].length
    ego = world.adopt(entry, roadmap.route(entry.edges, entry.lane, entry.position, None, end), VehicleLimits())
    moments = [world.observe(ego)]
    for _ in range(steps):
        ego.vehicle.advance(ControlCommand(world.time, 0.0, 0.0, PoseStep(speed * STEP, left * STEP, 0.0, 0.0)), STEP)
        world.advance()
        moments.append(world.observe(ego))
    return moments
