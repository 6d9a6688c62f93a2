"""What the analysis and the processes of one factual run say to each other."""

import msgspec

from dvca_sumo.engine.processes import Failure
from dvca_sumo.engine.protocol import Glimpse
from dvca_sumo.record import Record
from dvca_sumo.run import Task


class Order(msgspec.Struct, frozen=True):
    """To a checkpoint: branch off, under `task`; leave checkpoints at the world steps `steps` on the way."""

    number: int
    task: Task
    steps: tuple[int, ...]


class Recall(msgspec.Struct, frozen=True):
    """To a checkpoint: end the branch of that order, if it has not ended."""

    order: int


class Parked(msgspec.Struct, frozen=True):
    """A checkpoint is there, before the world step `step`."""

    step: int
    process: int
    copied: int  # [bytes] at most so much it holds that no earlier one holds too


class Died(msgspec.Struct, frozen=True):
    """A checkpoint's branch has ended without an answer."""

    order: int
    reason: str


class Delivered(msgspec.Struct, frozen=True):
    """What came of a branch."""

    order: int
    answer: Glimpse | Failure


class Driven(msgspec.Struct, frozen=True):
    """What came of the factual run."""

    answer: Record | Failure
    obstacle: str  # why the stem could not leave a checkpoint when one was due; empty: it could


Message = Died | Delivered | Driven
