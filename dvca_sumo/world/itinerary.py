"""The edges of an ego's trip, to be told to SUMO again when it has forgotten them.

Where SUMO does not find a body on its way, it takes the edges around it for all of its trip. From then on it does not
announce that vehicle at junctions, and nobody yields to it.
"""

from collections.abc import Sequence


class Itinerary:
    """The edges of a trip, and how far it has come; `route` is SUMO's name of what it was told last."""

    def __init__(self, edges: Sequence[str], route: str) -> None:
        self.route = route
        self._edges = tuple(edges)
        self._reached = 0

    def reach(self, edge: str) -> None:
        """Be on `edge` now, of the trip or of a junction; a trip may come by the same edge twice."""
        if edge != self._edges[self._reached] and edge in self._edges[self._reached :]:
            self._reached = self._edges.index(edge, self._reached)

    def onward(self, taken: Sequence[str]) -> tuple[str, ...]:
        """The edges that a vehicle is `taken` to be on, or between, and the rest of the trip; () off the trip."""
        ahead = self._edges[self._reached :]
        for row, edge in enumerate(taken):
            if edge in ahead:
                on = ahead.index(edge)
                if ahead[on : on + len(taken) - row] == tuple(taken[row:]):
                    return (*taken[:row], *ahead[on:])
        return ()
