"""In how many queues SUMO's vehicles stand."""

from typing import Any

import pytest

from dvca_sumo.screen.neighbours import Neighbourhood


class Standing:
    """A world in which vehicles stand, each behind another or behind nobody."""

    def __init__(self, ahead: dict[str, str]) -> None:
        self.time = 200.0
        self._ahead = ahead

    def teleported(self) -> tuple[str, ...]:
        return ()

    def waits(self) -> dict[str, float]:
        return dict.fromkeys("abcd", 130.0) | {"fresh": 5.0, "moving": 0.0}

    def leader(self, vehicle: str, reach: float) -> str | None:  # noqa: ARG002
        return self._ahead.get(vehicle)


@pytest.mark.parametrize(
    ("ahead", "queues"),
    [
        ({}, 4),
        ({"a": "b", "b": "c", "c": "d"}, 1),
        ({"d": "c", "c": "b", "b": "a"}, 1),
        ({"a": "b", "c": "d"}, 2),
        ({"a": "b", "b": "c", "c": "d", "d": "a"}, 1),
        ({"a": "fresh", "b": "fresh", "c": "d"}, 2),
        ({"a": "moving", "b": "moving", "c": "an ego", "d": "an ego"}, 4),
    ],
    ids=[
        "apart",
        "a queue",
        "a queue seen from its head",
        "two",
        "a ring",
        "behind one that has just come",
        "behind others",
    ],
)
def test_who_stands_right_behind_another_that_stands_is_in_one_queue_with_it(
    ahead: dict[str, str], queues: int
) -> None:
    neighbourhood = Neighbourhood()
    world: Any = Standing(ahead)
    neighbourhood.see(world)
    found = neighbourhood.seen()
    assert (found.stood, found.queues) == (4, queues)
