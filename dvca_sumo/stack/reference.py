"""A stack: sensors and five components; and the reference one, assembled from its configuration."""

import importlib
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import msgspec

from dvca_sumo.messages import VehicleShape
from dvca_sumo.roadmap import RoadMap, Route
from dvca_sumo.stack.control import ControlConfig, TrackingController
from dvca_sumo.stack.localization import LocalizationConfig, LocalizationFilter
from dvca_sumo.stack.perception import PerceptionConfig, Tracker
from dvca_sumo.stack.planning import Planner, PlanningConfig
from dvca_sumo.stack.prediction import MapPrediction, PredictionConfig
from dvca_sumo.stack.protocols import Control, Localization, Perception, Planning, Prediction
from dvca_sumo.stack.sensors import SensorConfig, Sensors


class StackError(ValueError):
    """A stack cannot be built, or one of its components failed: which, where, and why."""


class StackContext(msgspec.Struct, frozen=True):
    """What a stack may know before the drive starts: its map, its trip, its body. No truth."""

    roadmap: RoadMap
    route: Route
    shape: VehicleShape
    seed: int


@dataclass(frozen=True)
class Stack:
    """The system under test."""

    sensors: Sensors
    sensor_range: float  # [m]
    localization: Localization
    perception: Perception
    prediction: Prediction
    planning: Planning
    control: Control


class StackConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Parameters of the reference stack, one table a component; a TOML file sets any of them."""

    sensors: SensorConfig = SensorConfig()
    localization: LocalizationConfig = LocalizationConfig()
    perception: PerceptionConfig = PerceptionConfig()
    prediction: PredictionConfig = PredictionConfig()
    planning: PlanningConfig = PlanningConfig()
    control: ControlConfig = ControlConfig()


StackFactory = Callable[[StackContext], Stack]


def reference_stack(context: StackContext, config: StackConfig = StackConfig()) -> Stack:  # noqa: B008 - frozen
    """The reference stack for one trip."""
    positions = {line.signal_id: line.position for line in context.route.stop_lines if line.signal_id is not None}
    return Stack(
        sensors=Sensors(config.sensors, context.seed, context.shape, positions),
        sensor_range=config.sensors.far_range,
        localization=LocalizationFilter(config.localization, context.shape),
        perception=Tracker(config.perception),
        prediction=MapPrediction(config.prediction, context.roadmap),
        planning=Planner(config.planning, context.route, context.shape),
        control=TrackingController(config.control, context.shape),
    )


def stack_factory(source: str | None) -> StackFactory:
    """The stack that `--stack` asks for: None (the reference), FILE.toml, or MODULE:FACTORY.

    A factory is called as `factory(context)` with a `StackContext` and returns a `Stack`.

    Raises:
        StackError: The file or factory cannot be read or imported, or holds something else.
    """
    if source is None:
        return reference_stack
    if source.endswith(".toml"):
        config = _config(Path(source))
        return lambda context: reference_stack(context, config)
    module_name, separator, name = source.partition(":")
    if not separator:
        raise StackError(f"no stack {source!r} (allowed: MODULE:FACTORY or FILE.toml)")
    if "" not in sys.path:
        sys.path.insert(0, "")  # a user's module lies where the command is typed
    try:
        factory = getattr(importlib.import_module(module_name), name)
    except Exception as error:  # noqa: BLE001 - a user's module may raise anything while it is imported
        raise StackError(f"stack factory {source!r} cannot be imported: {_said(error)}") from None
    if not callable(factory):
        raise StackError(f"stack factory {source!r} is not callable: {factory!r}")
    return built_checked(source, factory)


def built_checked(source: str, factory: StackFactory) -> StackFactory:
    """`factory`, whose failures and wrong results are named as its own."""

    def build(context: StackContext) -> Stack:
        try:
            stack = factory(context)
        except Exception as error:
            raise StackError(f"stack factory {source!r} raised {_said(error)}") from error
        if not isinstance(stack, Stack):
            raise StackError(f"stack factory {source!r} returned {type(stack).__name__}, not a Stack")
        return stack

    return build


def _config(path: Path) -> StackConfig:
    try:
        return msgspec.toml.decode(path.read_bytes(), type=StackConfig)
    except OSError as error:
        raise StackError(f"stack file {path} cannot be read: {error.strerror}") from None
    except (msgspec.ValidationError, msgspec.DecodeError, tomllib.TOMLDecodeError) as error:
        raise StackError(f"stack file {path}: {error}") from None


def _said(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
