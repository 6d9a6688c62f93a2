"""Errors that name a broken premise of a run; each is one line a user can act on."""


class ScenarioError(ValueError):
    """The scenario cannot be run as given: what was wrong, where, and what is allowed."""


class NoEgoError(ScenarioError):
    """Nothing says which vehicle is the ego."""
