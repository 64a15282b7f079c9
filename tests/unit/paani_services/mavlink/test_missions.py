"""Mission, fence and rally points as they are downloaded."""

from __future__ import annotations

import math

import pytest
from msgspec.structs import replace
from pymavlink.dialects.v20 import common

from paani import messages as m
from paani.geometry import enu_from_geodetic
from paani.map_origin import map_origin_deg
from paani_services.mavlink.missions import (
    EMPTY,
    FENCE,
    MISSION,
    RALLY,
    Plan,
    current_seq,
    mission_current,
    mission_item,
    plan_of,
)
from tests.mavlink_peer import NOW_US, armed, in_order, odometry

HOME = m.Waypoint(x_m=-5.0, y_m=7.0)
POINTS = tuple(m.Waypoint(x_m=x, y_m=y) for x, y in ((0.0, 0.0), (60.0, 0.0), (60.0, -40.0)))
LEGS = (
    m.MissionLeg(kind=m.LegKind.HOLD_STATION, waypoints=POINTS[:1], radius_m=3.0, duration_s=20.0),
    m.MissionLeg(kind=m.LegKind.FOLLOW_ROUTE, waypoints=POINTS, repeat=True, laps=3, speed_mps=0.4),
    m.MissionLeg(kind=m.LegKind.HOLD_STATION, radius_m=2.0),
    m.MissionLeg(kind=m.LegKind.RETURN_HOME),
    m.MissionLeg(kind=m.LegKind.STOP),
)
AREAS = (
    m.FenceArea(keep=m.Keep.IN, corners=POINTS),
    m.FenceArea(keep=m.Keep.OUT, corners=(*POINTS, m.Waypoint(x_m=1.0, y_m=2.0))),
)
WHOLE = m.Mission(source_us=NOW_US, name="a", legs=LEGS, fence=AREAS)
KNOWN_HOME = m.Prediction(source_us=NOW_US, home=(HOME,))


def plan() -> Plan:
    return plan_of(in_order(mission=WHOLE, prediction=KNOWN_HOME))


def place_m(place_e7: tuple[int, int]) -> tuple[float, float]:
    return enu_from_geodetic(place_e7[0] * 1e-7, place_e7[1] * 1e-7, *map_origin_deg(odometry()))


def test_each_leg_becomes_items_of_the_protocol() -> None:
    """Home first, as ArduPilot has it; a speed stands before its leg, a repetition after it."""
    items = plan().items[MISSION]
    assert [item.command for item in items] == [16, 19, 178, 16, 16, 16, 177, 178, 17, 20, 176]
    assert items[0].frame == common.MAV_FRAME_GLOBAL
    assert {item.frame for item in items[1:]} == {common.MAV_FRAME_GLOBAL_RELATIVE_ALT}
    assert place_m(items[0].place_e7) == pytest.approx((HOME.x_m, HOME.y_m), abs=0.02)
    for item, point in zip(items[3:6], POINTS, strict=True):
        assert place_m(item.place_e7) == pytest.approx((point.x_m, point.y_m), abs=0.02)
    assert items[1].parameters[:3] == (20.0, 0.0, 3.0)
    assert items[2].parameters == (1.0, 0.4, -1.0, 0.0)
    assert items[6].parameters[:2] == (3.0, 2.0)  # back to the route's first, twice more
    assert items[7].parameters == (1.0, -2.0, -1.0, 0.0)  # the speed that the boat would go by itself
    assert (items[8].place_e7, items[9].place_e7) == ((0, 0), (0, 0))
    assert items[10].parameters[:2] == (1.0, 4.0)


def test_a_route_without_a_mission_goes_round_without_end() -> None:
    route = m.Route(source_us=NOW_US, name="r", waypoints=POINTS)
    items = plan_of(in_order(route=route)).items[MISSION]
    assert [item.command for item in items] == [16, 16, 16, 16, 177]
    assert items[-1].parameters[:2] == (1.0, -1.0)
    assert items[0].place_e7 == (0, 0)  # home is not known before the boat was armed
    once = plan_of(in_order(route=m.Route(source_us=NOW_US, name="r", waypoints=POINTS, repeat=False)))
    assert [item.command for item in once.items[MISSION]] == [16, 16, 16, 16]


def test_each_corner_of_the_fence_says_how_many_there_are() -> None:
    items = plan().items[FENCE]
    assert [(item.command, item.parameters[0]) for item in items] == [(5001, 3.0)] * 3 + [(5002, 4.0)] * 4
    assert place_m(items[1].place_e7) == pytest.approx((60.0, 0.0), abs=0.02)
    assert plan().items[RALLY] == ()


def test_rally_points_are_items_of_their_own() -> None:
    snapshot = in_order(mission=replace(WHOLE, rally=POINTS[1:]), prediction=KNOWN_HOME)
    items = plan_of(snapshot).items[RALLY]
    assert [(item.command, item.frame) for item in items] == [(5100, common.MAV_FRAME_GLOBAL_RELATIVE_ALT)] * 2
    for item, point in zip(items, POINTS[1:], strict=True):
        assert place_m(item.place_e7) == pytest.approx((point.x_m, point.y_m), abs=0.02)


@pytest.mark.parametrize("unknown", [{"mission": None}, {"odometry": None}, {"odometry": odometry(healthy=False)}])
def test_what_is_not_known_is_not_downloaded(unknown: dict[str, object]) -> None:
    assert plan_of(in_order(**{"mission": WHOLE, **unknown})) == EMPTY


@pytest.mark.parametrize(
    ("leg", "waypoint", "seq"), [(0, 0, 1), (1, 0, 3), (1, 2, 5), (2, 0, 8), (2, 9, 8), (4, 0, 10), (9, 9, 0)]
)
def test_the_item_that_is_steered_for(leg: int, waypoint: int, seq: int) -> None:
    order = m.NavCommand(
        source_us=NOW_US, enable=True, heading_rad=0.0, speed_mps=0.5, leg_index=leg, waypoint_index=waypoint
    )
    assert current_seq(armed(command=order), plan()) == seq
    assert current_seq(armed(command=None), plan()) == 0
    item = mission_item(plan(), MISSION, seq, seq, (255, 190))
    assert item is not None
    assert item.current == 1


def test_how_far_the_mission_is() -> None:
    def state(snapshot: object) -> int:
        return int(mission_current(snapshot, plan()).mission_state)  # type: ignore[arg-type]

    done = m.NavCommand(source_us=0, enable=False, heading_rad=0.0, speed_mps=0.0, inhibits=(m.Inhibit.MISSION_DONE,))
    assert state(armed()) == common.MISSION_STATE_ACTIVE
    assert state(in_order()) == common.MISSION_STATE_PAUSED
    holding = m.OperatorState(source_us=0, armed=True, stopped=False, mode=m.DriveMode.HOLD)
    assert state(armed(operator=holding)) == common.MISSION_STATE_PAUSED
    assert (
        mission_current(armed(), plan()).mission_mode,
        mission_current(armed(operator=holding), plan()).mission_mode,
    ) == (1, 2)
    assert state(armed(command=done)) == common.MISSION_STATE_COMPLETE
    assert state(armed(command=None)) == common.MISSION_STATE_UNKNOWN
    assert mission_current(armed(), EMPTY).mission_state == common.MISSION_STATE_NO_MISSION
    assert mission_current(armed(mission=WHOLE), EMPTY).mission_state == common.MISSION_STATE_UNKNOWN
    home_alone = plan_of(in_order(mission=m.Mission(source_us=NOW_US, name="", legs=()), prediction=KNOWN_HOME))
    for nothing in (EMPTY, home_alone):
        current = mission_current(armed(), nothing)
        assert (current.total, current.mission_state) == (65_535, common.MISSION_STATE_NO_MISSION)
    assert mission_current(armed(), plan()).total == 10  # home is none of them


@pytest.mark.parametrize("seq", [-1, 11, 65_535])
def test_there_is_no_item_beyond_the_last(seq: int) -> None:
    assert mission_item(plan(), MISSION, seq, 0, (255, 190)) is None


def test_a_waypoint_gives_no_heading() -> None:
    item = mission_item(plan(), MISSION, 4, 0, (255, 190))
    assert item is not None
    assert math.isnan(item.param4)
    assert item.param2 == 0.0
