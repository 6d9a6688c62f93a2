"""The localization filter against the true drive, dead reckoning, outliers and missing fixes."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.messages import Floats, LocalizationEstimate, VehicleShape
from dvca_sumo.stack.localization import LocalizationConfig, LocalizationFilter
from dvca_sumo.stack.protocols import GnssFix, OdometryReading
from dvca_sumo.stack.sensors import SensorConfig, Sensors
from dvca_sumo.truth import EgoTruth

SHAPE = VehicleShape(length=4.7, width=1.9, wheelbase=2.8, rear_overhang=0.95)
UNBIASED = SensorConfig(gnss_bias_bound=0.0)

FixRule = Callable[[int, GnssFix], GnssFix | None]


class Drive(NamedTuple):
    """Errors of the estimates of one drive, 100 Hz."""

    positions: Floats  # [m]
    headings: Floats  # [rad]
    speeds: Floats  # [m/s]
    last: LocalizationEstimate


def truth(seconds: float, speed: float) -> list[EgoTruth]:
    """10 s straight on, then curves to both sides, with the speed swinging by a quarter; at rest if speed is 0."""
    x = y = heading = 0.0
    moments = []
    for step in range(round(seconds * 100)):
        time = step * 0.01
        v = speed * (1.0 + 0.25 * math.sin(time / 5.0))
        a = speed * 0.05 * math.cos(time / 5.0)
        yaw_rate = 0.02 * speed * math.sin((time - 10.0) / 3.0) if time > 10.0 else 0.0
        moments.append(EgoTruth(time, x, y, heading, v, a, yaw_rate, 0.0))
        way, direction = (v + 0.005 * a) * 0.01, heading + 0.005 * yaw_rate
        x += way * math.cos(direction)
        y += way * math.sin(direction)
        heading = wrapped(heading + 0.01 * yaw_rate)
    return moments


def as_it_comes(_: int, fix: GnssFix) -> GnssFix:
    return fix


def driven(
    seed: int,
    rule: FixRule = as_it_comes,
    *,
    config: SensorConfig = UNBIASED,
    seconds: float = 40.0,
    speed: float = 12.0,
    settled: float = 5.0,
) -> Drive:
    sensors = Sensors(config, seed, SHAPE, {})
    localization = LocalizationFilter(LocalizationConfig(), SHAPE)
    errors = []
    for index, ego in enumerate(truth(seconds, speed)):
        fix = rule(index // 10, sensors.fix(ego, index // 10)) if index % 10 == 0 else None
        believed = localization.step(sensors.odometry(ego, index), fix)
        if ego.time >= settled:
            gap = math.hypot(believed.x - ego.x, believed.y - ego.y)
            errors.append((gap, wrapped(believed.heading - ego.heading), believed.speed - ego.speed))
    positions, headings, speeds = np.array(errors).T
    return Drive(positions, headings, speeds, believed)


def rms(errors: Floats) -> float:
    return float(np.sqrt(np.mean(errors**2)))


@pytest.mark.parametrize("seed", range(3))
def test_straight_and_curves_are_followed_within_the_stated_accuracy(seed: int) -> None:
    drive = driven(seed)
    assert rms(drive.positions) < 0.12
    assert drive.positions.max() < 0.3
    assert rms(drive.headings) < 0.005
    assert rms(drive.speeds) < 0.05


def test_a_satellite_bias_adds_no_more_than_itself() -> None:
    assert driven(4, config=SensorConfig()).positions.max() < 0.2 + 0.3


def test_dead_reckoning_drifts_where_the_filter_does_not() -> None:
    only_first: FixRule = lambda number, fix: fix if number == 0 else None  # noqa: E731
    alone, fused = driven(1, only_first), driven(1)
    assert alone.positions[-1] > 1.0
    assert alone.positions[-1] > 10.0 * rms(fused.positions)
    assert abs(alone.headings[-1]) > 2.0 * rms(fused.headings)


def test_without_any_fix_the_pose_is_unknown_but_the_speed_is_not() -> None:
    never: FixRule = lambda _number, _fix: None  # noqa: E731
    drive = driven(1, never, seconds=1.0, settled=0.0)
    assert math.isnan(drive.last.x)
    assert math.isnan(drive.last.y)
    assert math.isnan(drive.last.heading)
    assert np.abs(drive.speeds).max() < 0.5


def test_the_first_fix_is_taken_as_it_is_even_when_it_comes_late() -> None:
    localization = LocalizationFilter(LocalizationConfig(), SHAPE)
    assert math.isnan(localization.step(OdometryReading(0.0, 5.0, 0.0, 0.0), None).x)
    started = localization.step(OdometryReading(0.01, 5.0, 0.0, 0.0), GnssFix(7.0, 8.0, 1.5))
    assert (started.time, started.x, started.y, started.heading) == (0.01, 7.0, 8.0, 1.5)
    moved = localization.step(OdometryReading(0.02, 5.0, 0.0, 0.0), None)
    assert math.hypot(moved.x - 7.0, moved.y - 8.0) == pytest.approx(0.05)


def test_one_outlier_is_refused() -> None:
    thrown: FixRule = lambda number, fix: GnssFix(fix.x + 4.0, fix.y, fix.heading) if number == 200 else fix  # noqa: E731
    assert driven(2, thrown).positions.max() < 0.3


def test_a_fix_that_is_only_a_little_off_is_believed() -> None:
    shifted: FixRule = lambda number, fix: GnssFix(fix.x, fix.y + 0.3, fix.heading) if number > 100 else fix  # noqa: E731
    assert driven(2, shifted).positions[-1] == pytest.approx(0.3, abs=0.25)


def test_fixes_that_stay_far_off_win_in_the_end() -> None:
    moved: FixRule = lambda number, fix: GnssFix(fix.x, fix.y + 50.0, fix.heading) if number >= 100 else fix  # noqa: E731
    before = driven(2, moved, seconds=10.8)
    after = driven(2, moved, seconds=20.0)
    assert before.positions[-1] < 0.5
    assert after.positions[-1] == pytest.approx(50.0, abs=0.5)


def test_a_lost_receiver_is_bridged_and_caught_again() -> None:
    gap: FixRule = lambda number, fix: None if 200 <= number < 250 else fix  # noqa: E731
    drive = driven(3, gap)
    assert drive.positions.max() < 0.8
    assert drive.positions[-500:].max() < 0.3


def test_a_standing_ego_stands() -> None:
    drive = driven(1, seconds=20.0, speed=0.0)
    assert np.abs(drive.speeds).max() == 0.0
    assert drive.last.yaw_rate == 0.0
    assert drive.positions.max() < 0.25
    assert np.abs(drive.headings).max() < 0.01


def test_the_same_readings_give_the_same_estimate() -> None:
    assert driven(6, seconds=6.0).last == driven(6, seconds=6.0).last
