"""A whole screening: what it says, keeps, and goes on from."""

import json
import shlex
from pathlib import Path
from typing import Any

import msgspec
import pytest
from command_line import assert_one_error, typed
from screen_scenes import traffic

from dvca_sumo.responsibility.judging import AtFault, Judged
from dvca_sumo.scenario import AUTO, Scenario, load_scenario
from dvca_sumo.screen.driving import Driven
from dvca_sumo.screen.neighbours import Neighbours
from dvca_sumo.screen.results import TripOutcome, TripResult
from dvca_sumo.screen.screening import Progress, Screening, Setting, Stores, excused, screened
from dvca_sumo.screen.summary import summary_of
from dvca_sumo.screen.tables import command, has_failed, has_gaps, json_of, terminal_text
from dvca_sumo.screen.trips import Draw
from dvca_sumo.stack.sources import StackSource
from dvca_sumo.store import Store
from dvca_sumo.violations import Category, Contact, Violation

ROUTES = """<vType id="bus" vClass="bus"/>
<trip id="first" from="ab" to="bc" depart="1" departPos="last"/>
<trip id="second" from="ab" to="bc" depart="6" departPos="last"/>"""


class Heard(Progress):
    """Counts simulations, and notes of which stages."""

    def __init__(self) -> None:
        self.simulations = 0
        self.stages: list[str] = []

    def stage(self, what: str, simulations: int) -> None:  # noqa: ARG002
        self.stages.append(what)

    def over(self, left: int) -> None:  # noqa: ARG002
        self.simulations += 1


def screening_of(
    scenario: Scenario, stack: str | None = None, folder: Path | None = None, progress: Progress | None = None
) -> Screening:
    setting = Setting.of_window(scenario, 3, 5, StackSource(stack))
    stores = Stores()
    if folder is not None:
        stores = Stores(Store(folder / "draws.jsonl", Draw), Store(folder / "simulations.jsonl", Driven))
    return screened(setting, 2, stores, progress or Progress())


@pytest.fixture(scope="module")
def reckless(tmp_path_factory: pytest.TempPathFactory, street: Path) -> Screening:
    """Two egos at full throttle: too fast at least."""
    return screening_of(traffic(tmp_path_factory.mktemp("reckless"), street, ROUTES), "small_stacks:full_throttle")


def test_the_healthy_stack_is_clean_and_goes_on_from_what_was_kept(tmp_path: Path, street: Path) -> None:
    scenario = traffic(tmp_path, street, ROUTES)
    heard, again = Heard(), Heard()
    screening = screening_of(scenario, folder=tmp_path / "kept", progress=heard)
    assert not has_failed(screening)
    assert not has_gaps(screening)
    ads = summary_of(screening.ads, screening.sumo_driver, screening.ads_neighbours)
    assert (ads.trips, ads.completed.count, ads.at_fault_violations) == (2, 2, 0)
    assert ads.travel_time_ratio.count == 2
    assert 0.8 < (ads.travel_time_ratio.median or 0.0) < 1.8
    assert heard.simulations == 3
    copy = traffic(tmp_path / "copy", street, ROUTES)
    assert screening_of(copy, folder=tmp_path / "kept", progress=again).ads == screening.ads
    assert json_of(screening_of(scenario, folder=tmp_path / "kept", progress=again)) == json_of(screening)
    assert again.simulations == 0


def test_a_stack_of_ones_own_is_driven_again_once_any_of_its_files_is_edited(
    tmp_path: Path, street: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    package = tmp_path / "edited_ads"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "parts.py").write_text("from small_stacks import standing\n")
    (package / "whole.py").write_text("from edited_ads.parts import standing as build\n")
    scenario, simulations = traffic(tmp_path, street, ROUTES), []
    for edit in ("", "", "# edited"):
        with (package / "parts.py").open("a") as file:
            file.write(edit)
        heard = Heard()
        screening_of(scenario, "edited_ads.whole:build", tmp_path / "kept", heard)
        simulations.append(heard.simulations)
    assert simulations[0] > 0
    assert simulations[1] == 0
    assert simulations[2] == simulations[0]


def test_trips_that_went_down_with_others_are_driven_again_alone_and_it_is_told_why(
    tmp_path: Path, street: Path
) -> None:
    heard = Heard()
    screening = screening_of(traffic(tmp_path, street, ROUTES), "small_stacks:leaving", progress=heard)
    reason = "the process ended with code 3 without an answer"
    assert heard.stages[-1] == f"trips driven again, each alone, for a simulation failed: {reason}"
    assert heard.simulations == 5
    assert [(trip.outcome, trip.reason) for trip in screening.ads] == [(TripOutcome.NOT_DRIVEN, reason)] * 2


def test_what_is_said_as_data(reckless: Screening) -> None:
    said = json.loads(json.dumps(json_of(reckless), allow_nan=False))
    assert said["schema"] == 1
    for driver in ("ads", "sumo_driver"):
        wanted = {"trips", "completed", "km", "at_fault_collisions", "at_fault_violations", "by_oracle"}
        assert wanted | {"travel_time_ratio"} <= set(said[driver])
        assert {"collision", "ttc", "speed_limit", "no_progress"} <= set(said[driver]["by_oracle"])
        assert said[driver]["neighbours"]["teleports_per_100_hours"]["count"] == 0
    assert said["ads"]["at_fault_violations"] > 0
    assert said["ads"]["by_oracle"]["speed_limit"]["trips"]["count"] > 0
    assert said["sumo_driver"]["completed"]["count"] == 2
    assert said["ads"]["by_oracle"]["destination"]["per_100_trips"]["value"] is not None
    unasked = said["sumo_driver"]["by_oracle"]["destination"]
    assert [unasked[rate][end] for rate in ("per_1000_km", "per_100_trips") for end in ("value", "low", "high")] == (
        [None] * 6
    )
    assert (unasked["trips"]["total"], unasked["unknown"]) == (0, 2)
    assert said["draw"] == {"departures": 2, "refused": {}, "drawn": 2}


def test_each_violation_comes_with_a_command_that_reproduces_it(
    reckless: Screening, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1]))  # where the stack is
    assert has_failed(reckless)
    found = [one for one in json_of(reckless)["violations"] if one["driver"] == "ads"]  # type: ignore[attr-defined]
    assert found
    assert {one["alone"] for one in found} <= {True, False}
    chosen = next(one for one in found if one["kind"] == "speed_limit" and one["alone"])
    program, *words = shlex.split(chosen["command"])
    assert program == "dvca-sumo"
    assert words[:4] == ["run", str(reckless.setting.scenario.configuration.path), "--ego", chosen["ego"]]
    said = typed(*words, "--json")
    assert chosen["kind"] in {one["kind"] for one in said.result["violations"]}, said.err
    assert chosen["command"] in terminal_text(reckless)


def test_trips_that_the_simulator_ended_or_the_scenario_cut_off_are_counted_apart() -> None:
    contact = Violation("collision", Category.SAFETY, 5.0, "x", (0.0, 0.0), "ab_0", 0.0, 0.0, "", Contact.ACTIVE_FRONT)
    trips = [TripResult("arrived", TripOutcome.ARRIVED), TripResult("cut", TripOutcome.CUT)]
    trips += [
        TripResult(fault, TripOutcome.CONTACT, violations=(Judged("collision", contact, fault, ""),))
        for fault in AtFault
    ]
    found = summary_of(trips, [], Neighbours(0.0, 0, 0, 0))
    assert (found.trips, found.ended_by_simulator, found.cut) == (5, 1, 1)
    assert (found.completed.count, found.completed.total) == (1, 3)
    for outcome in (TripOutcome.ARRIVED, TripOutcome.CUT):  # as SUMO's drivers, who go on
        going_on = [msgspec.structs.replace(one, outcome=outcome) if one.violations else one for one in trips]
        natives = summary_of(going_on, [], Neighbours(0.0, 0, 0, 0))
        assert (natives.ended_by_simulator, natives.cut, natives.completed) == (1, 1, found.completed)


def test_what_a_driver_does_past_its_contact_is_in_no_rate_but_its_travel_time_is_whole() -> None:
    native = TripResult(
        "ego", TripOutcome.ARRIVED, distance=1000.0, duration=100.0, distance_after=600.0, duration_after=64.0
    )
    found = summary_of([native], [msgspec.structs.replace(native, duration=50.0)], Neighbours(0.0, 0, 0, 0))
    assert (found.km, found.hours) == pytest.approx((0.4, 0.01))
    assert found.hard_brakings_per_100_km.exposure == pytest.approx(0.004)
    assert found.travel_time_ratio.median == 2.0


def _untold(screening: Screening, unknown: tuple[str, ...]) -> Screening:
    """The screening, had these oracles not been able to tell."""
    trips = tuple(msgspec.structs.replace(trip, unknown=unknown) for trip in screening.ads)
    return msgspec.structs.replace(screening, ads=trips)


def test_a_trip_that_was_cut_off_is_a_gap_and_the_text_says_why(reckless: Screening) -> None:
    whole = _untold(reckless, ())
    assert not has_gaps(whole)
    cut = msgspec.structs.replace(whole.ads[0], outcome=TripOutcome.CUT, reason="the scenario ended at 100 s")
    screening = msgspec.structs.replace(whole, ads=(cut, *whole.ads[1:]))
    assert has_gaps(screening)
    assert f"ADS {cut.ego}: cut: the scenario ended at 100 s" in terminal_text(screening)


def test_what_an_oracle_could_not_tell_is_a_gap_and_the_text_says_on_how_many_trips(reckless: Screening) -> None:
    screening = _untold(reckless, ("destination",))
    assert has_gaps(screening)
    said = "Oracles that could not tell, and on how many trips\nADS: destination on 2 of 2"
    assert terminal_text(screening).endswith(said)
    assert "could not tell" not in terminal_text(_untold(reckless, ()))


def test_where_a_violation_is_not_the_drivers_the_text_says_that_run_asks_nevertheless(reckless: Screening) -> None:
    said = "`run` looks for a component in those that are not the driver's, too."
    first, *others = reckless.ads
    excused = tuple(msgspec.structs.replace(one, fault=AtFault.OTHER) for one in first.violations)
    screening = msgspec.structs.replace(reckless, ads=(msgspec.structs.replace(first, violations=excused), *others))
    assert said in terminal_text(screening)
    assert said not in terminal_text(reckless)


def test_a_file_of_parameters_is_found_from_any_folder(
    tmp_path: Path, reckless: Screening, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    setting = msgspec.structs.replace(reckless.setting, source=StackSource("short.toml"))
    assert command(setting, "first").endswith(f" --stack {tmp_path / 'short.toml'}")


def test_the_text_puts_both_drivers_side_by_side(reckless: Screening) -> None:
    text = terminal_text(reckless)
    assert "SUMO's driver" in text
    assert "alone: yes" in text
    assert "2 trips drawn of 2 departures (no more than that of 3 asked for)" in text
    destination = next(line for line in text.splitlines() if line.startswith("destination"))
    assert destination.split()[-3:] == ["-", "-", "-"]
    assert destination.count(" - ") + destination.endswith(" -") == 3


def test_where_there_are_fewer_trips_than_asked_for_it_is_told_why(reckless: Screening) -> None:
    draw = msgspec.structs.replace(reckless.draw, departures=5, refused={"of class bus": 2, "shorter than 100 m": 1})
    text = terminal_text(msgspec.structs.replace(reckless, draw=draw))
    said = "2 trips drawn of 5 departures (no more than that of 3 asked for; 2 of class bus; 1 shorter than 100 m)"
    assert text.splitlines()[0] == said


def test_trips_after_the_configurations_end_are_driven_where_an_end_after_it_is_asked_for(
    tmp_path: Path, street: Path
) -> None:
    configured = traffic(tmp_path, street, ROUTES, end="5").configuration.path
    screening = screening_of(load_scenario(configured, AUTO, end=200.0), "small_stacks:full_throttle")
    assert [trip.outcome for trip in screening.sumo_driver] == [TripOutcome.ARRIVED] * 2
    told: Any = json_of(screening)
    assert told["scenario"]["end"] == 200.0
    (words,) = {one["command"].partition("--begin")[2] for one in told["violations"]}
    assert words == " 0 --end 200 --stack small_stacks:full_throttle"


@pytest.mark.parametrize(
    ("configured", "asked", "end", "window_end"),
    [(None, None, None, None), (None, 40.0, None, 40.0), ("60", None, 60.0, 60.0), ("60", 40.0, 60.0, 40.0)],
)
def test_trips_that_are_held_up_go_on_to_the_configurations_end(
    tmp_path: Path, street: Path, configured: str | None, asked: float | None, end: float | None, window_end: float
) -> None:
    options = {} if configured is None else {"end": configured}
    scenario = load_scenario(traffic(tmp_path, street, ROUTES, **options).configuration.path, AUTO, end=asked)
    setting = Setting.of_window(scenario, 3, 5, StackSource(None))
    assert (setting.scenario.end, setting.window_end) == (end, window_end)
    assert "--end" not in command(setting, "first")


def test_a_mesoscopic_scenario_is_refused(tmp_path: Path, street: Path) -> None:
    with pytest.raises(Exception, match="mesoscopic"):
        traffic(tmp_path, street, mesosim="true")


def test_a_scenario_without_a_way_for_cars_is_refused_in_one_line(tmp_path: Path, street: Path) -> None:
    rails = tmp_path / "rails.net.xml"
    rails.write_text(street.read_text().replace('speed="13.90"', 'allow="rail" speed="13.90"'))
    scenario = traffic(
        tmp_path / "rail", rails, '<vType id="r" vClass="rail"/><trip id="t" type="r" from="ab" to="bc" depart="0"/>'
    )
    said = typed("screen", scenario.configuration.path)
    assert_one_error(said, 3, "no lane for cars", "rails.net.xml")


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (("--egos", "0"), 2, "egos"),
        (("--end", "-4"), 3, "end is no time"),
        (("--stack", "nowhere:stack"), 3, "nowhere:stack"),
    ],
)
def test_what_cannot_be_meant_is_refused(
    tmp_path: Path, street: Path, words: tuple[str, ...], code: int, says: str
) -> None:
    scenario = traffic(tmp_path, street, ROUTES)
    assert_one_error(typed("screen", scenario.configuration.path, *words), code, says)


def test_a_destination_is_excused_only_where_sumos_driver_was_held_up_as_long(reckless: Screening) -> None:
    destination = Violation(
        "destination_not_reached", Category.MISSION, 99.0, None, (0.0, 0.0), None, 40.0, 3.0, "40.0 m short"
    )
    late = TripResult(
        "ego",
        TripOutcome.TIME_OVER,
        duration=100.0,
        violations=(Judged("destination", destination, AtFault.DRIVER, ""),),
    )
    for taken, fault in ((99.0, AtFault.DRIVER), (101.0, AtFault.OTHER)):
        native = TripResult("ego", TripOutcome.ARRIVED, duration=taken)
        assert [one.fault for one in excused(late, native).violations] == [fault]
    stood = Judged("no_progress", msgspec.structs.replace(destination, kind="no_progress"), AtFault.DRIVER, "")
    idle = msgspec.structs.replace(late, violations=(stood, *late.violations))
    assert excused(idle, TripResult("ego", TripOutcome.ARRIVED, duration=101.0)) == idle
    assert all(result == excused(result, result) for result in reckless.ads)


@pytest.mark.parametrize(
    ("held", "distance", "kinds", "fault"),
    [
        (140.0, 900.0, [], AtFault.OTHER),
        (60.0, 900.0, [], AtFault.DRIVER),
        (140.0, 300.0, [], AtFault.DRIVER),
        (140.0, 900.0, ["no_progress"], AtFault.DRIVER),
    ],
    ids=["in time but for queues", "too slow besides", "too much left to drive", "stood for no reason"],
)
def test_a_destination_is_excused_where_the_ego_was_held_up_in_queues_and_is_quick_besides(
    held: float, distance: float, kinds: list[str], fault: AtFault
) -> None:
    """SUMO's driver took 120 s for 1 000 m, 20 s of them in queues; an ego may take 1.5 times its 100 s besides."""
    violations = [
        Judged(
            "destination" if kind.startswith("destination") else kind,
            Violation(kind, Category.MISSION, 99.0, None, (0.0, 0.0), None, 40.0, 3.0, ""),
            AtFault.DRIVER,
            "",
        )
        for kind in [*kinds, "destination_not_reached"]
    ]
    late = TripResult(
        "ego", TripOutcome.TIME_OVER, distance=distance, duration=250.0, held=held, violations=tuple(violations)
    )
    native = TripResult("ego", TripOutcome.ARRIVED, distance=1000.0, duration=120.0, held=20.0)
    assert excused(late, native).violations[-1].fault is fault
    assert excused(late, native).violations[:-1] == late.violations[:-1]
    untold = TripResult("ego", TripOutcome.NOT_DRIVEN)
    assert excused(late, untold) == late
