"""How far vehicles and people are from where prediction had them half a second, one and two seconds before.

    python benchmarks/prediction.py SUMOCFG [--ego ID|auto] [--begin T] [--end T]

One run without faults. Of each that moves and that perception tells within 1.5 m of where it is, the future that comes
nearest counts, and of its body the corner that is farthest off. It turns where its heading changes by more than
0.15 rad until then; a vehicle is long from 7 m on. Who is out of the ego's surroundings by then is left out.
"""

import argparse
from collections import defaultdict
from dataclasses import replace
from typing import Any

import numpy as np
from cycle import driven

import dvca_sumo
from dvca_sumo.geometry.angles import wrapped
from dvca_sumo.geometry.boxes import corners
from dvca_sumo.messages import PREDICTION_TIMES, Floats, ObjectClass, PredictedObjects, TrackedObjects
from dvca_sumo.stack.protocols import Detections, Prediction
from dvca_sumo.stack.reference import Stack, StackContext, reference_stack
from dvca_sumo.stack.sensors import Sensors
from dvca_sumo.truth import Moment, ObjectsTruth

LATER = (0.5, 1.0, 2.0)  # [s]
NEAR = 1.5  # [m] between where one is and where perception tells it
MOVES = 1.0  # [m/s]
TURNS = 0.15  # [rad]
LONG = 7.0  # [m]
KINDS = (ObjectClass.VEHICLE, ObjectClass.PEDESTRIAN)
COLUMNS = [int(np.flatnonzero(later == PREDICTION_TIMES)[0]) for later in LATER]

Boxes = dict[str, tuple[str, Floats]]  # of those at one time, by id: the kind and (5,)
Known = dict[str, Floats]  # futures of those that move and are known of, by id: (h, len(LATER), 3)


class Log:
    """What there was, and what was foreseen, by cycle."""

    def __init__(self) -> None:
        self.cycles: list[tuple[float, Boxes, Known]] = []
        self._truth: ObjectsTruth | None = None

    def sees(self, sensors: Sensors) -> object:
        """The sensors, overheard."""
        log = self

        class Overheard:
            def __getattr__(self, name: str) -> object:
                return getattr(sensors, name)

            def detections(self, moment: Moment, index: int) -> Detections:
                log._truth = moment.objects
                return sensors.detections(moment, index)

        return Overheard()

    def foresees(self, prediction: Prediction) -> object:
        """The prediction, overheard."""
        log = self

        class Overheard:
            def step(self, tracked: TrackedObjects) -> PredictedObjects:
                predicted = prediction.step(tracked)
                assert log._truth is not None
                log.cycles.append((tracked.time, *_known(log._truth, predicted)))
                return predicted

        return Overheard()


def _known(truth: ObjectsTruth, predicted: PredictedObjects) -> tuple[Boxes, Known]:
    rows = np.flatnonzero(np.isin(truth.classes, KINDS))
    boxes = {truth.ids[row]: (_kind(truth, row), truth.boxes[row]) for row in rows.tolist()}
    told, known = predicted.objects.boxes, {}
    speeds = np.hypot(truth.velocities[:, 0], truth.velocities[:, 1])
    for row in rows[speeds[rows] >= MOVES].tolist() if len(told) else ():
        apart = np.hypot(told[:, 0] - truth.boxes[row, 0], told[:, 1] - truth.boxes[row, 1])
        futures = np.flatnonzero(predicted.owners == apart.argmin())
        if apart.min() < NEAR and futures.size:
            known[truth.ids[row]] = predicted.poses[futures][:, COLUMNS]
    return boxes, known


def _kind(truth: ObjectsTruth, row: int) -> str:
    if truth.classes[row] == ObjectClass.PEDESTRIAN:
        return "people"
    return "long" if truth.boxes[row, 3] >= LONG else "others"


def errors(log: Log) -> dict[tuple[str, str, float], list[float]]:
    """Distances of the worst corners [m], by kind, whether it turns, and how much later."""
    at = {round(time, 2): boxes for time, boxes, _ in log.cycles}
    found: dict[tuple[str, str, float], list[float]] = defaultdict(list)
    for time, boxes, known in log.cycles:
        for name, futures in known.items():
            for column, later in enumerate(LATER):
                known_after = at.get(round(time + later, 2), {}).get(name)
                if known_after is None:
                    continue
                kind, after = known_after
                foreseen = np.repeat(after[None], len(futures), axis=0)
                foreseen[:, :3] = futures[:, column]
                apart = corners(foreseen) - corners(after[None])
                worst = np.hypot(apart[..., 0], apart[..., 1]).max(axis=1).min()
                turns = abs(wrapped(float(after[2] - boxes[name][1][2]))) > TURNS
                found[kind, "turning" if turns else "straight", later].append(float(worst))
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("sumocfg")
    parser.add_argument("--ego")
    parser.add_argument("--begin", type=float)
    parser.add_argument("--end", type=float)
    options = parser.parse_args()
    log = Log()

    def build(context: StackContext) -> Stack:
        stack = reference_stack(context)
        parts: dict[str, Any] = {"sensors": log.sees(stack.sensors), "prediction": log.foresees(stack.prediction)}
        return replace(stack, **parts)

    driven(dvca_sumo.load_scenario(options.sumocfg, options.ego, begin=options.begin, end=options.end), build)
    print(f"{'who':<10}{'way':<10}{'later [s]':>10}{'cases':>8}{'mean [m]':>10}{'median':>8}{'90 %':>8}")
    for (kind, way, later), worst in sorted(errors(log).items()):
        middle, most = np.quantile(worst, (0.5, 0.9))
        print(f"{kind:<10}{way:<10}{later:10.1f}{len(worst):8d}{np.mean(worst):10.2f}{middle:8.2f}{most:8.2f}")


if __name__ == "__main__":
    main()
