"""The loop: every ego's cycle, then one step of the world, until no ego is left."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from dvca_sumo.record import Record
from dvca_sumo.run.drive import Drive
from dvca_sumo.scenario import ScenarioError
from dvca_sumo.stack.reference import StackError
from dvca_sumo.truth import Moment
from dvca_sumo.world import World


class Over(NamedTuple):
    """A drive that goes on no more."""

    drive: Drive
    error: ScenarioError | StackError | None  # why it cannot; None: it came to its end


class Simulation:
    """Drives in one world. The ego of one that is over leaves the world, and the others go on."""

    def __init__(self, world: World, begin: float, drives: Iterable[Drive] = ()) -> None:
        self.drives = list(drives)  # that are under way, in the order of their departures
        self._world = world
        self._begin = begin

    @property
    def drive(self) -> Drive:
        """The only one."""
        (drive,) = self.drives
        return drive

    @property
    def simulated(self) -> float:
        """SUMO time passed since the scenario's begin [s]."""
        return self._world.time - self._begin

    def proceed(self, at_step: Callable[[], None] = lambda: None) -> Record:
        """Drive the only ego to its end; `at_step` is called before every world step's cycle.

        Raises:
            ScenarioError: SUMO removed the ego or gave up.
            StackError: A component failed.
        """
        drive, over = self.drive, list[Over]()
        while not over:
            at_step()
            over = self.cycle() or self.advance()
        if over[0].error is not None:
            raise over[0].error
        return drive.record(self.simulated)

    def cycle(self, watch: Callable[[Drive, Moment], None] = lambda drive, moment: None) -> list[Over]:  # noqa: ARG005
        """One cycle of every drive; those that are over. `watch` hears of each one's truth before."""
        over = []
        for drive in self.drives:
            moment = self._world.observe(drive.ego)
            watch(drive, moment)
            try:
                if not drive.cycle(moment):
                    over.append(Over(drive, None))
            except StackError as error:
                over.append(Over(drive, error))
        for drive, _ in over:
            self.drives.remove(drive)
            self._world.dismiss(drive.ego)
        return over

    def advance(self) -> list[Over]:
        """One step of the world; drives whose ego SUMO removed in it.

        Raises:
            ScenarioError: SUMO gave up.
        """
        lost = self._world.advance()
        over = [
            Over(drive, ScenarioError(f"SUMO removed the ego {drive.ego.name!r} at {self._world.time:g} s"))
            for drive in self.drives
            if drive.ego in lost
        ]
        self.drives = [drive for drive in self.drives if drive.ego not in lost]
        return over
