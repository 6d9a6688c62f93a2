"""What stands beside and on the roads for good."""

import math

import libsumo
import numpy as np

from dvca_sumo.truth import DRAWN, part_of
from dvca_sumo.world.obstacles import Obstacles, box_of_poi, boxes_of_polygon

OBSTACLE = "obstacle."  # POIs and polygons whose type starts so are bodies, all others are scenery


def obstacles() -> Obstacles:
    """The scenario's POIs and polygons that are bodies."""
    names: list[str] = []
    rows: list[tuple[float, float, float, float, float]] = []
    for name in libsumo.poi.getIDList():
        of = libsumo.poi
        if of.getType(name).startswith(OBSTACLE):
            names.append(f"poi:{name}")
            angle = math.radians(90.0 - of.getAngle(name))
            rows.append(box_of_poi(of.getPosition(name), angle, of.getWidth(name), of.getHeight(name)))
    for name in libsumo.polygon.getIDList():
        shape_of = libsumo.polygon
        if shape_of.getType(name).startswith(OBSTACLE):
            boxes = boxes_of_polygon(shape_of.getShape(name), shape_of.getFilled(name), shape_of.getLineWidth(name))
            whole = f"{DRAWN}{name}"
            names += [whole] if len(boxes) == 1 else [part_of(whole, number) for number in range(len(boxes))]
            rows += boxes
    return Obstacles(tuple(names), np.array(rows, dtype=np.float64).reshape(-1, 5))
