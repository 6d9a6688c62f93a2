"""Real bugs of real stacks, each rebuilt as one switch of the reference stack's configuration.

What each one was is told by its source; the code that a switch selects stands in the component.
"""

from difflib import get_close_matches

import msgspec
from msgspec.structs import replace

from dvca_sumo.messages import Component
from dvca_sumo.stack.reference import StackConfig


class BugError(ValueError):
    """There is no such bug."""


class Bug(msgspec.Struct, frozen=True):
    """A fault in code or configuration: the build that has it differs from the fixed one in `switches` alone."""

    component: Component
    summary: str
    source: str
    switches: dict[str, bool | float]  # field of the component's configuration -> its value in the buggy build


BUGS: dict[str, Bug] = {}


def build_with(name: str, config: StackConfig) -> StackConfig:
    """The build of the reference stack that has the bug.

    Raises:
        BugError: No bug has that name.
    """
    if name not in BUGS:
        nearest = get_close_matches(name, BUGS, 1, 0.0)
        raise BugError(f"no bug {name!r} (allowed: {', '.join(BUGS)}); did you mean {nearest[0]!r}?")
    bug = BUGS[name]
    table = replace(getattr(config, bug.component.value), **bug.switches)
    return replace(config, **{bug.component.value: table})
