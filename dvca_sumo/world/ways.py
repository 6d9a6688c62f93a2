"""Ways across junctions, and on which of their lanes SUMO's drivers do not see who is beside them."""

from collections.abc import Iterator
from typing import NamedTuple

from dvca_sumo.roadmap import is_inner
from dvca_sumo.world.net import Connections, edge_of, junction_of


class End(NamedTuple):
    """Where an end of a body is on its route."""

    lane: str
    origin: str  # the lane of a road by which the route comes to `lane`, if that is one of a junction; else ""


class Ways:
    """The ways of one net, found when first asked for."""

    def __init__(self, net: Connections) -> None:
        self._net = net
        self._ways: dict[str, list[list[str]]] = {}  # by lane of a road
        self._named: dict[str, list[str]] = {}  # lanes by junction, whether they lead on or not
        self._inner: dict[str, list[str]] = {}  # those that do
        self._blind: dict[End, list[str]] = {}  # those `beside` a front
        self._behind: dict[tuple[End, End], list[str]] = {}  # those `behind` a front and a rear

    def beside(self, front: End) -> list[str]:
        """Lanes of ways from the same lane as a body's front and those next to it, whose drivers do not look for it.

        Those who come from the next lanes see who is on a way that touches theirs as the net has it. Those from the
        same lane may do so, too, but surely only from the first lane of their way one on the first lane of another.
        """
        if not front.origin:
            return []
        if front not in self._blind:
            others = [way for way in self.ways_from(front.origin) if front.lane not in way]
            is_first = front.lane in {way[0] for way in self.ways_from(front.origin)}
            next_to = (way for lane in self._net.adjacent(front.origin) for way in self.ways_from(lane))
            self._blind[front] = [lane for way in others for lane in way[is_first:]]
            self._blind[front] += [lane for way in next_to for lane in way if front.lane not in self._net.foes(lane)]
        return self._blind[front]

    def behind(self, front: End, rear: End) -> list[str]:
        """Lanes of the junction that a body's rear is on, from which SUMO's drivers take it to be gone.

        They do so when its front has left the junction, though its tail may still be in their way. Not those who come
        from the next junction, while its front is on that: the road between is so short that they, and all from the
        same lane, would stop there beside the body, and in its way.
        """
        if not rear.origin or junction_of(rear.lane) == junction_of(front.lane):
            return []
        ends = front, rear
        if ends not in self._behind:
            edges = {edge_of(lane) for lane in (*self._way_of(rear), *self._lanes_back(front))}
            others = self.inner_lanes(junction_of(rear.lane))
            self._behind[ends] = [lane for lane in others if edge_of(lane) not in edges]
        return self._behind[ends]

    def _lanes_back(self, front: End) -> Iterator[str]:
        """The lanes of a junction on which one comes from the next one, if a body's front is on that."""
        if not front.origin:
            return
        net = self._net
        before, junction = net.junctions_of(edge_of(front.origin))
        for road in dict.fromkeys(map(self.lane_after, self.inner_lanes(f":{junction}"))):
            if net.junctions_of(edge_of(road))[1] == before:
                for link in net.links(road):
                    yield from self._way_by(link.via) if link.via else ()

    def inner_lanes(self, junction: str) -> list[str]:
        """The lanes of vehicles on a junction that lead on, by the beginning of their names."""
        if junction not in self._inner:
            if not self._named:
                for lane in self._net.lanes():
                    if is_inner(lane) and edge_of(lane).rpartition("_")[2].isdecimal():
                        self._named.setdefault(junction_of(lane), []).append(lane)
            self._inner[junction] = [lane for lane in self._named.get(junction, []) if [*self._net.links(lane)]]
        return self._inner[junction]

    def onward_lanes(self, junction: str) -> list[str]:
        """The `inner_lanes` of ways that do not turn back.

        Hardly anybody drives those that do, and they lie across many others, on which all wait for who stands there.
        """
        lanes, links = self.inner_lanes(junction), self._net.links
        return [lane for lane in lanes if not any(link.turns_back for link in links(lane))]

    def lane_after(self, lane: str) -> str:
        """The lane of a road that one of the `inner_lanes` leads to."""
        return next(iter(self._net.links(lane))).to

    def ways_from(self, lane: str) -> list[list[str]]:
        """The lanes of a junction, way by way, by which one leaves a lane of a road, without turns back."""
        if lane not in self._ways:
            onward = (link.via for link in self._net.links(lane) if link.via and not link.turns_back)
            self._ways[lane] = [self._way_by(via) for via in onward]
        return self._ways[lane]

    def _way_of(self, end: End) -> list[str]:
        """All lanes of a junction on the way that an end is on."""
        return next((way for way in self.ways_from(end.origin) if end.lane in way), [end.lane])

    def _way_by(self, lane: str) -> list[str]:
        way = [lane]
        while onward := next((link.via for link in self._net.links(way[-1])), ""):
            way.append(onward)
        return way
