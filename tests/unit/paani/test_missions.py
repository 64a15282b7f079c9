"""What is wrong with a mission, by whichever way it came."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest

from paani.messages import FenceArea, Keep, LegKind, MissionLeg, Route, Waypoint
from paani.missions import MAX_CORNERS, MAX_LEGS, MAX_WAYPOINTS, find_mission_fault, mission_of_route

MARGIN_M = 1.0


def points(*places: tuple[float, float]) -> tuple[Waypoint, ...]:
    return tuple(Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in places)


ROUTE = MissionLeg(kind=LegKind.FOLLOW_ROUTE, waypoints=points((0, 0), (20, 0), (20, 10)))
STATION = MissionLeg(kind=LegKind.HOLD_STATION, waypoints=points((20, 10)), radius_m=3.0, duration_s=60.0)
HOME, STOP = MissionLeg(kind=LegKind.RETURN_HOME), MissionLeg(kind=LegKind.STOP)
LEGS = (ROUTE, STATION, HOME, STOP)
BASIN = FenceArea(keep=Keep.IN, corners=points((-9, -9), (40, -9), (40, 40), (-9, 40)))
REEDS = FenceArea(keep=Keep.OUT, corners=points((8, -3), (12, -3), (10, 4)))


def changed(leg: MissionLeg, **fields: Any) -> MissionLeg:
    return msgspec.structs.replace(leg, **fields)


def changed_corners(area: FenceArea, *places: tuple[float, float]) -> FenceArea:
    return msgspec.structs.replace(area, corners=points(*places))


def line(count: int) -> tuple[Waypoint, ...]:
    return points(*((float(number), 0.0) for number in range(count)))


@pytest.mark.slow
def test_a_mission_that_can_be_sailed_has_no_fault() -> None:
    assert find_mission_fault(LEGS, (BASIN,), MARGIN_M) == ""
    assert find_mission_fault((), (), MARGIN_M) == ""
    assert find_mission_fault((changed(ROUTE, waypoints=line(MAX_WAYPOINTS)),), (), MARGIN_M) == ""
    assert find_mission_fault((changed(ROUTE, repeat=True, laps=0),), (), MARGIN_M) == ""
    assert find_mission_fault((changed(STOP, repeat=True),), (BASIN,), MARGIN_M) == "", "what a leg has no use for"


@pytest.mark.parametrize(
    ("legs", "fault"),
    [
        ((STOP,) * (MAX_LEGS + 1), "legs: has 101, more than 100"),
        ((changed(ROUTE, waypoints=line(MAX_WAYPOINTS)), STATION), "legs: more than 10000 waypoints together"),
        ((changed(ROUTE, waypoints=points((1, 1))),), "legs[0].waypoints: has 1, follow_route takes 2 to 10000"),
        ((ROUTE, changed(STATION, waypoints=line(2))), "legs[1].waypoints: has 2, hold_station takes 0 to 1"),
        ((changed(STOP, waypoints=line(1)),), "legs[0].waypoints: has 1, stop takes 0 to 0"),
        ((changed(ROUTE, waypoints=points((0, 0), (math.nan, 1))),), "legs[0].waypoints[1]: is not within 1000 km"),
        ((changed(ROUTE, waypoints=points((0, 0), (1, -math.inf))),), "legs[0].waypoints[1]: is not within 1000 km"),
        ((changed(ROUTE, waypoints=points((1.1e6, 0), (0, 1))),), "legs[0].waypoints[0]: is not within 1000 km"),
        ((changed(ROUTE, waypoints=points((0, 0), (0, 0.001))),), "legs[0].waypoints[0] and the next are the same"),
        (
            (changed(ROUTE, repeat=True, laps=2, waypoints=points((0, 0), (5, 5), (0, 0.001))),),
            "legs[0].waypoints[2] and the next are the same",
        ),
        ((changed(ROUTE, laps=2),), "legs[0].laps: 2, but the route does not repeat"),
        ((changed(ROUTE, repeat=True, laps=1_000_001),), "legs[0].laps: 1000001, but at most 1000000"),
        ((changed(ROUTE, repeat=True, laps=0), HOME), "legs[0].laps: 0 has no end, so no leg may come after it"),
        ((changed(ROUTE, speed_mps=math.nan),), "legs[0]: speed_mps and duration_s are numbers from 0"),
        ((changed(STATION, duration_s=math.inf),), "legs[0]: speed_mps and duration_s are numbers from 0"),
        ((changed(STATION, radius_m=0.5),), "legs[0].radius_m: 0.5 is not in 1..1000"),
        ((changed(STATION, radius_m=math.nan),), "legs[0].radius_m: nan is not in 1..1000"),
        ((ROUTE, changed(STATION, waypoints=points((20, 60)))), "legs[1].waypoints[0]: is outside the fence"),
        ((changed(ROUTE, waypoints=points((0, 0), (39.5, 0))),), "legs[0].waypoints[1]: is nearer than 1.0 m"),
    ],
)
def test_a_fault_of_a_leg_is_named(legs: tuple[MissionLeg, ...], fault: str) -> None:
    assert find_mission_fault(legs, (BASIN,), MARGIN_M).startswith(fault)


@pytest.mark.parametrize(
    ("fence", "fault"),
    [
        ((BASIN, REEDS), "legs[0].waypoints[0]: the leg to the next leaves the fence"),
        ((BASIN, FenceArea(keep=Keep.OUT, corners=line(2))), "areas[1] has 2 corners, an area needs 3"),
        ((FenceArea(keep=Keep.IN, corners=points((0, 0), (9, 0), (9, 0.001), (0, 9))),), "areas[0].corners[1] and the"),
        ((FenceArea(keep=Keep.IN, corners=points((0, 0), (9, 9), (9, 0), (0, 9))),), "areas[0] the edges from"),
        ((FenceArea(keep=Keep.IN, corners=points((0, 0), (0.5, 0), (0, 0.5))),), "areas[0] has an area below"),
        ((FenceArea(keep=Keep.IN, corners=points((0, 0), (9, 0), (math.nan, 9))),), "areas[0].corners[2]: is not"),
        ((FenceArea(keep=Keep.IN, corners=line(MAX_CORNERS + 1)),), "fence: more than 1000 corners"),
    ],
)
def test_a_fault_of_a_fence_is_named(fence: tuple[FenceArea, ...], fault: str) -> None:
    assert find_mission_fault(LEGS, fence, MARGIN_M).startswith(fault)


def test_land_is_judged_as_an_area_that_keeps_out_and_named() -> None:
    island = changed_corners(REEDS, (30, -3), (34, -3), (34, 3), (30, 3))
    assert find_mission_fault(LEGS, (BASIN,), MARGIN_M, land=(island,)) == ""
    across = changed(ROUTE, waypoints=points((0, 0), (20, 0), (38, 0)))
    for legs, rally, fault in (
        ((across,), (), "legs[0].waypoints[1]: the leg to the next crosses land"),
        ((changed(STATION, waypoints=points((31, 0))),), (), "legs[0].waypoints[0]: is on land"),
        ((), points((0, 0), (29.5, 0)), "rally[1]: is nearer than 1.0 m to land"),
    ):
        assert find_mission_fault(legs, (BASIN,), MARGIN_M, rally, (island,)) == fault
        assert find_mission_fault(legs, (BASIN,), MARGIN_M, rally) == ""
    shore = changed_corners(REEDS, *((60 + math.cos(n / 160), math.sin(n / 160)) for n in range(997)))
    assert find_mission_fault(LEGS, (BASIN, REEDS), MARGIN_M, land=(shore,)) == (
        "fence: more than 1000 corners, 997 of them of land"
    )


@pytest.mark.parametrize(
    ("corners", "fault"),
    [
        (100, "legs[0].waypoints[0]: is outside the fence"),
        (101, "legs: 10000 waypoints times 101 corners of the fence is more than 1000000"),
    ],
)
def test_what_would_take_long_to_check_is_refused_at_once(corners: int, fault: str) -> None:
    angles = (math.tau * number / corners for number in range(corners))
    lake = FenceArea(keep=Keep.IN, corners=points(*((math.cos(a) - 50.0, math.sin(a)) for a in angles)))
    assert find_mission_fault((changed(ROUTE, waypoints=line(MAX_WAYPOINTS)),), (lake,), MARGIN_M) == fault


@pytest.mark.parametrize(
    ("rally", "corners", "fault"),
    [
        (points((1, 0), (2, 0)), 4, ""),
        (points((1, 0)) * 21, 4, "rally: has 21, more than 20"),
        (points((1, 0)) * 20, 251, "rally: 20 times 251 corners of the fence is more than 5000"),
        (points((1, 0), (math.nan, 0)), 4, "rally[1]: is not within 1000 km of the map's origin"),
        (points((1, 0), (2e6, 0)), 4, "rally[1]: is not within 1000 km of the map's origin"),
        (points((1, 0), (99, 0)), 4, "rally[1]: is outside the fence"),
        (points((49, 0)), 4, "rally[0]: is nearer than 2.0 m to the fence"),
    ],
)
def test_a_fault_of_a_rally_point_is_named(rally: tuple[Waypoint, ...], corners: int, fault: str) -> None:
    ring = points(*((50 * math.cos(at), 50 * math.sin(at)) for at in (math.tau * n / corners for n in range(corners))))
    fence = (FenceArea(keep=Keep.IN, corners=ring),)
    assert find_mission_fault((), fence, 2.0, rally) == fault


def test_a_route_alone_is_followed_once_or_without_end() -> None:
    for repeat, laps in ((True, 0), (False, 1)):
        (leg,) = mission_of_route(Route(source_us=3, name="r", waypoints=ROUTE.waypoints, repeat=repeat)).legs
        assert (leg.kind, leg.waypoints, leg.repeat, leg.laps) == (LegKind.FOLLOW_ROUTE, ROUTE.waypoints, repeat, laps)
