"""What is run: a user's SUMO configuration, its ego, and the settings a truthful run needs."""

import math
import os
from pathlib import Path

import msgspec

from dvca_sumo.scenario.configuration import Configuration, content_of, read_configuration, seconds
from dvca_sumo.scenario.departures import last_departure
from dvca_sumo.scenario.ego import AUTO, Definitions, find_ego
from dvca_sumo.scenario.errors import NoEgoError, ScenarioError
from dvca_sumo.scenario.parameters import MARK, Parameter
from dvca_sumo.scenario.silence import input_words, silenced

__all__ = [
    "AUTO",
    "MARK",
    "STEP_LENGTH",
    "Definitions",
    "NoEgoError",
    "Override",
    "Parameter",
    "Scenario",
    "ScenarioError",
    "content_of",
    "input_words",
    "last_departure",
    "load_scenario",
    "read_configuration",
    "silenced",
]

STEP_LENGTH = 0.1  # [s] of every run, whatever the sumocfg says

# Outputs of a file each step or vehicle: the name becomes part of theirs, so they go to the run's scratch folder.
_SEVERAL = {"vtk-output": "vtk", "elechybrid-output": "elechybrid"}
_SUMO_SEED = 23423  # SUMO's own default, so that a plain `sumo -c` shows the same traffic


class Override(msgspec.Struct, frozen=True):
    """A SUMO option that a run sets differently from the user's configuration."""

    option: str
    configured: str | None  # None: not set there
    used: str
    reason: str


class Scenario(msgspec.Struct, frozen=True):
    """One runnable scenario. Two equal scenarios give the same run, bit for bit."""

    configuration: Configuration
    ego: str  # vehicle id, or AUTO
    seed: int
    begin: float  # [s]
    end: float | None  # [s]; None: as long as the ego's trip may take
    overrides: tuple[Override, ...]

    @property
    def configured_end(self) -> float | None:
        """When the configuration ends the simulation [s]; None: it does not."""
        return _configured_end(self.configuration)

    @property
    def arguments(self) -> tuple[str, ...]:
        """SUMO's command line, but for its input files (see `input_words`)."""
        words = ["-c", str(self.configuration.path)]
        for override in self.overrides:
            words += [f"--{override.option}", override.used]
        return tuple(words)


def load_scenario(
    path: Path, ego: str | None = None, seed: int | None = None, begin: float | None = None, end: float | None = None
) -> Scenario:
    """Read a sumocfg and decide everything a run of it needs to know.

    Args:
        path: The user's SUMO configuration; nothing is ever written beside it.
        ego: Vehicle id, "auto", or None to look for a marked vehicle, then for the id "ego".
        seed: For SUMO's drivers and the ADS's sensors; None takes the configuration's.
        begin: [s] Start of the simulation; None takes the configuration's.
        end: [s] Latest end of the simulation; None takes the configuration's, if any.

    Raises:
        ScenarioError: The scenario cannot be run as given.
    """
    configuration = read_configuration(path)
    options = configuration.options
    chosen_seed = seed if seed is not None else _whole(options.get("seed", str(_SUMO_SEED)), "seed")
    chosen_begin = begin if begin is not None else seconds(options.get("begin", "0"), "begin")
    for name, value in (("begin", begin), ("end", end)):
        if value is not None and not (math.isfinite(value) and value >= 0.0):
            raise ScenarioError(f"{name} is no time: {value} (allowed: seconds, 0 or more)")
    chosen_end = end if end is not None else _configured_end(configuration)
    if chosen_end is not None and chosen_end <= chosen_begin:
        raise ScenarioError(f"the scenario ends at {chosen_end:g} s, not after its begin at {chosen_begin:g} s")
    return Scenario(
        configuration=configuration,
        ego=find_ego(configuration, ego),
        seed=chosen_seed,
        begin=chosen_begin,
        end=chosen_end,
        overrides=_overrides(configuration, chosen_seed, chosen_begin),
    )


def _configured_end(configuration: Configuration) -> float | None:
    options = configuration.options
    end = seconds(options["end"], "end") if "end" in options else -1.0
    return end if end > 0.0 else None


def _overrides(configuration: Configuration, seed: int, begin: float) -> tuple[Override, ...]:
    options = configuration.options
    wanted = [
        ("seed", str(seed), "explicit seed"),
        ("random", "false", "equal runs must repeat"),
        ("end", "-1", "the run ends with the ego's trip"),
        ("step-length", f"{STEP_LENGTH:g}", "world step"),
        ("collision.action", "warn", "colliding vehicles must not vanish"),
        ("collision.check-junctions", "true", "collisions on junctions count"),
        ("collision.mingap-factor", "0", "contact, not a small gap, is a collision"),
        ("threads", "1", "repeatable and forkable"),
        ("device.rerouting.threads", "0", "repeatable and forkable"),
        ("remote-port", "0", "a port makes SUMO wait for a client"),
        ("xml-validation", "never", "schemas may be out of reach"),
        ("xml-validation.net", "never", "schemas may be out of reach"),
        ("no-step-log", "true", "terminal"),
        ("duration-log.disable", "true", "terminal"),
        ("verbose", "false", "terminal"),
    ]
    seconds(options.get("step-length", "1"), "step-length")  # one that is no time is told, though another is used
    if "no-internal-links" in options:
        wanted.append(("no-internal-links", "false", "junctions are driven over, not jumped"))
    if begin != seconds(options.get("begin", "0"), "begin"):
        wanted.append(("begin", f"{begin:.12g}", "asked for"))
    outputs = {name: _SEVERAL.get(name, os.devnull) for name in configuration.outputs}
    wanted += [(name, used, "nothing is written for a run") for name, used in outputs.items()]
    never = {"save-state.times": "1e9", "save-state.period": "-1", "save-state.files": os.devnull}
    wanted += [(name, used, "nothing is written for a run") for name, used in never.items() if name in options]
    wanted += [
        (name, "", "files of the terminal-less run")
        for name in ("gui-settings-file", "output-prefix")
        if name in options
    ]
    return tuple(
        Override(option, options.get(option), used, reason)
        for option, used, reason in wanted
        if options.get(option) != used
    )


def _whole(text: str, option: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ScenarioError(f"option {option} is no whole number: {text!r}") from None
