"""The violations an oracle has found so far, and how they are handed out."""

from dvca_sumo.oracles.place import Places
from dvca_sumo.truth import Moment
from dvca_sumo.violations import Answer, Category, Contact, Judgement, Violation


class Findings:
    """Collects one oracle's violations; each is handed out once."""

    def __init__(self, kind: str, category: Category, places: Places) -> None:
        self._kind = kind
        self._category = category
        self._places = places
        self._found: list[Violation] = []
        self._handed_out = 0

    def made(
        self,
        moment: Moment,
        detail: str,
        value: float | None,
        threshold: float | None,
        *,
        kind: str | None = None,
        counterpart: str | None = None,
        contact: Contact | None = None,
    ) -> Violation:
        """A violation of this oracle at `moment`, not yet among the findings; `kind` where it is not the oracle's."""
        box = self._places.at(moment).box
        return Violation(
            kind=kind or self._kind,
            category=self._category,
            time=moment.time,
            object=counterpart,
            position=(float(box[0]), float(box[1])),
            lane=self._places.lane(moment),
            value=value,
            threshold=threshold,
            detail=detail,
            contact=contact,
        )

    def add(self, violation: Violation) -> None:
        """Take in a violation that is established."""
        self._found.append(violation)

    def next(self) -> Violation | None:
        """The oldest violation that was not handed out yet."""
        if self._handed_out == len(self._found):
            return None
        self._handed_out += 1
        return self._found[self._handed_out - 1]

    def judgement(self, blind: str = "") -> Judgement:
        """VIOLATED if anything was found, else UNKNOWN if there is a reason to be `blind`, else KEPT.

        A run of which nothing was seen is UNKNOWN.
        """
        if self._found:
            found = tuple(sorted(self._found, key=lambda violation: violation.time))
            return self._judged(Answer.VIOLATED, violations=found)
        reason = "nothing was observed" if self._places.is_empty else blind
        return self._judged(Answer.UNKNOWN, reason=reason) if reason else self._judged(Answer.KEPT)

    def _judged(self, answer: Answer, violations: tuple[Violation, ...] = (), reason: str = "") -> Judgement:
        return Judgement(self._kind, answer, violations, reason, needs_end=self._category is Category.MISSION)
