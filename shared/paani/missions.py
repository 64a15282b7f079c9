"""What is wrong with a mission, a fence or rally points, whoever made them: file, page, command, station. Pure.

A fault is one line for whoever made it, and names leg, waypoint, area, corner or rally point.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable

from paani.fence_geometry import LAND_WORDS, Fence, do_segments_meet, find_route_violation
from paani.messages import FenceArea, LegKind, Mission, MissionLeg, Route, Waypoint

MAX_LEGS, MAX_LAPS = 100, 1_000_000
MAX_WAYPOINTS = 10_000  # of a route or mission: the nearest leg is sought among all of them
MIN_LEG_M = 0.01  # waypoints nearer to each other than this are the same: a leg this short has no direction
MIN_RADIUS_M, MAX_RADIUS_M = 1.0, 1e3  # of a station; a boat would never rest within a radius below its own length
MAX_CORNERS = 1000  # of fence and land together: every edge is tested at each step of the navigator, ten times a second
MAX_PAIRS = 1_000_000  # of a waypoint and a corner: each leg is tested against each edge, before a mission is accepted
MAX_RALLY = 20
MAX_RALLY_PAIRS = 5000  # of a rally point and a corner: the way to each is tested in the moment RETURN is ordered
MIN_AREA_M2 = 1.0  # of one area: less is a slip of the pen, not water or land
MAX_NUMBER = 1e9  # what a message takes of a speed or a time
MAX_DISTANCE_M = 1e6  # of a point from the map's origin; a plane is no map long before that

WAYPOINT_COUNTS = {  # fewest and most of a leg
    LegKind.FOLLOW_ROUTE: (2, MAX_WAYPOINTS),
    LegKind.HOLD_STATION: (0, 1),
    LegKind.RETURN_HOME: (0, 1),
    LegKind.STOP: (0, 0),
}


def mission_of_route(route: Route) -> Mission:
    """The mission of a boat that has only a route: followed once, or without end if it repeats."""
    laps = 0 if route.repeat else 1
    leg = MissionLeg(kind=LegKind.FOLLOW_ROUTE, waypoints=route.waypoints, repeat=route.repeat, laps=laps)
    return Mission(source_us=route.source_us, name=route.name, legs=(leg,))


def count_corners(bounds: Fence) -> int:
    """Of all areas together."""
    return sum(len(area.corners) for area in bounds)


def find_mission_fault(
    legs: tuple[MissionLeg, ...], fence: Fence, margin_m: float, rally: tuple[Waypoint, ...] = (), land: Fence = ()
) -> str:
    """Why the navigator could not take these legs and rally points within this fence, off land; empty where it can.

    margin_m: the least distance of a waypoint, leg or rally point from an edge. No number is out of bounds.
    """
    fault = _find_fence_fault(fence, land) or _find_legs_fault(legs) or _find_size_fault(legs, (*fence, *land))
    return fault or _find_violation(legs, fence, margin_m, land) or find_rally_fault(rally, fence, margin_m, land)


def find_rally_fault(rally: tuple[Waypoint, ...], fence: Fence, margin_m: float, land: Fence = ()) -> str:
    """What is wrong with the first rally point that cannot be returned to; empty where nothing is."""
    corners_n = count_corners((*fence, *land))
    if len(rally) > MAX_RALLY:
        return f"rally: has {len(rally)}, more than {MAX_RALLY}"
    if len(rally) * corners_n > MAX_RALLY_PAIRS:
        return f"rally: {len(rally)} times {corners_n} corners of the fence is more than {MAX_RALLY_PAIRS}"
    fault = _find_point_fault(rally, "rally")
    if fault:
        return fault
    for number, point in enumerate(rally):
        found = _find_beyond((point,), fence, land, margin_m)
        if found is not None:
            return f"rally[{number}]: {found[1]}"
    return ""


def find_home_fault(home: tuple[Waypoint, ...], fence: Fence, margin_m: float, land: Fence = ()) -> str:
    """Why the boat could not keep its station at home; empty where it can, or where no home is named."""
    found = _find_beyond(home, fence, land, margin_m)
    return "" if found is None else f"home: {found[1]}"


def find_leg_outside(
    legs: tuple[MissionLeg, ...], fence: Fence, margin_m: float, land: Fence = ()
) -> tuple[int, int, str] | None:
    """Leg, waypoint and what is wrong with it, of the first beyond fence or shore, or nearer than the margin to it."""
    for number, leg in enumerate(legs):
        found = _find_beyond(leg.waypoints, fence, land, margin_m, repeat=leg.repeat)
        if found is not None:
            return number, *found
    return None


def find_polygon_fault(area: FenceArea) -> str:
    """What is wrong with an area: too few corners, an edge without length, edges that cross, hardly any area."""
    corners = [(corner.x_m, corner.y_m) for corner in area.corners]
    if len(corners) < 3:
        return f"has {len(corners)} corners, an area needs 3"
    edges = list(itertools.pairwise((*corners, corners[0])))
    for number, (start, end) in enumerate(edges):
        if math.dist(start, end) < MIN_LEG_M:
            return f"corners[{number}] and the next are the same"
    for (one, first), (other, second) in itertools.combinations(enumerate(edges), 2):
        if other - one not in {1, len(edges) - 1} and do_segments_meet(first, second):
            return f"the edges from corners[{one}] and corners[{other}] cross"
    if abs(sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in edges)) / 2.0 < MIN_AREA_M2:
        return f"has an area below {MIN_AREA_M2} m2"
    return ""


def find_repeated_waypoint(waypoints: tuple[Waypoint, ...], *, repeat: bool) -> int | None:
    """The first waypoint that is the same as the next; with repeat the first comes after the last."""
    ring = (*waypoints, *waypoints[:1]) if repeat else waypoints
    for number, (start, end) in enumerate(itertools.pairwise(ring)):
        if math.dist((start.x_m, start.y_m), (end.x_m, end.y_m)) < MIN_LEG_M:
            return number
    return None


def _find_beyond(
    waypoints: tuple[Waypoint, ...], fence: Fence, land: Fence, margin_m: float, *, repeat: bool = False
) -> tuple[int, str] | None:
    """The first waypoint that the fence forbids, or its leg to the next; else the first that land does."""
    found = find_route_violation(fence, waypoints, margin_m, repeat=repeat)
    if found is None and land:
        found = find_route_violation(land, waypoints, margin_m, repeat=repeat, words=LAND_WORDS)
    return found


def _find_size_fault(legs: tuple[MissionLeg, ...], bounds: Fence) -> str:
    waypoints_n, corners_n = sum(len(leg.waypoints) for leg in legs), count_corners(bounds)
    if waypoints_n * corners_n > MAX_PAIRS:
        return f"legs: {waypoints_n} waypoints times {corners_n} corners of the fence is more than {MAX_PAIRS}"
    return ""


def _find_fence_fault(fence: Fence, land: Fence) -> str:
    if count_corners((*fence, *land)) > MAX_CORNERS:
        return f"fence: more than {MAX_CORNERS} corners{f', {count_corners(land)} of them of land' if land else ''}"
    for number, area in enumerate(fence):
        at = f"areas[{number}]"
        fault = _find_point_fault(area.corners, f"{at}.corners")
        if fault:
            return fault
        fault = find_polygon_fault(area)
        if fault:
            return f"{at}{'.' if fault.startswith('corners') else ' '}{fault}"
    return ""


def _find_legs_fault(legs: tuple[MissionLeg, ...]) -> str:
    if len(legs) > MAX_LEGS:
        return f"legs: has {len(legs)}, more than {MAX_LEGS}"
    if sum(len(leg.waypoints) for leg in legs) > MAX_WAYPOINTS:
        return f"legs: more than {MAX_WAYPOINTS} waypoints together"
    faults = (_find_leg_fault(leg, f"legs[{number}]") for number, leg in enumerate(legs))
    fault = next(filter(None, faults), "")
    if fault:
        return fault
    for number, leg in enumerate(legs[:-1]):
        if leg.kind is LegKind.FOLLOW_ROUTE and leg.laps == 0:
            return f"legs[{number}].laps: 0 has no end, so no leg may come after it"
    return ""


def _find_leg_fault(leg: MissionLeg, at: str) -> str:
    fewest, most = WAYPOINT_COUNTS[leg.kind]
    if not fewest <= len(leg.waypoints) <= most:
        return f"{at}.waypoints: has {len(leg.waypoints)}, {leg.kind} takes {fewest} to {most}"
    fault = _find_point_fault(leg.waypoints, f"{at}.waypoints")
    if fault:
        return fault
    if not (0.0 <= leg.speed_mps <= MAX_NUMBER and 0.0 <= leg.duration_s <= MAX_NUMBER):
        return f"{at}: speed_mps and duration_s are numbers from 0 to {MAX_NUMBER:g}"
    if leg.kind is LegKind.HOLD_STATION and not MIN_RADIUS_M <= leg.radius_m <= MAX_RADIUS_M:
        return f"{at}.radius_m: {leg.radius_m:g} is not in {MIN_RADIUS_M:g}..{MAX_RADIUS_M:g}"
    if leg.kind is not LegKind.FOLLOW_ROUTE:
        return ""
    if leg.laps > MAX_LAPS or (leg.laps != 1 and not leg.repeat):
        return f"{at}.laps: {leg.laps}, but " + (f"at most {MAX_LAPS}" if leg.repeat else "the route does not repeat")
    repeated = find_repeated_waypoint(leg.waypoints, repeat=leg.repeat)
    return "" if repeated is None else f"{at}.waypoints[{repeated}] and the next are the same"


def _find_violation(legs: tuple[MissionLeg, ...], fence: Fence, margin_m: float, land: Fence) -> str:
    found = find_leg_outside(legs, fence, margin_m, land)
    return "" if found is None else f"legs[{found[0]}].waypoints[{found[1]}]: {found[2]}"


def _find_point_fault(points: Iterable[Waypoint], at: str) -> str:
    for number, point in enumerate(points):
        if not (abs(point.x_m) <= MAX_DISTANCE_M and abs(point.y_m) <= MAX_DISTANCE_M):
            return f"{at}[{number}]: is not within {MAX_DISTANCE_M / 1000:g} km of the map's origin"
    return ""
