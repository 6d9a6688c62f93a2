import pytest

from dvca_sumo.interventions import State, StateUnits, state_of


@pytest.mark.parametrize(
    ("motion", "state"),
    [
        ((0.0, 0.0, 0.0), State(0, 0, 0)),
        ((1.999, 0.999, 0.999), State(0, 0, 0)),
        ((2.0, 1.0, 1.0), State(1, 1, 1)),
        ((37.3, 13.5, -0.2), State(18, 13, -1)),
        ((-0.1, -0.1, -1.0), State(-1, -1, -1)),
        ((-2.0, 0.0, -1.1), State(-1, 0, -2)),
    ],
)
def test_a_state_is_the_floor_of_motion_in_units(motion: tuple[float, float, float], state: State) -> None:
    assert state_of(*motion) == state


def test_units_set_the_size_of_a_state() -> None:
    units = StateUnits(position=10.0, speed=0.5, acceleration=2.0)
    assert state_of(37.3, 13.6, -0.2, units) == State(3, 27, -1)


def test_a_state_is_written_as_a_fault_takes_it() -> None:
    assert str(State(18, 13, -1)) == "18:13:-1"
