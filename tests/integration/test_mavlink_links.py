"""The links of the MAVLink port as a process, without a boat: who is heard, who is let go, and what stops it."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani_services.mavlink.signing import MINUTE, STAMP_FILE, read_signing_key, stamp_of
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn, find_free_port
from tests.mavlink_peer import in_order

common: Any = pytest.importorskip("pymavlink.dialects.v20.common", reason="needs pymavlink")
pytestmark = pytest.mark.integration
CLOCK = WallClock()
HEARTBEAT = common.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)
DISARM = common.MAVLink_command_long_message(1, 1, 400, 0, 0, 0, 0, 0, 0, 0, 0)


class Client:
    """A TCP connection that speaks MAVLink by pymavlink."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.reader, self.writer = reader, writer
        self.codec = common.MAVLink(None, 255, 190)
        self.codec.robust_parsing = True
        self._messages: list[Any] = []

    @classmethod
    async def connect(cls, port: int) -> Client:
        return cls(*await asyncio.open_connection("127.0.0.1", port))

    def send(self, message: Any) -> None:
        self.writer.write(message.pack(self.codec))

    async def until(self, kind: str) -> Any:
        """The next message of this kind."""
        async with asyncio.timeout(10.0):
            while True:
                while self._messages:
                    if (message := self._messages.pop(0)).get_type() == kind:
                        return message
                data = await self.reader.read(4096)
                assert data
                self._messages += self.codec.parse_buffer(data) or []


async def test_noise_floods_and_deaf_stations_hold_back_nobody(spawn: Spawn, open_as: OpenAs) -> None:
    tcp, udp = find_free_port(), find_free_port()
    requests = (await open_as("observer")).queue(keys.REQUESTS["mavlink"])
    links = (f"mavlink.tcp=127.0.0.1:{tcp}", f"mavlink.udp=127.0.0.1:{udp}", "mavlink.max_clients=3")
    async with spawn("mavlink", *links) as process:
        good, noisy, deaf = [await Client.connect(tcp) for _ in range(3)]
        fourth = await Client.connect(tcp)
        async with asyncio.timeout(5.0):
            assert await fourth.reader.read() == b""  # one more than may connect
        noisy.writer.write(bytes(range(256)) * 4000)
        deaf.writer.write(HEARTBEAT.pack(common.MAVLink(None, 254, 190)))
        for client in (good, noisy):
            client.send(HEARTBEAT)
        assert (await good.until("HEARTBEAT")).base_mode == 1
        assert not (await good.until("SYS_STATUS")).onboard_control_sensors_health  # nobody else is there
        good.send(common.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
        while (await good.until("STATUSTEXT")).text != "arm: operator silent":
            pass
        assert (await good.until("COMMAND_ACK")).result == 4
        good.send(DISARM)
        async with asyncio.timeout(5.0):
            assert (await requests.get()).act is m.RequestAct.STOP
        assert (await good.until("COMMAND_ACK")).result == 4  # nobody has latched it
        for client in (noisy, deaf, fourth):
            client.writer.transport.abort()
        for _ in range(20):  # connections that break at once
            broken = await Client.connect(tcp)
            broken.writer.transport.abort()
        good.send(common.MAVLink_ping_message(1, 7, 0, 0))
        assert (await good.until("PING")).seq == 7
        good.writer.close()
        assert process.returncode is None


async def test_a_page_in_a_browser_on_this_machine_is_no_station(spawn: Spawn, open_as: OpenAs) -> None:
    """Any site's page may send frames to any port, in a request's body; without a key, whoever is local may command."""
    tcp = find_free_port()
    requests = (await open_as("observer")).queue(keys.REQUESTS["mavlink"])
    async with spawn("mavlink", f"mavlink.tcp=127.0.0.1:{tcp}", 'mavlink.udp=""'):
        page, good = await Client.connect(tcp), await Client.connect(tcp)
        frames = b"".join(each.pack(page.codec) for each in (HEARTBEAT, DISARM))
        page.writer.write(b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://elsewhere.example\r\n\r\n" + frames)
        async with asyncio.timeout(5.0):
            assert await page.reader.read() == b""
        good.send(HEARTBEAT)
        await good.until("HEARTBEAT")
        assert requests.drain() == []
        for client in (page, good):
            client.writer.close()


async def test_stations_that_say_nothing_keep_nobody_out(spawn: Spawn) -> None:
    """As many as may connect, over links that were lost: once the first has been silent, another takes its place."""
    tcp = find_free_port()
    async with spawn("mavlink", f"mavlink.tcp=127.0.0.1:{tcp}", 'mavlink.udp=""', "mavlink.max_clients=2"):
        silent = [await Client.connect(tcp) for _ in range(2)]
        async with asyncio.timeout(20.0):
            while True:
                client = await Client.connect(tcp)
                client.send(HEARTBEAT)
                with contextlib.suppress(AssertionError, ConnectionError):
                    await client.until("HEARTBEAT")
                    break
                client.writer.transport.abort()
                await asyncio.sleep(0.2)
            while await silent[0].reader.read(4096):
                pass
        for each in (client, *silent):
            each.writer.transport.abort()


async def test_what_falls_silent_is_told_as_unknown_and_not_again(spawn: Spawn, open_as: OpenAs) -> None:
    tcp = find_free_port()
    states = (await open_as("operator")).publisher(keys.OPERATOR_STATE)
    estimates = (await open_as("localization")).publisher(keys.ODOMETRY)

    async def publish() -> None:
        while True:
            now_us = CLOCK.now_us()
            states.put(m.OperatorState(source_us=now_us, armed=True, stopped=False, by="dashboard"))
            estimates.put(
                m.Odometry(
                    source_us=now_us, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.5, healthy=True, latitude_deg=50.0,
                    longitude_deg=8.0,
                )
            )  # fmt: skip
            await asyncio.sleep(0.05)

    async with spawn("mavlink", f"mavlink.tcp=127.0.0.1:{tcp}", 'mavlink.udp=""'), asyncio.timeout(20.0):
        async with at_work(publish()):
            station = await Client.connect(tcp)
            station.send(HEARTBEAT)
            while (await station.until("HEARTBEAT")).base_mode != 129:
                pass
            assert (await station.until("GLOBAL_POSITION_INT")).lat == 500_000_000
        while (await station.until("HEARTBEAT")).base_mode != 1:
            station.send(HEARTBEAT)
        while (await station.until("SYS_STATUS")).onboard_control_sensors_health:
            station.send(HEARTBEAT)
        station.send(common.MAVLink_command_long_message(1, 1, 512, 0, 33, 0, 0, 0, 0, 0, 0))
        assert (await station.until("COMMAND_ACK")).result == common.MAV_RESULT_TEMPORARILY_REJECTED
        station.writer.close()


async def test_udp_is_taken_from_its_address_alone(spawn: Spawn, open_as: OpenAs) -> None:
    """The station hears a heartbeat before it has said anything, and telemetry afterwards."""
    requests = (await open_as("observer")).queue(keys.REQUESTS["mavlink"])
    received: asyncio.Queue[tuple[bytes, Any]] = asyncio.Queue()

    class Station(asyncio.DatagramProtocol):
        def datagram_received(self, data: bytes, addr: Any) -> None:
            received.put_nowait((data, addr))

    loop, parser = asyncio.get_running_loop(), common.MAVLink(None, 255, 190)
    station, _ = await loop.create_datagram_endpoint(Station, local_addr=("127.0.0.1", 0))
    stranger, _ = await loop.create_datagram_endpoint(Station, local_addr=("127.0.0.1", 0))
    async with spawn("mavlink", f"mavlink.udp=127.0.0.1:{station.get_extra_info('sockname')[1]}"):
        async with asyncio.timeout(10.0):
            data, port = await received.get()
            assert [message.get_type() for message in parser.parse_buffer(data)] == ["HEARTBEAT"]
            stranger.sendto(DISARM.pack(common.MAVLink(None, 255, 190)), port)
            station.sendto(HEARTBEAT.pack(parser), port)
            kinds = set[str]()
            while "SYS_STATUS" not in kinds:
                kinds |= {message.get_type() for message in parser.parse_buffer((await received.get())[0]) or ()}
            assert requests.drain() == []
            station.sendto(DISARM.pack(parser), port)
            assert (await requests.get()).act is m.RequestAct.STOP
    station.close()
    stranger.close()


async def test_who_leaves_while_arming_has_let_the_button_go(spawn: Spawn, open_as: OpenAs) -> None:
    """And one order for the mission at a time: the same again is answered with it, another is refused at once."""
    tcp, observer = find_free_port(), await open_as("observer")
    requests, missions = observer.queue(keys.REQUESTS["mavlink"]), observer.queue(keys.MISSION_REQUESTS["mavlink"])
    boat = in_order()
    speakers: list[tuple[Any, Any]] = [
        ((await open_as("operator")).publisher(keys.OPERATOR_STATE), boat.operator),
        ((await open_as("localization")).publisher(keys.ODOMETRY), boat.odometry),
        ((await open_as("navigator")).publisher(keys.COMMAND), boat.command),
        ((await open_as("plant")).publisher(keys.THRUST_APPLIED), boat.applied),
    ]

    async def publish() -> None:
        while True:
            for publisher, message in speakers:
                publisher.put(msgspec.structs.replace(message, source_us=CLOCK.now_us()))
            await asyncio.sleep(0.05)

    async with at_work(publish()), spawn("mavlink", f"mavlink.tcp=127.0.0.1:{tcp}", 'mavlink.udp=""'):
        station = await Client.connect(tcp)
        station.send(HEARTBEAT)
        async with asyncio.timeout(10.0):
            while not requests.drain():
                station.send(common.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))
                await asyncio.sleep(0.2)
        for _ in range(5):
            station.send(common.MAVLink_mission_clear_all_message(1, 1, 0))
        station.send(common.MAVLink_mission_clear_all_message(1, 1, 1))
        refusal = await station.until("MISSION_ACK")
        assert (refusal.type, refusal.mission_type) == (common.MAV_MISSION_ERROR, 1)
        async with asyncio.timeout(5.0):
            first = await missions.get()
        assert {request.press for request in missions.drain()} <= {first.press}
        station.writer.transport.abort()
        await asyncio.sleep(0.5)
        requests.drain()
        await asyncio.sleep(1.5)  # the press would have ended, which is what arms
        assert requests.drain() == []


@pytest.mark.parametrize("is_told_to_end", [True, False])
async def test_a_boat_armed_from_here_is_stopped_without_stations(
    is_told_to_end: bool, spawn: Spawn, open_as: OpenAs
) -> None:
    """When nobody has been heard for too long, and when the process ends. What the page has armed is the page's."""
    requests = (await open_as("observer")).queue(keys.REQUESTS["mavlink"])
    states = (await open_as("operator")).publisher(keys.OPERATOR_STATE)
    by = "dashboard"

    async def publish() -> None:
        while True:
            states.put(m.OperatorState(source_us=CLOCK.now_us(), armed=True, stopped=False, by=by))
            await asyncio.sleep(0.1)

    links = (f"mavlink.link_loss_s={60 if is_told_to_end else 1}", 'mavlink.udp=""')
    async with at_work(publish()), spawn("mavlink", *links) as process:
        await asyncio.sleep(1.5)  # by the process's own clock, too long without a station
        assert requests.drain() == []
        by = "mavlink"
        await asyncio.sleep(0.5)
        if is_told_to_end:
            assert requests.drain() == []
            process.terminate()
        async with asyncio.timeout(5.0):
            assert (await requests.get()).act is m.RequestAct.STOP


async def test_mavsdk_downloads_what_is_recorded_and_sees_nothing_else(spawn: Spawn, tmp_path: Path) -> None:
    """A recording of two requests of MAVSDK's, 46,080 bytes each, and a bit; the one being written is not there."""
    sdk: Any = pytest.importorskip("mavsdk.asyncio.mavsdk", reason="needs mavsdk")
    log_files: Any = pytest.importorskip("mavsdk.asyncio.plugins.log_files")
    kinds: Any = pytest.importorskip("mavsdk.component_type")
    configuration = sdk.Configuration.create_with_component_type(kinds.ComponentType.GROUND_STATION)
    tcp, folder, copy = find_free_port(), tmp_path / "recordings", tmp_path / "copy"
    folder.mkdir()
    recording = folder / "20231114T221320Z-1.mcap"
    recording.write_bytes(os.urandom(2 * 46_080 + 17))
    links = (f"mavlink.tcp=127.0.0.1:{tcp}", 'mavlink.udp=""', f"recorder.folder={folder}")
    with (folder / "20231114T231320Z-1.mcap").open("wb") as written:
        written.write(b"begun")
        written.flush()
        fcntl.flock(written, fcntl.LOCK_EX)
        async with spawn("mavlink", *links), sdk.Mavsdk(configuration) as mavsdk:
            await mavsdk.add_any_connection(f"tcpout://127.0.0.1:{tcp}")
            system = await mavsdk.first_autopilot(timeout_s=10.0)
            assert system is not None
            logs = log_files.LogFilesAsync(system)
            (entry,) = await logs.get_entries()
            assert (entry.size_bytes, entry.date[:19]) == (recording.stat().st_size, "2023-11-14T22:13:20")
            async with asyncio.timeout(30.0):
                async for _ in logs.download_log_file(entry, str(copy)):
                    pass
            logs.destroy()
    assert copy.read_bytes() == recording.read_bytes()


async def test_mavproxy_signs_and_is_obeyed_and_before_is_not(spawn: Spawn, open_as: OpenAs, tmp_path: Path) -> None:
    if importlib.util.find_spec("MAVProxy") is None:
        pytest.skip("MAVProxy is not installed")
    tcp, key = find_free_port(), tmp_path / "key"
    key.write_text("secret")
    key.chmod(0o600)
    observer = await open_as("observer")
    requests, health = observer.queue(keys.REQUESTS["mavlink"]), observer.latest(keys.health("mavlink"))
    async with spawn("mavlink", f"mavlink.tcp=127.0.0.1:{tcp}", 'mavlink.udp=""', f"mavlink.signing_key_file={key}"):
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-W", "ignore", "-m", "MAVProxy.mavproxy", "--master", f"tcp:127.0.0.1:{tcp}", "--nowait",
            f"--state-basedir={tmp_path}", "--default-modules=signing,arm", cwd=tmp_path,
            env={**os.environ, "HOME": str(tmp_path)}, stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.DEVNULL, stderr=asyncio.subprocess.DEVNULL,
        )  # fmt: skip
        assert process.stdin is not None
        try:
            async with asyncio.timeout(30.0):
                refused = 0
                while not refused:
                    process.stdin.write(b"disarm\n")
                    report = await health.next()
                    refused = sum(drop.count for drop in report.drops if drop.cause == "mavlink_damaged")
                assert requests.drain() == []
                process.stdin.write(b"signing key secret\n")
                while not (asked := requests.drain()):
                    process.stdin.write(b"disarm\n")
                    await asyncio.sleep(0.5)
            assert {request.act for request in asked} == {m.RequestAct.STOP}
        finally:
            process.kill()
            await process.wait()


async def test_what_is_signed_is_newer_than_in_every_run_before(spawn: Spawn, tmp_path: Path) -> None:
    """Also by a clock that stood still meanwhile."""
    tcp, key, stamp = find_free_port(), tmp_path / "key", tmp_path / "runtime" / STAMP_FILE
    key.write_text("secret")
    key.chmod(0o600)
    links = (f"mavlink.tcp=127.0.0.1:{tcp}", 'mavlink.udp=""', f"mavlink.signing_key_file={key}")
    begun = stamp_of(CLOCK.now_us())
    async with spawn("mavlink", *links), asyncio.timeout(10.0):
        while not stamp.exists():
            await asyncio.sleep(0.01)
    assert begun < int(stamp.read_text()) < begun + MINUTE
    ahead = begun + 60 * MINUTE
    stamp.write_text(str(ahead))
    async with spawn("mavlink", *links):
        client = await Client.connect(tcp)
        signing = client.codec.signing
        signing.secret_key = await asyncio.to_thread(read_signing_key, str(key))
        assert (await client.until("HEARTBEAT")).get_signed()
        assert ahead < signing.timestamp < ahead + MINUTE
        client.writer.close()


@pytest.mark.parametrize(
    ("setting", "text"),
    [
        (
            "mavlink.signing_key_file={folder}/absent",
            "mavlink.signing_key_file {folder}/absent: No such file or directory",
        ),
        (
            "mavlink.signing_key_file={folder}/open",
            "mavlink.signing_key_file {folder}/open: others can read it (chmod 600)",
        ),
        ("mavlink.tcp=127.0.0.1:{taken}", "mavlink.tcp 127.0.0.1:{taken}: "),
    ],
)
async def test_what_cannot_work_stops_it_with_one_line(
    setting: str, text: str, open_as: OpenAs, private_sets: tuple[str, ...], tmp_path: Path
) -> None:
    await open_as("observer")
    (tmp_path / "open").write_text("secret")
    (tmp_path / "open").chmod(0o644)
    server = await asyncio.start_server(lambda reader, writer: writer.close(), "127.0.0.1", 0)
    words = {"folder": tmp_path, "taken": server.sockets[0].getsockname()[1]}
    sets = [word for each in (*private_sets, setting.format(**words)) for word in ("--set", each)]
    command = [sys.executable, "-m", "paani", "run", "mavlink", *sets]
    done = await asyncio.to_thread(subprocess.run, command, capture_output=True, text=True, check=False, timeout=60)
    server.close()
    assert done.returncode == 2
    assert text.format(**words) in done.stderr
    assert done.stderr.count("\n") == 1
