"""Bodies step after step: who has driven here, and who was set down."""

import pytest

from dvca_sumo.messages import ObjectClass
from dvca_sumo.world.crowd import Body, Crowd

BODIES = {name: Body(ObjectClass.VEHICLE, 5.0, 1.8, 2.5) for name in ("car", "late")}


@pytest.mark.parametrize(
    ("x", "speed"),
    [(1.2, 12.0), (0.0, 0.0), (60.0, 10.0), (-60.0, 10.0)],
    ids=["on a lane drawn longer", "held", "set down ahead", "set down behind"],
)
def test_a_body_has_the_speed_of_its_way_unless_it_was_set_down(x: float, speed: float) -> None:
    crowd = Crowd()
    crowd.seen(0.0, ["car"], [0.0, 0.0, 90.0, 10.0], ["lane"], BODIES)
    truth = crowd.seen(0.1, ["car"], [x, 0.0, 90.0, 10.0], ["lane"], BODIES)
    assert truth.velocities[0].tolist() == pytest.approx([speed, 0.0])


@pytest.mark.parametrize(("aside", "speed"), [(0.3, 3.0), (0.6, 1.2)], ids=["steps aside", "set down aside"])
def test_a_person_has_the_speed_of_its_steps_unless_it_was_set_down(aside: float, speed: float) -> None:
    """Nobody walks at 6 m/s."""
    crowd, bodies = Crowd(), {"person:p": Body(ObjectClass.PEDESTRIAN, 0.2, 0.5, 0.0)}
    crowd.seen(0.0, ["person:p"], [0.0, 0.0, 90.0, 1.2], ["walk"], bodies)
    truth = crowd.seen(0.1, ["person:p"], [aside, 0.0, 90.0, 1.2], ["walk"], bodies)
    assert truth.velocities[0].tolist() == pytest.approx([speed, 0.0])


def test_who_has_just_come_has_the_speed_that_sumo_tells_and_the_others_keep_theirs() -> None:
    crowd = Crowd()
    first = crowd.seen(0.0, ["car"], [0.0, 0.0, 90.0, 10.0], ["lane"], BODIES)
    truth = crowd.seen(0.1, ["late", "car"], [9.0, 9.0, 0.0, 3.0, 1.2, 0.0, 90.0, 10.0], ["lane", "lane"], BODIES)
    assert first.velocities[0].tolist() == pytest.approx([10.0, 0.0])
    assert truth.velocities.ravel().tolist() == pytest.approx([0.0, 3.0, 12.0, 0.0])
