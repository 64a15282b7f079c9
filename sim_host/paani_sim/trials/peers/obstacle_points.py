"""Obstacles as points, for planners that know no cells. Pure."""

from __future__ import annotations

import numpy as np

from paani.arrays import F64
from paani.motion_planning import PlanningInputs

HULL_RADIUS_M = 0.55  # circle about the hull, as the navigator's own planner has it


def static_points_m(inputs: PlanningInputs) -> F64:
    """Middles of the occupied cells, `(n, 2)`, relative to the boat."""
    row, column = np.nonzero(inputs.occupied)
    east_m = inputs.west_m + (column + 0.5) * inputs.cell_m - inputs.x_m
    north_m = inputs.south_m + (row + 0.5) * inputs.cell_m - inputs.y_m
    return np.column_stack([east_m, north_m])


def present_points_m(inputs: PlanningInputs) -> F64:
    """Static points, and outlines of what moves where they are now, `(n, 2)`, relative to the boat."""
    outlines = [np.column_stack([each.east_m - inputs.x_m, each.north_m - inputs.y_m]) for each in inputs.moving]
    return np.vstack([static_points_m(inputs), *outlines])
