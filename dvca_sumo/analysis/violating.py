"""Which violation of a run is to be explained."""

from collections.abc import Sequence

from dvca_sumo.violations import Violation

PRECURSORS = ("ttc", "safe_distance")
_LEADS_TO = 6.0  # [s] a close call so shortly before a contact belongs to it


def principal(violations: Sequence[Violation]) -> Violation:
    """The first violation, a close call that ends in contact counting as that contact.

    `violations` are in the order of time, at least one.
    """
    first = violations[0]
    if first.kind in PRECURSORS:
        for later in violations[1:]:
            if later.contact is not None and later.whom == first.whom and later.time - first.time <= _LEADS_TO:
                return later
    return first


def is_same_family(kind: str, violation: Violation) -> bool:
    """Whether a violation of `kind` is one that `violation` is about: all close calls and contacts are one family."""
    close = (*PRECURSORS, "collision")
    return kind == violation.kind or (kind in close and violation.kind in close)
