"""Small SUMO scenarios written by tests, and how tests run them: libsumo only ever lives in child processes."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from dvca_sumo.engine.processes import Failure, isolated
from dvca_sumo.engine.replay import ReplayEngine
from dvca_sumo.interventions import Futures, Intervention
from dvca_sumo.record import Record
from dvca_sumo.run import StopRule, Task
from dvca_sumo.scenario import load_scenario
from dvca_sumo.stack.sources import StackSource

Answer = TypeVar("Answer")

TIMEOUT = 60.0  # [s] only ever reached by a defect
EGO = '<trip id="ego" from="bc" to="bc" depart="0" departPos="20" departSpeed="10" arrivalPos="60"/>'  # 4 s


def scenario_file(folder: Path, net: Path, routes: str = EGO, additional: str = "", **options: str) -> Path:
    """A sumocfg in `folder` with one route file, an additional file if there is one, and SUMO's `options`."""
    folder.mkdir(parents=True, exist_ok=True)
    values = {"net-file": str(net), "route-files": "routes.rou.xml"}
    (folder / "routes.rou.xml").write_text(f"<routes>{routes}</routes>", encoding="utf-8")
    if additional:
        (folder / "extra.add.xml").write_text(f"<additional>{additional}</additional>", encoding="utf-8")
        values["additional-files"] = "extra.add.xml"
    values |= {name.replace("__", ".").replace("_", "-"): value for name, value in options.items()}
    text = "".join(f'<{name} value="{value}"/>' for name, value in values.items())
    path = folder / "run.sumocfg"
    path.write_text(f"<configuration>{text}</configuration>", encoding="utf-8")
    return path


def in_child(job: Callable[[], Answer]) -> Answer:
    """What `job` returns, or raises, in a process of its own."""
    ((_, answer),) = isolated([job], 1, TIMEOUT)
    if isinstance(answer, Failure):
        raise answer.error or AssertionError(f"{answer.reason}\n{answer.said}")
    return answer


def driven(
    config: Path,
    *interventions: Intervention,
    stack: str | None = None,
    stop: StopRule = StopRule(),  # noqa: B008 - frozen
    ego: str | None = None,
    seed: int | None = None,
    jitter: int | None = None,
    futures: Futures = Futures(),  # noqa: B008 - frozen
) -> Record:
    """One run of the scenario at `config`."""
    scenario = load_scenario(config, ego, seed)
    engine = ReplayEngine(scenario.configuration.net, StackSource(stack), 1, TIMEOUT)
    return engine.record(Task(scenario, interventions, stop, futures, jitter))
