"""A stack: sensors and five components; and the reference one, assembled from its configuration."""

from collections.abc import Callable
from dataclasses import dataclass

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
