"""The way round a dead end: the course along the shortest way over unbarred water to the path beyond. Pure.

A navigation function by wavefront (Barraquand, Langlois, Latombe: "Numerical potential field techniques for robot path
planning", IEEE Transactions on Systems, Man, and Cybernetics, 1992), as the global dynamic window approach uses it
(Brock, Khatib, ICRA 1999): it only turns the desired course; what the local planner refuses stays refused. What was
never seen counts as water, as the boat looks at it on the way.
"""

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from paani import portable
from paani.arrays import Bools
from paani.config import PlannerConfig
from paani.fence_geometry import Point
from paani_services.navigator.mapping.barriers import BARRIER_CELL_M, BARRIER_CELLS, Barriers
from paani_services.navigator.mapping.distance_field import distance_field_m
from paani_services.navigator.mapping.observed_cells import CELL_M

REACH_M = 18.0  # along the path, to which a way is looked for: the boat is in the middle of 40 m
AHEAD_M = 4.0  # along the way found, to which the course leads: the lookahead along a path
ALONGSIDE_M = 1.2  # from the boat's middle, within which only what stands itself is barred: the boat is there

Cell = tuple[int, int]  # row and column in the square of barriers

_MIDDLE = BARRIER_CELLS // 2
_HERE: Cell = (_MIDDLE, _MIDDLE)


def find_detour_rad(
    barriers: Barriers, here_m: Point, course_rad: float, path_m: Sequence[Point], config: PlannerConfig
) -> float | None:
    """The course along the way round; None where neither it nor the path is barred, or no way round is known.

    barriers: the square around the boat. path_m: points of the path ahead of the boat,
    in the order in which they are due.
    """
    is_barred = _too_near(barriers, config)
    cells = [
        (math.floor(y_m / BARRIER_CELL_M) - barriers.south, math.floor(x_m / BARRIER_CELL_M) - barriers.west)
        for x_m, y_m in path_m
    ]
    cells = [each for each in cells if _is_inside(each)]
    is_straight_barred = _bars_line(is_barred, _ahead(course_rad, min(config.max_range_m, REACH_M)))
    if not is_straight_barred and not any(is_barred[each] for each in cells):
        return None
    row, column = _follow(_steps_to_path(is_barred, cells), is_barred)
    if (row, column) == _HERE:
        return None
    east_m = (barriers.west + column + 0.5) * BARRIER_CELL_M - here_m[0]
    north_m = (barriers.south + row + 0.5) * BARRIER_CELL_M - here_m[1]
    return portable.atan2(north_m, east_m)


def _too_near(barriers: Barriers, config: PlannerConfig) -> Bools:
    """Cells in which the boat's middle would be nearer to a barrier than hull and `tight_margin_m`."""
    radius_m = config.hull_radius_m + config.tight_margin_m
    too_near = distance_field_m(barriers.is_barred) <= radius_m * CELL_M / BARRIER_CELL_M + 1e-9
    off = np.arange(BARRIER_CELLS) - _MIDDLE
    alongside = off[:, None] ** 2 + off[None, :] ** 2 <= (ALONGSIDE_M / BARRIER_CELL_M) ** 2
    return np.asarray(np.where(alongside, barriers.is_barred, too_near))


def _steps_to_path(is_barred: Bools, path: Sequence[Cell]) -> NDArray[np.int32]:
    """How many steps each cell is over unbarred water from the path beyond what first bars it; -1: none or unknown.

    It spreads from that stretch of the path, up to what bars it next, until it comes to the boat: the boat rejoins its
    path where it is nearest, and cuts no corner. By edges and by corners in turn: an octagon.
    """
    steps, is_reached = np.full(is_barred.shape, -1, np.int32), is_barred.copy()
    first = next((number for number, at in enumerate(path) if is_barred[at]), 0)
    beyond = itertools.dropwhile(is_barred.__getitem__, path[first:])
    front = np.zeros_like(is_barred)
    for at in itertools.takewhile(lambda at: not is_barred[at], beyond):
        front[at] = True
    for step in range(4 * BARRIER_CELLS):
        steps[front] = step
        is_reached |= front
        if front[_HERE]:
            break
        front = _spread(front, by_corners=step % 2 == 1) & ~is_reached
    return steps


def _follow(steps: NDArray[np.int32], is_barred: Bools) -> Cell:
    """The farthest cell down the steps that lies straight before the boat, within `AHEAD_M`; its own without any."""
    found = at = _HERE
    for _ in range(round(AHEAD_M / BARRIER_CELL_M)):
        around = [(at[0] + up, at[1] + across) for up in (-1, 0, 1) for across in (-1, 0, 1)]
        nearer = [each for each in around if _is_inside(each) and 0 <= steps[each] < steps[at]]
        if not nearer:
            break
        at = min(nearer, key=lambda each: int(steps[each]))
        if _bars_line(is_barred, at):
            break
        found = at
    return found


def _spread(front: Bools, *, by_corners: bool) -> Bools:
    """The cells and their neighbours."""
    grown = front.copy()
    grown[1:] |= front[:-1]
    grown[:-1] |= front[1:]
    rows = grown.copy() if by_corners else front
    grown[:, 1:] |= rows[:, :-1]
    grown[:, :-1] |= rows[:, 1:]
    return grown


def _is_inside(at: Cell) -> bool:
    return all(0 <= number < BARRIER_CELLS for number in at)


def _ahead(course_rad: float, distance_m: float) -> Cell:
    count = distance_m / BARRIER_CELL_M
    return round(_MIDDLE + count * portable.sin(course_rad)), round(_MIDDLE + count * portable.cos(course_rad))


def _bars_line(is_barred: Bools, end: Cell) -> bool:
    """Whether a cell of the straight line from the boat is barred."""
    count = max(abs(end[0] - _MIDDLE), abs(end[1] - _MIDDLE), 1)
    part = np.arange(count + 1) / count
    rows, columns = (np.rint(_MIDDLE + part * (number - _MIDDLE)).astype(np.int64) for number in end)
    return bool(is_barred[rows, columns].any())
