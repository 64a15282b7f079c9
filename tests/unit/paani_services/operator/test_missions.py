"""Missions that clients send: accepted where they move nothing, else refused, and the one before stays."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from paani import messages as m
from paani.keys import STATION
from paani.messages import DriveMode, MissionRefusal
from paani_services.operator import missions
from paani_services.operator.wheel import Facts
from tests.unit.paani_services.operator.test_console import Desk


def points(*places: tuple[float, float]) -> tuple[m.Waypoint, ...]:
    return tuple(m.Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in places)


LEGS = (m.MissionLeg(kind=m.LegKind.FOLLOW_ROUTE, waypoints=points((0, 0), (20, 0))),)
FENCE = (m.FenceArea(keep=m.Keep.IN, corners=points((-9, -9), (40, -9), (40, 9), (-9, 9))),)
NARROW = (m.FenceArea(keep=m.Keep.IN, corners=points((-9, -9), (10, -9), (10, 9), (-9, 9))),)
FILES = m.Mission(source_us=1, name="files", legs=LEGS, fence=FENCE)
OTHER = (m.MissionLeg(kind=m.LegKind.RETURN_HOME),)
SENT = m.MissionRequest(source_us=1, press=9, hand=3, name="sent", legs=OTHER, fence=FENCE)
FREE = missions.Situation(mode=DriveMode.ROUTE, armed=False, present=FILES, may_steer=True)


@pytest.mark.parametrize(
    ("changes", "refusal"),
    [
        ({}, MissionRefusal.NONE),
        ({"armed": True}, MissionRefusal.UNDER_WAY),
        ({"armed": True, "mode": DriveMode.HOLD}, MissionRefusal.NONE),
        ({"armed": True, "mode": DriveMode.RETURN}, MissionRefusal.NONE),
        ({"armed": True, "mode": DriveMode.MANUAL}, MissionRefusal.NONE),
        ({"armed": True, "mode": DriveMode.IDLE}, MissionRefusal.NONE),
        ({"may_steer": False}, MissionRefusal.NOT_HOLDER),
        ({"is_arming": True}, MissionRefusal.BUSY),
        ({"present": None}, MissionRefusal.NOT_KNOWN),
    ],
)
def test_a_mission_is_accepted_where_it_moves_nothing(changes: dict[str, Any], refusal: MissionRefusal) -> None:
    assert missions.find_refusal(SENT, replace(FREE, **changes)) is refusal


@pytest.mark.parametrize("mode", [DriveMode.HOLD, DriveMode.RETURN, DriveMode.MANUAL])
def test_another_fence_frees_no_boat_that_it_held(mode: DriveMode) -> None:
    """An armed boat that the fence holds would begin to move without it; in IDLE, and disarmed, none does."""
    armed, none = replace(FREE, armed=True, mode=mode), replace(SENT, fence=())
    assert missions.find_refusal(none, armed) is MissionRefusal.FENCE_IN_USE
    assert missions.find_refusal(replace(none, keep_fence=True), armed) is MissionRefusal.NONE
    assert missions.find_refusal(none, replace(armed, mode=DriveMode.IDLE)) is MissionRefusal.NONE
    assert missions.find_refusal(none, replace(armed, armed=False)) is MissionRefusal.NONE


def test_what_is_kept_stays_and_legs_that_stay_keep_their_stamp() -> None:
    both = missions.merge(SENT, FILES, 50)
    assert (both.name, both.legs, both.fence, both.accepted_us, both.legs_us) == ("sent", OTHER, FENCE, 50, 50)
    fence = missions.merge(replace(SENT, fence=NARROW, keep_legs=True), both, 60)
    assert (fence.name, fence.legs, fence.fence, fence.accepted_us, fence.legs_us) == ("sent", OTHER, NARROW, 60, 50)
    assert missions.merge(SENT, replace(FILES, home=points((3, 0))), 50).home == points((3, 0))
    assert missions.merge(SENT, replace(FILES, land=NARROW), 50).land == NARROW, "no client takes land away"
    legs = missions.merge(replace(SENT, fence=NARROW, keep_fence=True), both, 40)
    assert (legs.fence, legs.accepted_us) == (FENCE, 51), "a clock that was set back names no two missions alike"


def test_rally_points_move_nothing_in_any_mode_but_route_and_stay_where_they_are_kept() -> None:
    rally = points((3, 0))
    sent = replace(SENT, rally=rally, keep_legs=True, keep_fence=True)
    for mode in DriveMode:
        refusal = MissionRefusal.UNDER_WAY if mode is DriveMode.ROUTE else MissionRefusal.NONE
        assert missions.find_refusal(sent, replace(FREE, armed=True, mode=mode)) is refusal
    mission = missions.merge(sent, FILES, 50)
    assert (mission.legs, mission.fence, mission.rally, mission.legs_us) == (LEGS, FENCE, rally, 0)
    assert missions.merge(replace(SENT, keep_rally=True), mission, 60).rally == rally
    assert missions.merge(SENT, mission, 60).rally == ()


class MissionDesk(Desk):
    """A console that knows the mission of the files."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.console._read_facts = lambda: Facts(has_mission=True, mission=FILES)

    async def send(self, request: m.MissionRequest = SENT, client: str = STATION) -> m.OperatorState:
        await self.console.answer_mission(client, request)
        state: m.OperatorState = self.states.messages[-1]
        assert (state.mission_answered_by, state.mission_answered) == (client, request.press)
        return state


async def test_an_accepted_mission_is_published_before_the_order_that_names_it(tmp_path: Path) -> None:
    desk = MissionDesk(tmp_path)
    desk.orders.messages = desk.missions.messages
    state = await desk.send()
    mission, order = desk.missions.messages
    assert (mission.legs, mission.name, mission.accepted_us) == (OTHER, "sent", state.mission_us)
    assert order.mission_us == mission.accepted_us
    assert state.mission_refusal is MissionRefusal.NONE
    assert not any(word.armed for word in desk.arming.messages)
    assert state.mode is DriveMode.ROUTE


async def test_a_mission_that_leaves_its_fence_is_refused_and_the_one_before_stays(tmp_path: Path) -> None:
    desk = MissionDesk(tmp_path)
    state = await desk.send(replace(SENT, legs=LEGS, fence=NARROW))
    assert state.mission_refusal is MissionRefusal.INVALID
    assert state.mission_fault == "legs[0].waypoints[1]: is outside the fence"
    state = await desk.send(replace(SENT, press=10, fence=NARROW, keep_legs=True))
    assert state.mission_fault.endswith("is outside the fence"), "the legs of the files within another fence"
    assert (state.mission_us, desk.missions.messages) == (0, [])


async def test_a_mission_across_land_is_refused_whatever_fence_comes_with_it(tmp_path: Path) -> None:
    desk = MissionDesk(tmp_path)
    island = replace(NARROW[0], keep=m.Keep.OUT, corners=points((4, -2), (6, -2), (5, 2)))
    desk.console._read_facts = lambda: Facts(mission=replace(FILES, land=(island,)))
    state = await desk.send(replace(SENT, legs=LEGS, fence=()))
    assert state.mission_fault == "legs[0].waypoints[0]: the leg to the next crosses land"


async def test_a_rally_point_outside_the_fence_or_on_what_was_seen_is_refused_and_those_before_stay(
    tmp_path: Path,
) -> None:
    desk = MissionDesk(tmp_path)
    seen = m.OccupancyGrid(source_us=1, west_m=0.0, south_m=0.0, cell_m=1.0, columns=4, rows=1, cells=b"\x80")
    desk.console._read_facts = lambda: Facts(mission=FILES, occupancy=seen)
    alone = replace(SENT, keep_legs=True, keep_fence=True, rally=points((1, 0)))
    mission_us = (await desk.send(alone)).mission_us
    for number, (place, fault) in enumerate((
        ((60, 0), "rally[1]: is outside the fence"),
        ((3.5, 0.5), "rally[1]: the boat has seen something there"),
    )):  # fmt: skip
        state = await desk.send(replace(alone, press=20 + number, rally=points((1, 0), place)))
        assert (state.mission_refusal, state.mission_fault) == (MissionRefusal.INVALID, fault)
    state = await desk.send(replace(SENT, press=30, legs=(), fence=NARROW[:0], keep_rally=True))
    assert state.mission_refusal is MissionRefusal.NONE, "rally points that are kept are not looked at again"
    assert desk.console.mission.rally == points((1, 0))
    assert mission_us < state.mission_us
    narrow = replace(SENT, legs=(), fence=NARROW, keep_rally=True)
    assert (await desk.send(replace(alone, press=32, rally=points((20, 0))))).mission_refusal is MissionRefusal.NONE
    assert (await desk.send(replace(narrow, press=33))).mission_fault == "rally[0]: is outside the fence"


async def test_under_way_nothing_changes_and_in_idle_it_does(tmp_path: Path) -> None:
    desk = MissionDesk(tmp_path)
    await desk.arm()
    assert (await desk.send()).mission_refusal is MissionRefusal.UNDER_WAY
    await desk.order(m.RequestAct.MODE, 2, DriveMode.IDLE)
    assert (await desk.send(replace(SENT, press=10), "mission")).mission_refusal is MissionRefusal.NOT_HOLDER
    state = await desk.send(replace(SENT, press=11))
    assert (state.mission_refusal, state.mode, state.armed) == (MissionRefusal.NONE, DriveMode.IDLE, True)


async def test_a_mode_that_is_ordered_while_a_mission_is_checked_counts(tmp_path: Path) -> None:
    desk = MissionDesk(tmp_path)
    await desk.arm()
    await desk.order(m.RequestAct.MODE, 2, DriveMode.IDLE)
    sending = asyncio.create_task(desk.send())
    await asyncio.sleep(0)
    await desk.order(m.RequestAct.MODE, 3, DriveMode.ROUTE)
    assert (await sending).mission_refusal is MissionRefusal.UNDER_WAY
    assert desk.missions.messages == []


async def test_two_clients_at_once_and_a_request_that_is_said_again(tmp_path: Path) -> None:
    desk = MissionDesk(tmp_path)
    first = asyncio.create_task(desk.console.answer_mission(STATION, SENT))
    await asyncio.sleep(0)
    assert (await desk.send(replace(SENT, press=4), "mavlink")).mission_refusal is MissionRefusal.BUSY
    await first
    accepted_us = desk.console.mission.accepted_us
    desk.clock.advance(1.0)
    state = await desk.send()
    assert (state.mission_refusal, state.mission_us) == (MissionRefusal.NONE, accepted_us)
    assert len(desk.missions.messages) == 1


async def test_without_legs_there_is_nothing_to_follow(tmp_path: Path) -> None:
    desk = MissionDesk(tmp_path)
    state = await desk.send(replace(SENT, name="", legs=(), keep_fence=True))
    assert state.mission_refusal is MissionRefusal.NONE
    assert m.BarredMode(mode=DriveMode.ROUTE, refusal=m.ModeRefusal.NO_MISSION) in state.barred
    assert desk.console.mission.fence == FENCE


async def test_no_mission_comes_under_a_held_button(tmp_path: Path) -> None:
    """Whoever holds it has seen the mission before, and arms for that."""
    desk = MissionDesk(tmp_path)
    await desk.hold()
    desk.clock.advance(-0.2)
    assert (await desk.send()).mission_refusal is MissionRefusal.BUSY
