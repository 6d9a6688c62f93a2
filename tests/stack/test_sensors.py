"""What the sensors report, what they do not, and that each draw stands alone."""

import math

import msgspec
import numpy as np
import numpy.testing as npt
import pytest
import shapely

from dvca_sumo.geometry.boxes import corners
from dvca_sumo.messages import ObjectClass, SignalColour, VehicleShape
from dvca_sumo.stack.protocols import Detections
from dvca_sumo.stack.sensors import SensorConfig, Sensors
from dvca_sumo.stack.visibility import are_hidden, nearest_distances, visible_shares
from dvca_sumo.truth import EgoTruth, Moment, ObjectsTruth

SHAPE = VehicleShape(length=4.7, width=1.9, wheelbase=2.8, rear_overhang=0.95)
NEVER_MISSING = SensorConfig(miss_near=0.0, miss_far=0.0, signal_miss=0.0)
NOISELESS = SensorConfig(
    miss_near=0.0,
    miss_far=0.0,
    confusion_far=0.0,
    signal_miss=0.0,
    position_sigma=0.0,
    position_sigma_per_metre=0.0,
    size_sigma=0.0,
    corner_sigma=0.0,
    radial_speed_sigma=0.0,
)

# What makes no sense, and what is said to be allowed.
SENSELESS: list[tuple[str, float, str]] = [
    ("far_range", -5.0, "0.1 to 150"),
    ("range", 0.0, "0.1 to 150"),
    ("field_of_view", -0.1, "0 to 6.2832"),
    ("far_field_of_view", 360.0, "0 to 6.2832"),
    ("visible_share", 1.5, "0 to 1"),
    ("miss_far", 15.0, "0 to 1"),
    ("signal_miss", math.nan, "0 to 1"),
    ("position_sigma", -0.05, "0 or more"),
    ("radial_speed_sigma", math.inf, "0 or more"),
    ("gnss_bias_fixes", 0, "1 or more"),
    ("heading_sigma_limit", 0.0, "0.001 or more"),
]

HERE = shapely.Point(0.0, 0.0)

Thing = tuple[ObjectClass, float, float, float, float, float]  # class, x, y, heading, vx, vy

SIZES = {
    ObjectClass.VEHICLE: (4.6, 1.8),
    ObjectClass.BICYCLE: (1.8, 0.6),
    ObjectClass.PEDESTRIAN: (0.5, 0.5),
    ObjectClass.STATIC: (0.4, 0.4),
}


def car(x: float, y: float, speed: float = 0.0) -> Thing:
    return (ObjectClass.VEHICLE, x, y, 0.0, speed, 0.0)


def pedestrian(x: float, y: float) -> Thing:
    return (ObjectClass.PEDESTRIAN, x, y, 0.0, 0.0, 0.0)


def cone(x: float, y: float) -> Thing:
    return (ObjectClass.STATIC, x, y, 0.0, 0.0, 0.0)


def ego_at(x: float = 0.0, y: float = 0.0, heading: float = 0.0, speed: float = 0.0) -> EgoTruth:
    return EgoTruth(time=0.0, x=x, y=y, heading=heading, speed=speed, acceleration=0.0, yaw_rate=0.0, steering=0.0)


def moment_of(
    things: dict[str, Thing], ego: EgoTruth | None = None, signals: dict[str, SignalColour] | None = None
) -> Moment:
    rows = [(x, y, heading, *SIZES[kind]) for kind, x, y, heading, _, _ in things.values()]
    objects = ObjectsTruth(
        time=0.0,
        ids=tuple(things),
        classes=np.array([thing[0] for thing in things.values()], dtype=np.int64),
        boxes=np.array(rows, dtype=np.float64).reshape(-1, 5),
        velocities=np.array([thing[4:] for thing in things.values()], dtype=np.float64).reshape(-1, 2),
    )
    return Moment(ego=ego or ego_at(), shape=SHAPE, objects=objects, signals=signals or {})


def sensed(moment: Moment, config: SensorConfig = NOISELESS, seed: int = 1, index: int = 0) -> Detections:
    return Sensors(config, seed, SHAPE, {}).detections(moment, index)


def detected(things: dict[str, Thing], config: SensorConfig = NOISELESS) -> int:
    return len(sensed(moment_of(things), config).boxes)


@pytest.mark.parametrize(("name", "value", "allowed"), SENSELESS)
def test_a_parameter_that_makes_no_sense_is_refused(name: str, value: float, allowed: str) -> None:
    with pytest.raises(ValueError, match=f"{name} is {value:g} .allowed: {allowed}"):
        msgspec.structs.replace(SensorConfig(), **{name: value})


def test_every_parameter_may_be_0_that_is_no_divisor() -> None:
    assert NOISELESS.position_sigma == 0.0
    assert SensorConfig(field_of_view=0.0, visible_share=0.0, occluder_width=0.0, signal_range=0.0).signal_range == 0.0


def test_nothing_around_gives_empty_arrays_of_the_right_shapes() -> None:
    sweep = sensed(moment_of({}))
    assert sweep.boxes.shape == (0, 5)
    assert sweep.classes.shape == (0,)
    assert sweep.radial_speeds.shape == (0,)
    assert sweep.signals == {}


def test_without_noise_the_truth_is_reported_in_the_ego_frame() -> None:
    ego = ego_at(x=100.0, y=50.0, heading=math.pi / 2)
    sweep = sensed(moment_of({"a": (ObjectClass.VEHICLE, 97.0, 70.0, math.pi, -5.0, 0.0)}, ego))
    npt.assert_allclose(sweep.boxes, [[20.0, 3.0, math.pi / 2, 4.6, 1.8]], atol=1e-12)
    npt.assert_array_equal(sweep.classes, [ObjectClass.VEHICLE])


def test_radial_speed_is_over_ground_along_the_line_of_sight() -> None:
    ego = ego_at(speed=20.0)
    standing, leaving, crossing = (
        sensed(moment_of({"a": thing}, ego)).radial_speeds[0]
        for thing in (car(30.0, 0.0), car(30.0, 0.0, 8.0), (ObjectClass.VEHICLE, 30.0, 0.0, math.pi / 2, 0.0, 8.0))
    )
    assert (standing, leaving, crossing) == pytest.approx((0.0, 8.0, 0.0), abs=1e-12)


def test_range_counts_to_the_nearest_point_and_ends_there() -> None:
    side = SHAPE.centre  # straight to the left of the sensor, outside the forward cone
    assert detected({"a": car(side, 80.8)}) == 1
    assert detected({"a": car(side, 81.0)}) == 0


def test_the_forward_cone_reaches_further_than_the_rest() -> None:
    assert detected({"a": car(110.0, 0.0)}) == 1
    assert detected({"a": car(-110.0, 0.0)}) == 0
    assert detected({"a": car(-70.0, 0.0)}) == 1


def test_an_object_behind_a_narrower_field_of_view_is_not_seen() -> None:
    ahead_only = SensorConfig(field_of_view=math.pi, miss_near=0.0, miss_far=0.0)
    assert detected({"a": car(20.0, 0.0)}, ahead_only) == 1
    assert detected({"a": car(-20.0, 0.0)}, ahead_only) == 0


def test_a_car_straight_behind_another_is_hidden_and_one_beside_it_is_not() -> None:
    assert detected({"near": car(15.0, 0.0), "far": car(30.0, 0.0)}) == 1
    assert detected({"near": car(15.0, 0.0), "far": car(30.0, 6.0)}) == 2


def test_a_car_is_seen_from_a_quarter_of_it_on() -> None:
    # The near car's left edge ends at bearing 0.9 / (12.7 - centre); what shows beyond it grows with the offset.
    offsets = np.linspace(0.0, 5.0, 51)
    near = [15.0, 0.0, 0.0, 4.6, 1.8]
    shares = np.array([visible_shares(np.array([near, [30.0, y, 0.0, 4.6, 1.8]]), 1.0)[1] for y in offsets])
    assert shares[0] == 0.0
    assert shares[-1] == 1.0
    assert (np.diff(shares) >= 0.0).all()
    just_seen = offsets[np.argmax(shares >= 0.25)]
    just_not = offsets[np.argmax(shares >= 0.25) - 1]
    x = 15.0 + SHAPE.centre
    far_x = 30.0 + SHAPE.centre
    assert detected({"near": car(x, 0.0), "far": car(far_x, just_seen)}) == 2
    assert detected({"near": car(x, 0.0), "far": car(far_x, just_not)}) == 1


def test_people_and_cones_hide_nothing() -> None:
    behind = {"far": pedestrian(12.0, 0.0)}
    assert detected({"p": pedestrian(6.0, 0.0), **behind}) == 2
    assert detected({"c": cone(6.0, 0.0), **behind}) == 2
    assert detected({"v": car(6.0, 0.0), **behind}) == 1


def test_a_long_wall_hides_what_is_behind_it_not_what_stands_before_its_far_end() -> None:
    wall = [30.0, 6.0, 0.0, 60.0, 1.0]
    before, behind = [50.0, 4.0, 0.0, 0.5, 0.5], [50.0, 9.0, 0.0, 0.5, 0.5]
    npt.assert_array_equal(visible_shares(np.array([wall, before, behind]), 1.0), [1.0, 1.0, 0.0])


def test_a_body_that_overlaps_the_sensor_is_seen_and_hides_nothing() -> None:
    touching, far = [0.0, 0.0, 0.3, 4.0, 2.0], [20.0, 0.0, 0.0, 4.6, 1.8]
    npt.assert_array_equal(visible_shares(np.array([touching, far]), 1.0), [1.0, 1.0])
    npt.assert_array_equal(nearest_distances(np.array([touching, far])), [0.0, 17.7])


def test_a_place_is_hidden_whose_line_of_sight_enters_a_box_far_enough_before_it() -> None:
    chance = np.random.default_rng(4)
    boxes = np.column_stack(
        (chance.uniform(-30.0, 30.0, (6, 2)), chance.uniform(-3.0, 3.0, 6), chance.uniform(1.0, 12.0, (6, 2)))
    )
    bodies = [shapely.Polygon(each) for each in corners(boxes)]
    assert min(body.distance(HERE) for body in bodies) > 1.0
    points = chance.uniform(-60.0, 60.0, (400, 2))
    expected = [
        any(body.intersects(sight) and body.intersection(sight).distance(HERE) < sight.length - 4.0 for body in bodies)
        for sight in (shapely.LineString([HERE, shapely.Point(point)]) for point in points)
    ]
    assert 40 < sum(expected) < 360
    npt.assert_array_equal(are_hidden(points, boxes, 4.0), expected)


def test_the_same_key_gives_the_same_sweep_and_another_seed_or_index_another() -> None:
    moment = moment_of({"a": car(20.0, 3.0), "b": pedestrian(15.0, -4.0)})
    first, again = sensed(moment, NEVER_MISSING), sensed(moment, NEVER_MISSING)
    npt.assert_array_equal(first.boxes, again.boxes)
    npt.assert_array_equal(first.radial_speeds, again.radial_speeds)
    assert not np.array_equal(first.boxes, sensed(moment, NEVER_MISSING, seed=2).boxes)
    assert not np.array_equal(first.boxes, sensed(moment, NEVER_MISSING, index=1).boxes)


def test_removing_one_object_changes_no_other_objects_noise_or_misses() -> None:
    often_missing = SensorConfig(miss_near=0.4, miss_far=0.6, confusion_far=0.5)
    things = {f"o{k}": pedestrian(10.0 + 4.0 * k, 10.0 - 2.0 * k) for k in range(12)}
    without = {name: thing for name, thing in things.items() if name != "o5"}
    removed = 0
    for index in range(20):
        full = sensed(moment_of(things), often_missing, index=index)
        less = sensed(moment_of(without), often_missing, index=index)
        everything = {(*box, kind, speed) for box, kind, speed in _rows(full)}
        rest = {(*box, kind, speed) for box, kind, speed in _rows(less)}
        assert rest <= everything
        removed += len(everything) - len(rest)
    assert 0 < removed <= 20


def _rows(sweep: Detections) -> list[tuple[list[float], int, float]]:
    return list(zip(sweep.boxes.tolist(), sweep.classes.tolist(), sweep.radial_speeds.tolist(), strict=True))


def test_the_order_of_the_truth_does_not_show() -> None:
    things = {"a": car(20.0, 3.0), "b": pedestrian(15.0, -4.0), "c": car(-20.0, 3.0)}
    turned = dict(reversed(things.items()))
    npt.assert_array_equal(sensed(moment_of(things)).boxes, sensed(moment_of(turned)).boxes)


def test_noise_has_the_stated_size_and_grows_with_distance() -> None:
    things = {"near": pedestrian(5.0, 1.0), "far": pedestrian(75.0, -1.0)}
    sensors = Sensors(NEVER_MISSING, 3, SHAPE, {})
    sweeps = np.array([sensors.detections(moment_of(things), index).boxes for index in range(600)])
    far, near = sweeps[:, 0], sweeps[:, 1]
    assert np.std(near[:, 0]) == pytest.approx(0.05 + 0.002 * math.hypot(5.0, 1.0), rel=0.1)
    assert np.std(far[:, 0]) == pytest.approx(0.05 + 0.002 * 75.0, rel=0.1)
    assert np.std(far[:, 2]) == pytest.approx(0.2, rel=0.1)
    assert (sweeps[:, :, 3:] > 0.0).all()


def test_distant_objects_are_missed_more_often() -> None:
    things = {"near": pedestrian(5.0, 1.0), "far": pedestrian(0.0, 79.0)}
    sensors = Sensors(SensorConfig(), 3, SHAPE, {})
    sweeps = [sensors.detections(moment_of(things), index).boxes for index in range(600)]
    near = sum(bool((boxes[:, 1] < 40.0).any()) for boxes in sweeps)
    far = sum(bool((boxes[:, 1] > 40.0).any()) for boxes in sweeps)
    assert near > 580
    assert 470 < far < 550


POSITIONS = {"ahead/0": (60.0, 0.0), "distant/0": (140.0, 0.0), "behind/0": (-10.0, 0.0), "line/0": (3.7, 0.0)}


def test_signal_heads_are_read_ahead_and_within_range_only() -> None:
    sensors = Sensors(NOISELESS, 1, SHAPE, POSITIONS)
    shown = dict.fromkeys(POSITIONS, SignalColour.RED) | {"unplaced/0": SignalColour.GREEN}
    assert sensors.detections(moment_of({}, signals=shown), 0).signals == {
        "ahead/0": SignalColour.RED,
        "line/0": SignalColour.RED,
    }


def test_a_signal_without_a_state_is_not_made_up() -> None:
    assert Sensors(NOISELESS, 1, SHAPE, POSITIONS).detections(moment_of({}), 0).signals == {}


def test_signal_heads_drop_out_now_and_then() -> None:
    sensors = Sensors(SensorConfig(), 1, SHAPE, POSITIONS)
    moment = moment_of({}, signals={"ahead/0": SignalColour.GREEN})
    read = sum("ahead/0" in sensors.detections(moment, index).signals for index in range(500))
    assert 470 < read < 500


def test_odometry_depends_on_its_index_alone_not_on_what_was_read_before() -> None:
    ego = ego_at(speed=10.0)
    forwards, scattered = Sensors(SensorConfig(), 7, SHAPE, {}), Sensors(SensorConfig(), 7, SHAPE, {})
    series = [forwards.odometry(ego, index) for index in range(1030)]
    for index in (1029, 3, 511, 512, 1024, 0):
        assert scattered.odometry(ego, index) == series[index]
        assert scattered.fix(ego, index) == Sensors(SensorConfig(), 7, SHAPE, {}).fix(ego, index)


def test_wheels_at_rest_read_exactly_zero() -> None:
    sensors = Sensors(SensorConfig(), 7, SHAPE, {})
    assert {sensors.odometry(ego_at(), index).speed for index in range(50)} == {0.0}


def test_the_satellite_bias_wanders_slowly_and_stays_bounded() -> None:
    still = SensorConfig(gnss_position_sigma=0.0, gnss_first_sigma=0.0)
    sensors = Sensors(still, 5, SHAPE, {})
    fixes = [sensors.fix(ego_at(), index) for index in range(4000)]
    track = np.array([(fix.x, fix.y) for fix in fixes])
    assert np.hypot(*track.T).max() <= 0.2
    assert np.hypot(*np.diff(track, axis=0).T).max() < 0.01
    assert track.std(axis=0).min() > 0.03


def test_the_first_fix_is_an_average_and_the_rest_are_not() -> None:
    errors = {
        index: np.std(
            [Sensors(SensorConfig(gnss_bias_bound=0.0), s, SHAPE, {}).fix(ego_at(), index).x for s in range(300)]
        )
        for index in (0, 1)
    }
    assert errors[0] == pytest.approx(0.05, rel=0.2)
    assert errors[1] == pytest.approx(0.25, rel=0.2)
