"""Where RETURN leads: home, or a rally point that is nearer and that the boat can go straight to. Pure."""

from __future__ import annotations

import math

from paani import messages as m
from paani.fence_geometry import find_route_violation

CELLS_PER_BYTE = 4


def choose_place(
    position: m.Waypoint, home: m.Waypoint, mission: m.Mission, occupancy: m.OccupancyGrid | None, margin_m: float
) -> m.Waypoint:
    """The nearest rally point that is nearer than home, inside the fence, off land, and straight ahead; else home.

    A rally point where the boat has seen something is passed over: the way there is a straight line, as the way home.
    """
    home_m = _distance_m(position, home)
    nearer = [point for point in mission.rally if _distance_m(position, point) < home_m]
    for point in sorted(nearer, key=lambda each: _distance_m(position, each)):
        is_inside = find_route_violation(mission.bounds, (point,), margin_m) is None
        is_straight = is_inside and find_route_violation(mission.bounds, (position, point), 0.0) is None
        if is_straight and not is_seen_occupied(point, occupancy):
            return point
    return home


def find_seen_fault(rally: tuple[m.Waypoint, ...], occupancy: m.OccupancyGrid | None) -> str:
    """Which rally point is no water by what the boat has seen; empty where none is known to be so."""
    for number, point in enumerate(rally):
        if is_seen_occupied(point, occupancy):
            return f"rally[{number}]: the boat has seen something there"
    return ""


def is_seen_occupied(point: m.Waypoint, occupancy: m.OccupancyGrid | None) -> bool:
    """Whether something was seen in the cell of a place; not where the grid does not reach, or is not known.

    A cell that the message lacks, though it names it, counts as one where something was seen.
    """
    if occupancy is None:
        return False
    column = math.floor((point.x_m - occupancy.west_m) / occupancy.cell_m)
    row = math.floor((point.y_m - occupancy.south_m) / occupancy.cell_m)
    if not (0 <= column < occupancy.columns and 0 <= row < occupancy.rows):
        return False
    index = row * occupancy.columns + column
    if index // CELLS_PER_BYTE >= len(occupancy.cells):
        return True
    packed = occupancy.cells[index // CELLS_PER_BYTE]
    return (packed >> 2 * (index % CELLS_PER_BYTE)) & 3 == m.Occupancy.OCCUPIED


def _distance_m(one: m.Waypoint, other: m.Waypoint) -> float:
    return math.dist((one.x_m, one.y_m), (other.x_m, other.y_m))
