"""The MAVLink port on the simulated river, with stations that others wrote: MAVSDK, and MAVProxy as a process."""

from __future__ import annotations

import asyncio
import functools
import importlib.util
import operator
import os
import signal
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus, open_bus
from paani.clock import WallClock
from paani.config import Config, load_config
from paani_services.operator.latch import LATCH_FILE
from paani_services.operator.state import CLEAR
from tests.arming import arm_on_page
from tests.conftest import find_free_port
from tests.integration.test_up import READY_S, Up, words_of
from tests.paani_command import paani

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
RIVER_DEG = (50.1072, 8.6928)
HOLD, AUTO, RETURN = 3, 4, 5  # TelemetryFlightMode
LINK_LOSS_S = 3.0


class River:
    """One drive that all tests share: `paani up --with mavlink`, in order, not armed, no STOP."""

    def __init__(self, folder: Path) -> None:
        self.udp, self.tcp = find_free_port(), find_free_port()
        self.sets = (
            f"bus.router=tcp/127.0.0.1:{find_free_port()}",
            f"bus.runtime_dir={folder / 'runtime'}",
            f"dashboard.port={find_free_port()}",
            f"mavlink.udp=127.0.0.1:{self.udp}",
            f"mavlink.tcp=127.0.0.1:{self.tcp}",
            f"mavlink.link_loss_s={LINK_LOSS_S}",
            "up.arm_at_start=false",
        )
        self.config: Config = load_config(sets=self.sets)
        (folder / "runtime").mkdir(mode=0o700)
        (folder / "runtime" / LATCH_FILE).write_text(CLEAR)
        self.up = Up(folder, *words_of(self.sets, "--with", "mavlink"))


@pytest.fixture(scope="module")
def river(tmp_path_factory: pytest.TempPathFactory) -> Iterator[River]:
    started = River(tmp_path_factory.mktemp("mavlink"))
    try:
        started.up.until(lambda: "http://127.0.0.1:" in started.up.out, READY_S)
        yield started
    finally:
        started.up.process.send_signal(signal.SIGINT)
        assert started.up.process.wait(20.0) == 0


@pytest.fixture
async def observer(river: River) -> AsyncIterator[Bus]:
    bus = await open_bus(river.config.bus, "observer", WallClock())
    yield bus
    await bus.close()


class GroundStation:
    """MAVSDK, connected to the first autopilot that it finds."""

    def __init__(self, system: Any) -> None:
        self.system = system
        self.telemetry, self.action = TelemetryAsync(system), ActionAsync(system)
        self.mission, self.parameters = MissionRawAsync(system), ParamAsync(system)
        self.texts: list[str] = []

    async def collect_texts(self) -> None:
        async for text in self.telemetry.subscribe_status_text():
            self.texts.append(text.text)


async def until(read: Callable[[], Awaitable[T]], is_reached: Callable[[T], bool], limit_s: float = 20.0) -> T:
    """The first value that is; fails after `limit_s`."""
    async with asyncio.timeout(limit_s):
        while not is_reached(value := await read()):
            await asyncio.sleep(0.1)
    return value


async def until_taken(attempt: Callable[[], Awaitable[Any]], limit_s: float = 20.0) -> None:
    """Ask until it is not refused: on a busy machine a process of the boat may be silent for a moment."""

    async def refusal() -> str:
        return await refusal_of(attempt())

    await until(refusal, functools.partial(operator.eq, "taken"), limit_s)


async def refusal_of(attempt: Awaitable[Any]) -> str:
    """The result with which MAVSDK reports a refusal."""
    try:
        await attempt
    except Exception as error:  # noqa: BLE001  # each plugin has its own
        return repr(error)
    return "taken"


def moved(item: MissionItem, **changes: Any) -> MissionItem:
    """The same item with other fields."""
    return MissionItem(**{**vars(item), **changes})


async def test_mavsdk_reads_arms_and_is_refused_and_its_silence_stops_the_boat(river: River, observer: Bus) -> None:
    states, speeds = observer.latest(keys.OPERATOR_STATE), observer.latest(keys.ODOMETRY)
    missions = observer.latest(keys.MISSION)
    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        await mavsdk.add_any_connection(f"udpin://127.0.0.1:{river.udp}")
        system = await mavsdk.first_autopilot(timeout_s=10.0)
        assert system is not None
        station = GroundStation(system)
        listening = asyncio.create_task(station.collect_texts())
        telemetry, action = station.telemetry, station.action

        # What it reads.
        health = await until(telemetry.health, lambda found: found.is_armable)
        assert health.is_global_position_ok
        assert health.is_gyrometer_calibration_ok
        position = await until(telemetry.position, lambda found: found.latitude_deg > 0.0)
        assert (position.latitude_deg, position.longitude_deg) == pytest.approx(RIVER_DEG, abs=0.005)
        assert (await telemetry.raw_gps()).horizontal_uncertainty_m == pytest.approx(0.8, abs=0.3)
        own = await speeds.next()
        attitude = await telemetry.attitude_euler()
        assert attitude.yaw_deg == pytest.approx(90.0 - own.yaw_rad * 57.29578, abs=10.0)
        assert (await telemetry.armed(), await telemetry.flight_mode()) == (False, AUTO)
        items = await until(station.mission.download_mission, lambda found: len(found) > 0)
        assert [item.command for item in items] == [16] * (len(items) - 1) + [177]
        assert (items[1].x * 1e-7, items[1].y * 1e-7) == pytest.approx(RIVER_DEG, abs=0.01)
        assert await station.parameters.get_param_float("CRUISE_SPEED") == pytest.approx(0.6)

        # What it is refused.
        assert "READ_ONLY" in await refusal_of(station.parameters.set_param_float("CRUISE_SPEED", 3.0))
        assert await station.parameters.get_param_float("CRUISE_SPEED") == pytest.approx(0.6)
        assert "DOES_NOT_EXIST" in await refusal_of(station.parameters.get_param_float("NO_SUCH"))
        assert "PERMISSION_DENIED" in await refusal_of(station.parameters.set_param_float("POL_CEN_BLO_RIS", 0.46))
        assert await station.parameters.get_param_float("POL_CEN_BLO_RIS") == pytest.approx(0.48)
        assert any(text.startswith("on trial as mavlink") for text in station.texts)
        assert "UNSUPPORTED" in await refusal_of(
            station.mission.upload_mission([*items, moved(items[1], seq=len(items), command=22, current=0)])
        )
        assert "DENIED" in await refusal_of(action.return_to_launch())
        assert "mode: no home" in station.texts
        assert "DENIED" in await refusal_of(action.set_home(False, 0.0, *RIVER_DEG))
        assert await telemetry.armed() is False

        # A mission and a fence of its own, which the boat then has, and a mission that leaves that fence.
        route = [moved(item, seq=seq, current=seq == 0) for seq, item in enumerate(items[1:-1])]
        await until_taken(functools.partial(station.mission.upload_mission, route))
        taken = await until(missions.next, lambda mission: mission.accepted_us > 0)
        assert [len(leg.waypoints) for leg in taken.legs] == [len(route)]
        fence = [
            moved(route[0], command=5001, param1=4.0, x=route[0].x + north, y=route[0].y + east)
            for north, east in ((-500_000, -500_000), (500_000, -500_000), (500_000, 500_000), (-500_000, 500_000))
        ]
        fence = [moved(corner, seq=seq, mission_type=1, current=0) for seq, corner in enumerate(fence)]
        await until_taken(functools.partial(station.mission.upload_geofence, fence))
        assert len((await until(missions.next, lambda mission: bool(mission.fence))).fence[0].corners) == 4
        outside = [route[0], moved(route[1], x=route[1].x + 1_000_000)]
        assert "INVALID_ARGUMENT" in await refusal_of(station.mission.upload_mission(outside))
        assert "legs[0].waypoints[1]: is outside the fence" in station.texts
        found = await station.mission.download_mission()
        assert [(item.x, item.y) for item in found] == [(item.x, item.y) for item in route]
        await until_taken(functools.partial(station.mission.upload_mission, items))

        # What it does. MAVSDK asks for HOLD before it arms; armed by a hold of the operator's process,
        # the boat makes way along its route when its mission is started.
        await until_taken(action.arm)
        assert await until(telemetry.armed, bool, 5.0)
        assert (await states.next()).mode is m.DriveMode.IDLE
        await until_taken(station.mission.start_mission)
        await until(telemetry.velocity_ned, lambda v: v.north_m_s**2 + v.east_m_s**2 > 0.04)
        assert (await states.next()).by == "mavlink"
        for change, number, mode in (
            (action.hold, HOLD, m.DriveMode.IDLE),
            (action.return_to_launch, RETURN, m.DriveMode.RETURN),
            (station.mission.start_mission, AUTO, m.DriveMode.ROUTE),
        ):
            await until_taken(change)
            await until(telemetry.flight_mode, functools.partial(operator.eq, number), 5.0)
            assert ((state := await states.next()).mode, state.armed) == (mode, True)
        listening.cancel()
    # The link is lost.
    async with asyncio.timeout(LINK_LOSS_S + 10.0):
        while not (state := await states.next()).stopped:
            pass
    assert (state.by, state.armed) == ("mavlink", False)
    await until(speeds.next, lambda own: own.surge_mps < 0.1)


async def test_a_stop_of_a_ground_station_is_released_by_a_hand_on_the_page_alone(river: River, observer: Bus) -> None:
    states = observer.latest(keys.OPERATOR_STATE)
    async with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        await mavsdk.add_any_connection(f"tcpout://127.0.0.1:{river.tcp}")
        system = await mavsdk.first_autopilot(timeout_s=10.0)
        assert system is not None
        station = GroundStation(system)
        listening = asyncio.create_task(station.collect_texts())
        reason, refused = "arm: a STOP holds; release it on the page", ""
        async with asyncio.timeout(20.0):  # MAVSDK asks for a mode first, and the last station's hand may be there yet
            while reason not in station.texts:
                refused = await refusal_of(station.action.arm())
        assert "COMMAND_DENIED" in refused
        await arm_on_page(f"http://127.0.0.1:{river.config.dashboard.port}", river.config.bus)
        assert await until(station.telemetry.armed, bool, 5.0)
        await until_taken(station.action.disarm)
        async with asyncio.timeout(5.0):
            while not (state := await states.next()).stopped:
                pass
        assert state.by == "mavlink"
        assert not await until(station.telemetry.armed, lambda is_armed: not is_armed, 5.0)
        listening.cancel()


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

    listening = asyncio.create_task(listen())
    await arm_on_page(f"http://127.0.0.1:{river.config.dashboard.port}", river.config.bus, press=2)
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
    listening.cancel()
    writer.close()


async def test_mavproxy_reads_parameters_and_mission_and_is_refused(river: River, tmp_path: Path) -> None:
    if importlib.util.find_spec("MAVProxy") is None:
        pytest.skip("MAVProxy is not installed")
    modules = "--default-modules=param,wp,arm,mode"
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-W", "ignore", "-m", "MAVProxy.mavproxy", "--master", f"tcp:127.0.0.1:{river.tcp}", "--nowait",
        f"--state-basedir={tmp_path}", modules, cwd=tmp_path, env={**os.environ, "HOME": str(tmp_path)},
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stdout is not None
    printed = ""

    async def expect(text: str, command: str = "") -> None:
        """Type a command, and read until this is printed."""
        nonlocal printed
        assert process.stdin is not None
        assert process.stdout is not None
        printed = ""
        process.stdin.write(f"{command}\n".encode() if command else b"")
        async with asyncio.timeout(20.0):
            while text not in printed:
                read = await process.stdout.read(4096)
                assert read, printed
                printed += read.decode(errors="replace")

    try:
        await expect("Received")  # all parameters: the refusal of the file was understood
        await expect("CRUISE_SPEED     0.6", "param show CRUISE_SPEED")
        await expect("Saved", "wp list")
        assert "177 3" in printed
        assert (await paani(river.sets[:3], "stop"))[0] == 0
        await expect("COMPONENT_ARM_DISARM: DENIED", "arm throttle")
        assert "AP: arm: a STOP holds" in printed
        await expect("Mode RTL", "mode RTL")
        await expect("CRUISE_SPEED: is not tunable", "param set CRUISE_SPEED 3")
        await expect("COMPONENT_ARM_DISARM: ACCEPTED", "disarm")
    finally:
        process.kill()
        await process.wait()
