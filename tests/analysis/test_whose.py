"""Whose doing the violations of a drive are, told from its record."""

from pathlib import Path

import pytest
from small_scenarios import driven, scenario_file

from dvca_sumo.analysis.at_fault import at_fault
from dvca_sumo.oracles.destination import Destination
from dvca_sumo.responsibility.judging import AtFault
from dvca_sumo.roadmap import RoadMap

EGO = '<trip id="ego" from="bc" to="bc" depart="0" departPos="20" departSpeed="10" arrivalPos="{}"/>'
INSERTED = (
    '<vehicle id="block" depart="3" departPos="{}" departSpeed="0" insertionChecks="none"><route edges="bc"/>'
    '<stop lane="bc_0" endPos="{}" duration="100"/></vehicle>'
)


@pytest.mark.parametrize(("place", "fault"), [(60.0, AtFault.SIMULATOR), (150.0, None)])
def test_what_sumo_sets_down_before_the_ego_is_the_simulators_doing(
    tmp_path: Path, street: Path, place: float, fault: AtFault | None
) -> None:
    routes = EGO.format(100) + INSERTED.format(place, place + 1.0)
    record = driven(scenario_file(tmp_path, street, routes))
    found = at_fault(record, RoadMap.load(street))
    assert {one.fault for one in found} == ({fault} if fault else set())
    assert [one.violation for one in found] == record.violations


def test_of_a_destination_that_is_not_reached_a_drive_alone_tells_nothing(tmp_path: Path, street: Path) -> None:
    routes = EGO.format(200) + "".join(
        f'<vehicle id="{lane}" depart="0" departLane="{lane}" departPos="60"><route edges="bc"/>'
        f'<stop lane="bc_{lane}" endPos="60" duration="999"/></vehicle>'
        for lane in (0, 1)
    )
    record = driven(scenario_file(tmp_path, street, routes))
    assert Destination.not_reached in {one.kind for one in record.violations}
    assert at_fault(record, RoadMap.load(street)) == ()
