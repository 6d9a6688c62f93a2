import math

import msgspec
import numpy as np
import pytest
from oracle_scenes import Row, car, drive, judged, moment

from dvca_sumo.messages import ObjectClass
from dvca_sumo.oracles.collision import Collision
from dvca_sumo.thresholds import Thresholds
from dvca_sumo.violations import Answer, Contact, Ending


def wall(y: float) -> Row:
    """A long wall on the left whose near face is at `y`."""
    return "polygon:wall", (50.0, y + 0.5, 0.0, 20.0, 1.0), (0.0, 0.0)


def test_driving_into_a_standing_car_is_a_collision_by_the_front() -> None:
    found = judged(Collision, drive(40.0, 51.0, 10.0, objects=[car("lead", 50.5)]))
    assert found.answer is Answer.VIOLATED
    (violation,) = found.violations
    assert (violation.kind, violation.category, violation.object) == ("collision", "safety", "lead")
    assert violation.contact is Contact.ACTIVE_FRONT
    assert violation.time == pytest.approx(1.1)
    assert violation.value == 0.0
    assert violation.lane == "in_0"


def test_a_collision_is_returned_in_the_moment_of_contact_and_only_once() -> None:
    moments = drive(49.0, 52.0, 10.0, objects=[car("lead", 50.5)])
    found = judged(Collision, moments)
    assert [violation.time for violation in found.violations] == [moments[2].time]


def test_passing_a_wall_within_the_safe_distance_is_reported_at_the_closest_approach() -> None:
    moments = [moment(0.1 * k, 45.0 + k, 10.0, offset=0.02 * (5 - abs(k - 5)), objects=[wall(1.1)]) for k in range(11)]
    (violation,) = judged(Collision, moments).violations
    assert violation.kind == "safe_distance"
    assert violation.time == pytest.approx(0.5)
    assert violation.value == pytest.approx(0.1)
    assert violation.threshold == 0.2
    assert violation.contact is None


def test_an_approach_that_ends_in_contact_is_one_collision() -> None:
    moments = [moment(0.1 * k, 45.0 + k, 10.0, offset=0.05 * k, objects=[wall(1.1)]) for k in range(8)]
    (violation,) = judged(Collision, moments).violations
    assert violation.kind == "collision"
    assert violation.contact is Contact.ACTIVE_FRONT


def test_an_approach_that_the_end_of_the_run_interrupts_counts() -> None:
    moments = [moment(0.1 * k, 45.0 + k, 10.0, offset=0.05 * k, objects=[wall(1.1)]) for k in range(3)]
    (violation,) = judged(Collision, moments, ended=Ending.CUT).violations
    assert violation.kind == "safe_distance"
    assert violation.value == pytest.approx(0.1)


def test_passing_a_wall_just_outside_the_safe_distance_is_fine() -> None:
    assert judged(Collision, drive(40.0, 70.0, 10.0, objects=[wall(1.101)])).answer is Answer.KEPT


def test_the_safe_distance_is_a_parameter_and_zero_means_contact_only() -> None:
    moments = drive(40.0, 70.0, 10.0, objects=[wall(1.3)])
    assert judged(Collision, moments, thresholds=Thresholds(safe_distance=0.5)).answer is Answer.VIOLATED
    grazing = drive(40.0, 70.0, 10.0, objects=[wall(0.95)])
    assert judged(Collision, grazing, thresholds=Thresholds(safe_distance=0.0)).answer is Answer.KEPT


def test_someone_who_comes_close_to_a_standing_ego_is_not_its_violation() -> None:
    moments = [moment(0.1 * k, 50.0, 0.0, objects=[car("creeper", 56.0 - 0.1 * k)]) for k in range(60)]
    assert judged(Collision, moments).answer is Answer.KEPT


def test_a_follower_that_comes_close_is_not_the_egos_violation() -> None:
    moments = [moment(0.1 * k, 50.0 + k, 10.0, objects=[car("follower", 50.0 - 9.3 + k)]) for k in range(10)]
    assert judged(Collision, moments).answer is Answer.KEPT


def test_a_car_that_runs_into_the_standing_ego_is_told_apart() -> None:
    moments = [moment(0.1 * k, 50.0, 0.0, objects=[car("late", 30.0 + k, speed=10.0)]) for k in range(15)]
    (violation,) = judged(Collision, moments).violations
    assert (violation.kind, violation.contact) == ("collision", Contact.STOPPED_EGO)


def test_an_ego_that_stands_only_since_the_contact_was_not_standing() -> None:
    moments = [moment(0.1 * k, 49.9 + 0.11 * k, 1.0 - k, objects=[car("lead", 50.0)]) for k in range(2)]
    (violation,) = judged(Collision, moments).violations
    assert violation.contact is Contact.ACTIVE_FRONT


def test_a_car_that_hits_the_driving_ego_from_behind_is_told_apart() -> None:
    moments = [
        moment(0.1 * k, 50.0 + 0.5 * k, 5.0, objects=[car("late", 35.0 + 1.5 * k, speed=15.0)]) for k in range(15)
    ]
    (violation,) = judged(Collision, moments).violations
    assert violation.contact is Contact.HIT_FROM_BEHIND


def test_a_car_that_hits_the_ego_from_behind_as_it_comes_to_a_stop_is_told_apart() -> None:
    moments = [moment(0.1 * k, 50.0, 0.2 * (1 - k), objects=[car("late", 40.0 + k, speed=10.0)]) for k in range(2)]
    (violation,) = judged(Collision, moments).violations
    assert violation.contact is Contact.HIT_FROM_BEHIND


def test_a_contact_at_the_flank_is_a_side_contact() -> None:
    moments = [
        moment(
            0.1 * k,
            50.0 + k,
            10.0,
            objects=[("cutter", (47.0 + k, 3.0 - 0.2 * k, -0.2, 4.6, 1.8), (10.0, -2.0))],
        )
        for k in range(10)
    ]
    (violation,) = judged(Collision, moments).violations
    assert violation.contact is Contact.ACTIVE_SIDE


@pytest.mark.parametrize(
    ("body", "kind"),
    [
        (("polygon:kerb", (45.0, -1.9, 0.0, 50.0, 0.2), (0.0, 0.0)), ObjectClass.STATIC),
        (("tram", (33.0, -2.9, 0.0, 40.0, 2.4), (9.5, 0.0)), ObjectClass.VEHICLE),
    ],
)
def test_what_is_long_and_beside_the_ego_that_swerves_is_not_behind_it(body: Row, kind: ObjectClass) -> None:
    """Its middle is."""
    name, (x, y, heading, length, width), velocity = body
    moments = []
    for k in range(10):
        row: Row = (name, (x + 0.1 * k * velocity[0], y, heading, length, width), velocity)
        one = moment(0.1 * k, 48.0 + k, 10.0, offset=-0.12 * k, heading=-0.1, objects=[row])
        classes = np.array([int(kind)])
        moments.append(msgspec.structs.replace(one, objects=msgspec.structs.replace(one.objects, classes=classes)))
    (violation,) = judged(Collision, moments).violations
    assert violation.contact in {Contact.ACTIVE_FRONT, Contact.ACTIVE_SIDE}


def test_what_never_moves_does_not_run_into_an_ego_that_creeps() -> None:
    moments = []
    for k in range(20):
        one = moment(0.1 * k, 49.9 + 0.009 * k, 0.09, objects=[car("poi:cone", 50.0)])
        classes = np.array([int(ObjectClass.STATIC)])
        moments.append(msgspec.structs.replace(one, objects=msgspec.structs.replace(one.objects, classes=classes)))
    (violation,) = judged(Collision, moments).violations
    assert violation.contact is Contact.ACTIVE_FRONT


def test_two_contacts_at_once_are_both_returned() -> None:
    objects = [car("left", 50.5, y=0.95), car("right", 50.5, y=-0.95)]
    found = judged(Collision, drive(49.0, 52.0, 10.0, objects=objects))
    assert {violation.object for violation in found.violations} == {"left", "right"}


def test_a_pedestrian_beside_a_turned_ego_is_measured_to_its_corner() -> None:
    walker: Row = ("person:p", (50.0, 0.9 + 0.15 + 0.15, 0.0, 0.3, 0.3), (0.0, 0.0))
    turned = [moment(0.1 * k, 50.0, 5.0, heading=0.3, objects=[walker]) for k in range(2)]
    straight = [moment(0.1 * k, 50.0, 5.0, objects=[walker]) for k in range(2)]
    assert judged(Collision, turned).answer is Answer.KEPT
    assert judged(Collision, straight).answer is Answer.VIOLATED


def test_nothing_is_known_of_a_run_without_moments() -> None:
    found = judged(Collision, [], ended=Ending.CUT)
    assert found.answer is Answer.UNKNOWN
    assert found.reason


def test_the_front_is_found_whatever_the_heading() -> None:
    heading = 2.0
    other: Row = ("lead", (50.0 + 2.2 * math.cos(heading), 2.2 * math.sin(heading), heading, 4.6, 1.8), (0.0, 0.0))
    moments = [moment(0.1 * k, 50.0, 5.0, heading=heading, objects=[other]) for k in range(2)]
    (violation,) = judged(Collision, moments).violations
    assert violation.contact is Contact.ACTIVE_FRONT
