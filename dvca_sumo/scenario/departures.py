"""When the traffic of a scenario departs."""

import re

from dvca_sumo.scenario.configuration import Configuration, seconds
from dvca_sumo.scenario.errors import ScenarioError
from dvca_sumo.scenario.texts import texts_within

_TAG = re.compile(r"<\s*(?:vehicle|trip|flow)\b[^>]*")
_TIME = re.compile(r"\b(?:depart|begin|end)\s*=\s*[\"']([^\"']*)")


def last_departure(configuration: Configuration) -> float:
    """The latest time [s] at which a vehicle departs, or a flow of them ends; 0 without any.

    Words in the place of a time ("triggered") are passed over.

    Raises:
        ScenarioError: A file cannot be read.
    """
    latest = 0.0
    for _, text in texts_within((*configuration.routes, *configuration.additionals)):
        for tag in _TAG.findall(text):
            for time in _TIME.findall(tag):
                latest = max(latest, _seconds(time))
    return latest


def _seconds(text: str) -> float:
    try:
        return seconds(text, "depart")
    except ScenarioError:
        return 0.0
