"""The MAVLink port on the simulated river, with a station that others wrote: MAVSDK."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import operator
import re
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from typing import Any, TypeVar

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus, open_bus
from paani.clock import WallClock, stopwatch_ms
from tests.arming import arm_on_page
from tests.at_work import at_work
from tests.integration.mavlink_river import LINK_LOSS_S, River, river_in, until
from tests.paani_command import paani
from tests.transcript import Transcript

pytest.importorskip("mavsdk", reason="needs mavsdk")
from mavsdk.asyncio.mavsdk import Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.component_type import ComponentType
from mavsdk.plugins.mission_raw import MissionItem
from pymavlink.dialects.v20 import common

pytestmark = [pytest.mark.integration, pytest.mark.timeout(200)]
T = TypeVar("T")
RESULT = re.compile(r"\w+Result\.\w+")
RIVER_DEG = (50.1072, 8.6928)
HOLD, AUTO, RETURN = 3, 4, 5  # TelemetryFlightMode


@pytest.fixture(scope="module")
def river(tmp_path_factory: pytest.TempPathFactory) -> Iterator[River]:
    """One drive that all tests share."""
    with river_in(tmp_path_factory.mktemp("mavlink")) as started:
        yield started


@pytest.fixture
async def observer(river: River) -> AsyncIterator[Bus]:
    bus = await open_bus(river.config.bus, "observer", WallClock())
    yield bus
    await bus.close()


class GroundStation:
    """MAVSDK, connected to the first autopilot that it finds.

    None of its calls is given up: each ends by itself, and its library falls where it is closed during one. It also
    falls where the HOLD is refused that it asks for before it arms: whoever arms holds the wheel first.
    """

    def __init__(self, system: Any, transcript: Transcript) -> None:
        self.system, self._transcript = system, transcript
        self.telemetry, self.action = TelemetryAsync(system), ActionAsync(system)
        self.mission, self.parameters = MissionRawAsync(system), ParamAsync(system)
        self.texts: list[str] = []

    async def collect_texts(self) -> None:
        async for text in self.telemetry.subscribe_status_text():
            self.texts.append(text.text)
            self._transcript.note("boat", text.text)

    async def until_heard(self, start: str) -> None:
        """Wait for a text that begins so, or fail: MAVSDK hands texts on apart from results."""
        async with asyncio.timeout(10.0):
            while not any(text.startswith(start) for text in self.texts):
                await asyncio.sleep(0.05)

    async def ask(self, words: str, attempt: Awaitable[Any]) -> str:
        """What it asks, and the result with which MAVSDK reports a refusal, or `taken`."""
        try:
            await attempt
            result = "taken"
        except Exception as error:  # noqa: BLE001  # each plugin has its own
            result = found[0] if (found := RESULT.search(repr(error))) else repr(error)
        self._transcript.note("MAVSDK", f"{words}: {result}")
        return result

    async def ask_until_taken(self, words: str, attempt: Callable[[], Awaitable[Any]], limit_s: float = 20.0) -> None:
        """Again until it is not refused: on a busy machine a process of the boat may be silent for a moment."""
        await self.until(lambda: self.ask(words, attempt()), functools.partial(operator.eq, "taken"), limit_s)

    async def until(
        self, read: Callable[[], Awaitable[T]], is_reached: Callable[[T], bool], limit_s: float = 20.0
    ) -> T:
        """The first value of a telemetry that is; fails after `limit_s`."""
        deadline_ms = stopwatch_ms() + limit_s * 1e3
        while not is_reached(value := await read()):
            assert stopwatch_ms() < deadline_ms, value
            await asyncio.sleep(0.1)
        return value


@contextlib.asynccontextmanager
async def ground_station(link: str, transcript: Transcript) -> AsyncIterator[GroundStation]:
    """What listens is ended before what it listens at: else the library may fall, and the tests with it."""
    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        await mavsdk.add_any_connection(link)
        system = await mavsdk.first_autopilot(timeout_s=20.0)
        assert system is not None
        station = GroundStation(system, transcript)
        try:
            async with at_work(station.collect_texts()):
                yield station
        finally:
            for plugin in (station.telemetry, station.action, station.mission, station.parameters):
                plugin.destroy()


def moved(item: MissionItem, **changes: Any) -> MissionItem:
    """The same item with other fields."""
    return MissionItem(**{**vars(item), **changes})


async def test_mavsdk_reads_arms_and_is_refused_and_its_silence_stops_the_boat(
    river: River, observer: Bus, transcript: Transcript
) -> None:
    states, speeds = observer.latest(keys.OPERATOR_STATE), observer.latest(keys.ODOMETRY)
    missions = observer.latest(keys.MISSION)
    async with ground_station(f"udpin://127.0.0.1:{river.udp}", transcript) as station:
        telemetry, action = station.telemetry, station.action

        # What it reads.
        health = await station.until(telemetry.health, lambda found: found.is_armable)
        assert health.is_global_position_ok
        assert health.is_gyrometer_calibration_ok
        position = await station.until(telemetry.position, lambda found: found.latitude_deg > 0.0)
        assert (position.latitude_deg, position.longitude_deg) == pytest.approx(RIVER_DEG, abs=0.005)
        assert (await telemetry.raw_gps()).horizontal_uncertainty_m == pytest.approx(0.8, abs=0.3)
        own = await speeds.next()
        attitude = await telemetry.attitude_euler()
        assert attitude.yaw_deg == pytest.approx(90.0 - own.yaw_rad * 57.29578, abs=10.0)
        assert (await telemetry.armed(), await telemetry.flight_mode()) == (False, AUTO)
        items = await station.until(station.mission.download_mission, lambda found: len(found) > 0)
        assert [item.command for item in items] == [16] * (len(items) - 1) + [177]
        assert (items[1].x * 1e-7, items[1].y * 1e-7) == pytest.approx(RIVER_DEG, abs=0.01)
        assert await station.parameters.get_param_float("CRUISE_SPEED") == pytest.approx(0.6)

        # What it is refused.
        assert "READ_ONLY" in await station.ask(
            "set CRUISE_SPEED to 3", station.parameters.set_param_float("CRUISE_SPEED", 3.0)
        )
        assert await station.parameters.get_param_float("CRUISE_SPEED") == pytest.approx(0.6)
        assert "DOES_NOT_EXIST" in await station.ask(
            "get parameter NO_SUCH", station.parameters.get_param_float("NO_SUCH")
        )
        assert "PERMISSION_DENIED" in await station.ask(
            "set POL_CEN_BLO_RIS to 0.46", station.parameters.set_param_float("POL_CEN_BLO_RIS", 0.46)
        )
        assert await station.parameters.get_param_float("POL_CEN_BLO_RIS") == pytest.approx(0.48)
        await station.until_heard("on trial as mavlink")
        assert "UNSUPPORTED" in await station.ask(
            "upload a mission with a take-off",
            station.mission.upload_mission([*items, moved(items[1], seq=len(items), command=22, current=0)]),
        )
        assert "DENIED" in await station.ask("return, before there is a home", action.return_to_launch())
        await station.until_heard("mode: no home")
        assert "DENIED" in await station.ask("set home", action.set_home(False, 0.0, *RIVER_DEG))
        assert await telemetry.armed() is False

        # A mission and a fence of its own, which the boat then has, and a mission that leaves that fence.
        route = [moved(item, seq=seq, current=seq == 0) for seq, item in enumerate(items[1:-1])]
        await station.ask_until_taken(
            f"upload a mission of {len(route)} waypoints", functools.partial(station.mission.upload_mission, route)
        )
        taken = await until(missions.next, lambda mission: mission.accepted_us > 0)
        assert [len(leg.waypoints) for leg in taken.legs] == [len(route)]
        fence = [
            moved(route[0], command=5001, param1=4.0, x=route[0].x + north, y=route[0].y + east)
            for north, east in ((-500_000, -500_000), (500_000, -500_000), (500_000, 500_000), (-500_000, 500_000))
        ]
        fence = [moved(corner, seq=seq, mission_type=1, current=0) for seq, corner in enumerate(fence)]
        await station.ask_until_taken(
            "upload a fence of 4 corners", functools.partial(station.mission.upload_geofence, fence)
        )
        assert len((await until(missions.next, lambda mission: bool(mission.fence))).fence[0].corners) == 4
        outside = [route[0], moved(route[1], x=route[1].x + 1_000_000)]
        assert "INVALID_ARGUMENT" in await station.ask(
            "upload a mission that crosses it", station.mission.upload_mission(outside)
        )
        await station.until_heard("legs[0].waypoints[1]: is outside the fence")
        found = await station.mission.download_mission()
        assert [(item.x, item.y) for item in found] == [(item.x, item.y) for item in route]
        await station.ask_until_taken(
            f"upload the mission of {len(items)} items again", functools.partial(station.mission.upload_mission, items)
        )

        # What it does. MAVSDK asks for HOLD before it arms; armed by a hold of the operator's process,
        # the boat makes way along its route when its mission is started.
        await station.ask_until_taken("hold, by which the wheel is its own", action.hold)
        await station.ask_until_taken("arm", action.arm)
        assert await station.until(telemetry.armed, bool, 5.0)
        assert (await states.next()).mode is m.DriveMode.IDLE
        await station.ask_until_taken("start the mission", station.mission.start_mission)
        await station.until(telemetry.velocity_ned, lambda v: v.north_m_s**2 + v.east_m_s**2 > 0.04)
        transcript.note("boat", "makes way")
        assert (await states.next()).by == "mavlink"
        for words, change, number, mode in (
            ("hold", action.hold, HOLD, m.DriveMode.IDLE),
            ("return", action.return_to_launch, RETURN, m.DriveMode.RETURN),
            ("start the mission again", station.mission.start_mission, AUTO, m.DriveMode.ROUTE),
        ):
            await station.ask_until_taken(words, change)
            await station.until(telemetry.flight_mode, functools.partial(operator.eq, number), 5.0)
            assert ((state := await states.next()).mode, state.armed) == (mode, True)
            transcript.note("boat", f"armed, in {mode.name}")
    transcript.note("MAVSDK", "the link is lost")
    state = await until(states.next, lambda state: state.stopped, LINK_LOSS_S + 10.0)
    assert (state.by, state.armed) == ("mavlink", False)
    transcript.note("boat", f"STOP, asked by {state.by}; not armed")
    await until(speeds.next, lambda own: own.surge_mps < 0.1)
    transcript.note("boat", "stands")


async def test_a_stop_of_a_ground_station_is_released_by_a_hand_on_the_page_alone(
    river: River, observer: Bus, transcript: Transcript
) -> None:
    states = observer.latest(keys.OPERATOR_STATE)
    assert (await paani(river.sets[:3], "stop"))[0] == 0
    async with ground_station(f"tcpout://127.0.0.1:{river.tcp}", transcript) as station:
        reason, refused = "arm: a STOP holds; release it on the page", ""
        await station.ask_until_taken("hold, by which the wheel is its own", station.action.hold)
        deadline_ms = stopwatch_ms() + 20e3
        while reason not in station.texts:
            refused = await station.ask("arm", station.action.arm())
            assert stopwatch_ms() < deadline_ms, refused
            await asyncio.sleep(0.2)
        assert "COMMAND_DENIED" in refused
        await arm_on_page(river.page, river.config.bus)
        assert await station.until(station.telemetry.armed, bool, 5.0)
        transcript.note("page", "armed by hand")
        await station.ask_until_taken("disarm", station.action.disarm)
        state = await until(states.next, lambda state: state.stopped, 5.0)
        assert state.by == "mavlink"
        transcript.note("boat", f"STOP, asked by {state.by}")
        assert not await station.until(station.telemetry.armed, lambda is_armed: not is_armed, 5.0)


async def test_a_hand_drives_while_it_holds_the_stick_and_no_longer(river: River, observer: Bus) -> None:
    """By pymavlink alone. Heartbeats go on, so that the link is not lost; it is the stick that is let go."""
    states, applied = observer.latest(keys.OPERATOR_STATE), observer.latest(keys.THRUST_APPLIED)
    reader, writer = await asyncio.open_connection("127.0.0.1", river.tcp)
    hand = common.MAVLink(None, 250, 190)
    heard: list[str] = []

    def send(message: Any) -> None:
        writer.write(message.pack(hand))

    async def listen() -> None:
        while data := await reader.read(4096):
            heard.extend(message.get_type() for message in hand.parse_buffer(data) or ())

    async with at_work(listen()):
        await arm_on_page(river.page, river.config.bus, press=2)
        async with asyncio.timeout(30.0):
            while (state := await states.next()).mode is not m.DriveMode.MANUAL:
                send(common.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
                send(common.MAVLink_set_mode_message(1, 1, 0))
        async with asyncio.timeout(20.0):
            while (await applied.next()).left >= -0.01:
                send(common.MAVLink_manual_control_message(1, 0, 0, -900, 0, 0))  # astern: no advice vetoes it
                await asyncio.sleep(0.05)
        async with asyncio.timeout(5.0):
            while (state := await states.next()).mode is not m.DriveMode.IDLE:
                send(common.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
            while (thrust := await applied.next()).left != 0.0:
                pass
        assert (state.armed, thrust.right) == (True, 0.0)
        send(common.MAVLink_command_long_message(1, 1, 400, 0, 0, 0, 0, 0, 0, 0, 0))
        assert (await until(states.next, lambda state: state.stopped, 5.0)).by == "mavlink"
        assert "COMMAND_ACK" in heard
    writer.close()
