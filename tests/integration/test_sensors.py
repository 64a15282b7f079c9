"""The sensor process on pseudo-terminals: real bytes, a real router, and devices that misbehave."""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from pyais import encode_dict

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.messages import SensorRole, SensorStatus
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn
from tests.paani_command import paani
from tests.places import DATA
from tests.unit.paani_services.sensors.written import imu_line, lidar_turn, nav_pvt, rmc, sentence

pytestmark = pytest.mark.integration
LOGS = DATA / "logs"
LATITUDE_DEG, LONGITUDE_DEG = 48.1173, 11.5166667


class Terminal:
    """A device on a pseudo-terminal, under a name that stays when it is plugged in again."""

    def __init__(self, link: Path) -> None:
        self.link = link
        self.address = f"serial:{link}"
        self._ends: tuple[int, int] | None = None

    def plug(self) -> None:
        self._ends = os.openpty()
        os.set_blocking(self._ends[0], False)
        self.link.symlink_to(os.ttyname(self._ends[1]))

    def unplug(self) -> None:
        if self._ends is not None:
            self.link.unlink()
            for end in self._ends:
                os.close(end)
            self._ends = None

    def write(self, data: bytes) -> None:
        """What does not fit is lost, as on a wire."""
        if self._ends is not None:
            with contextlib.suppress(BlockingIOError):
                os.write(self._ends[0], data)


@pytest.fixture
def private_sets(private_sets: tuple[str, ...]) -> tuple[str, ...]:
    return (*private_sets, "profile=hull")


@pytest.fixture
def terminals(tmp_path: Path) -> Iterator[dict[str, Terminal]]:
    found = {name: Terminal(tmp_path / name) for name in ("gps", "imu", "heading")}
    for terminal in found.values():
        terminal.plug()
    yield found
    for terminal in found.values():
        terminal.unplug()


def lines_of(terminals: dict[str, Terminal]) -> tuple[str, ...]:
    return tuple(f'sensors.{name}.line="{terminal.address}"' for name, terminal in terminals.items())


class Boat:
    """Drives north-east at 1 m/s: NAV-PVT among GSV at 5 Hz, samples at 100 Hz, headings at 10 Hz."""

    def __init__(self, terminals: dict[str, Terminal]) -> None:
        self.terminals = terminals
        self.noise = random.Random(1)
        self.gps: Callable[[int], bytes] = self.fix
        self.step = 0

    def fix(self, step: int) -> bytes:
        along_deg = 0.01 * step * math.sqrt(0.5) / 111_200.0
        pvt = nav_pvt(
            10 * step,
            latitude_deg=LATITUDE_DEG + along_deg,
            longitude_deg=LONGITUDE_DEG + along_deg / math.cos(math.radians(LATITUDE_DEG)),
            sog_mmps=1000,
            course_deg=45.0,
        )
        return sentence("GPGSV,1,1,00").encode() + pvt

    def sample(self, step: int) -> bytes:
        accel = (self.noise.gauss(0.0, 0.03), self.noise.gauss(0.0, 0.03), 9.81 + self.noise.gauss(0.0, 0.03))
        return imu_line(10 * step, accel, (0.0, 0.0, self.noise.gauss(0.0, 0.1)))

    async def drive(self) -> None:
        loop = asyncio.get_running_loop()
        start_s = loop.time()
        while True:
            self.terminals["imu"].write(self.sample(self.step))
            if self.step % 20 == 0:
                self.terminals["gps"].write(self.gps(self.step))
            if self.step % 10 == 5:
                self.terminals["heading"].write(sentence(f"GNHDT,{45.0 + self.noise.gauss(0.0, 0.3):.2f},T").encode())
            self.step += 1
            await asyncio.sleep(start_s + 0.01 * self.step - loop.time())


async def device(
    bus: Bus, role: SensorRole, until: Callable[[m.SensorDevice], bool], within_s: float
) -> m.SensorDevice:
    """The first report of the device that fits; fails with the last one otherwise."""
    states = bus.latest(keys.SENSORS_STATE)
    found = None
    try:
        async with asyncio.timeout(within_s):
            while True:
                state = await states.next()
                found = next(each for each in state.devices if each.role is role)
                if until(found):
                    return found
    except TimeoutError:
        pytest.fail(f"after {within_s} s: {found}")


def has(status: SensorStatus) -> Callable[[m.SensorDevice], bool]:
    return lambda found: found.status is status


def is_at(rate_hz: float) -> Callable[[m.SensorDevice], bool]:
    return lambda found: found.rate_hz > 0.9 * rate_hz


async def test_a_drive_on_three_serial_lines_reaches_the_estimator(
    spawn: Spawn, open_as: OpenAs, terminals: dict[str, Terminal]
) -> None:
    """Every device is in order, the estimate becomes healthy, and it lies where the receiver says."""
    bus = await open_as("observer")
    async with spawn("sensors", *lines_of(terminals)), spawn("localization"):
        odometry, gps, health = bus.latest(keys.ODOMETRY), bus.latest(keys.GPS), bus.latest(keys.health("sensors"))
        async with at_work(Boat(terminals).drive()):
            for role, rate_hz in ((SensorRole.GPS, 5.0), (SensorRole.IMU, 100.0), (SensorRole.HEADING, 10.0)):
                found = await device(bus, role, is_at(rate_hz), 15.0)
                assert found.status is SensorStatus.OK
                assert (found.checksum_failures, found.damaged, found.withheld, found.reconnections) == (0, 0, 0, 0)
            async with asyncio.timeout(20.0):
                while not (estimate := await odometry.next()).healthy:
                    pass
            for _ in range(40):
                estimate = await odometry.next()
            assert gps.value is not None
            assert gps.value.producer == "sensors"
            north_m = (estimate.latitude_deg - gps.value.latitude_deg) * 111_200.0
            assert abs(north_m) < 3.0
            assert math.hypot(estimate.surge_mps, estimate.sway_mps) == pytest.approx(1.0, abs=0.3)
            assert estimate.yaw_rad == pytest.approx(math.radians(45.0), abs=0.05)
            assert health.value is not None
            assert "gps ok" in health.value.note


async def test_a_receiver_pulled_out_and_plugged_in_again_is_back_by_itself(
    spawn: Spawn, open_as: OpenAs, terminals: dict[str, Terminal]
) -> None:
    bus = await open_as("observer")
    async with spawn("sensors", *lines_of(terminals)), at_work(Boat(terminals).drive()):
        await device(bus, SensorRole.GPS, has(SensorStatus.OK), 10.0)
        terminals["gps"].unplug()
        gone = await device(bus, SensorRole.GPS, has(SensorStatus.ABSENT), 5.0)
        assert "next try" in gone.note
        fixes, health = bus.latest(keys.GPS), bus.latest(keys.health("sensors"))
        await asyncio.sleep(2.5)
        assert fixes.received == 0
        assert health.value is not None
        assert health.value.cpu_cores < 0.5  # no busy loop
        assert "gps absent" in health.value.note
        terminals["gps"].plug()
        back = await device(bus, SensorRole.GPS, has(SensorStatus.OK), 12.0)
        assert back.reconnections == 1
        assert fixes.received > 0
        assert (await device(bus, SensorRole.IMU, has(SensorStatus.OK), 2.0)).reconnections == 0


async def test_a_device_that_babbles_is_named_and_costs_the_others_nothing(
    spawn: Spawn, open_as: OpenAs, terminals: dict[str, Terminal]
) -> None:
    bus, noise = await open_as("observer"), random.Random(2).randbytes(4000)

    async def babble() -> None:
        while True:
            terminals["gps"].write(noise)
            await asyncio.sleep(0.002)

    async with (
        spawn("sensors", *lines_of(terminals)),
        at_work(Boat({**terminals, "gps": terminals["heading"]}).drive(), babble()),
    ):
        named = await device(bus, SensorRole.GPS, lambda each: "babbles" in each.note, 10.0)
        assert named.status is SensorStatus.ABSENT
        health = bus.latest(keys.health("sensors"))
        await asyncio.sleep(2.5)
        assert (await device(bus, SensorRole.IMU, has(SensorStatus.OK), 2.0)).rate_hz > 80.0
        assert health.value is not None
        assert health.value.cpu_cores < 0.5


async def test_another_baud_rate_is_told_from_silence(
    spawn: Spawn, open_as: OpenAs, terminals: dict[str, Terminal]
) -> None:
    bus, noise = await open_as("observer"), random.Random(3)
    boat = Boat(terminals)
    boat.gps = lambda _: noise.randbytes(60)
    async with spawn("sensors", *lines_of({"gps": terminals["gps"], "imu": terminals["imu"]})), at_work(boat.drive()):
        found = await device(bus, SensorRole.GPS, has(SensorStatus.UNREADABLE), 8.0)
        assert "baud" in found.note
        boat.gps = lambda _: b""
        await device(bus, SensorRole.GPS, has(SensorStatus.SILENT), 8.0)
        boat.gps = boat.fix
        await device(bus, SensorRole.GPS, has(SensorStatus.OK), 5.0)


async def test_a_receiver_that_freezes_gives_no_fixes_and_one_that_rests_does(
    spawn: Spawn, open_as: OpenAs, terminals: dict[str, Terminal]
) -> None:
    bus = await open_as("observer")
    boat = Boat(terminals)
    boat.gps = lambda step: nav_pvt(10 * step, sog_mmps=20)  # at rest: one position, time goes on
    async with spawn("sensors", *lines_of(terminals)), at_work(boat.drive()):
        await device(bus, SensorRole.GPS, lambda each: each.rate_hz > 4.5, 12.0)
        assert (await device(bus, SensorRole.GPS, has(SensorStatus.OK), 2.0)).withheld == 0
        frozen = nav_pvt(10 * boat.step + 100, sog_mmps=20)
        boat.gps = lambda _: frozen
        found = await device(bus, SensorRole.GPS, has(SensorStatus.FROZEN), 5.0)
        assert "time" in found.note
        fixes = bus.latest(keys.GPS)
        await asyncio.sleep(2.0)
        assert fixes.received == 0
        boat.gps = boat.fix
        await device(bus, SensorRole.GPS, has(SensorStatus.OK), 5.0)


@pytest.mark.parametrize(("speed", "least_s", "most_s"), [("", 2.5, 6.0), ("?speed=4", 0.5, 2.4)])
async def test_a_recording_plays_in_its_own_time_or_faster(
    spawn: Spawn, open_as: OpenAs, tmp_path: Path, speed: str, least_s: float, most_s: float
) -> None:
    bus, log = await open_as("observer"), tmp_path / "drive.nmea"
    log.write_bytes(b"".join(rmc(f"1235{second:02d}") for second in range(10, 18 if speed else 14)))
    fixes = bus.queue(keys.GPS, 20)
    async with spawn("sensors", f'sensors.gps.line="file:{log}{speed}"'):
        await device(bus, SensorRole.GPS, lambda each: "played to the end" in each.note, 20.0)
    found = fixes.drain()
    assert len(found) == (8 if speed else 4)
    assert least_s < (found[-1].source_us - found[0].source_us) * 1e-6 < most_s


async def test_a_recording_that_is_not_there_is_named_and_looked_for_again(
    spawn: Spawn, open_as: OpenAs, tmp_path: Path
) -> None:
    bus, log = await open_as("observer"), tmp_path / "drive.nmea"
    async with spawn("sensors", f'sensors.gps.line="file:{log}"'):
        found = await device(bus, SensorRole.GPS, lambda each: "No such file" in each.note, 5.0)
        assert found.status is SensorStatus.ABSENT
        log.write_bytes(rmc("123510") + rmc("123511"))
        await device(bus, SensorRole.GPS, lambda each: "played to the end" in each.note, 15.0)


@pytest.mark.data
@pytest.mark.skipif(not LOGS.is_dir(), reason=f"no logs at {LOGS}; set PAANI_DATA")
async def test_a_sailing_log_plays_through_the_same_adapter_as_fast_as_it_can(spawn: Spawn, open_as: OpenAs) -> None:
    bus = await open_as("observer")
    async with spawn("sensors", f'sensors.gps.line="file:{LOGS}/plaka_sail.nmea?speed=max"'):
        found = await device(bus, SensorRole.GPS, lambda each: "played to the end" in each.note, 60.0)
        assert (found.checksum_failures, found.damaged, found.withheld) == (0, 0, 0)
        assert found.frames == 3625 * 14 + 3624 + 3625


async def test_paani_sensors_shows_what_each_says_and_what_is_missing(
    spawn: Spawn, open_as: OpenAs, private_sets: tuple[str, ...], terminals: dict[str, Terminal]
) -> None:
    bus = await open_as("observer")
    terminals["heading"].unplug()
    async with spawn("sensors", *lines_of(terminals)), at_work(Boat(terminals).drive()):
        await device(bus, SensorRole.IMU, lambda each: each.rate_hz > 90.0, 10.0)
        code, out, errors = await paani(private_sets, "sensors", "--for", "2.5")
        assert (code, errors) == (1, "")
        gps, imu, heading, *others, lacks = out.split("\n\n")[1].splitlines()
        assert gps.startswith("gps     ok")
        assert "48.11" in gps
        assert "m/s^2" in imu
        assert heading.startswith("heading absent")
        assert "next try" in heading
        wanted = [[role, "off"] for role in (SensorRole.AIS, SensorRole.LIDAR, SensorRole.SONAR)]
        assert [each.split()[:2] for each in others] == wanted, "a boat without them lacks nothing"
        assert lacks == "missing: a heading: the boat stays stopped without one"
        terminals["heading"].plug()
        await device(bus, SensorRole.HEADING, has(SensorStatus.OK), 10.0)
        code, out, errors = await paani(private_sets, "sensors", "--for", "2.5", "--json")
        assert (code, errors) == (0, "")
        row = msgspec.json.decode(out.splitlines()[-1])
        assert [each["status"] for each in row["devices"]] == ["ok", "ok", "ok", "off", "off", "off"]
        assert row["missing"] == ""
        assert row["imu"]["orientation_available"]


async def test_paani_sensors_says_when_nothing_runs(
    open_as: OpenAs, private_sets: tuple[str, ...], config: object
) -> None:
    code, out, errors = await paani(private_sets, "sensors", "--for", "1")
    assert (code, out) == (2, "")
    assert "sensors/state" in errors
    assert len(errors.splitlines()) == 1
    code, _, errors = await paani((*private_sets, "bus.router=tcp/127.0.0.1:1"), "sensors")
    assert code == 2
    assert "nothing listens there" in errors


async def test_vessels_that_speak_on_a_serial_line_reach_the_bus(spawn: Spawn, open_as: OpenAs, tmp_path: Path) -> None:
    """An empty river says nothing, and that is in order; a receiver that is pulled out says nobody."""
    bus, receiver = await open_as("observer"), Terminal(tmp_path / "ais")
    receiver.plug()
    ais = bus.latest(keys.AIS)
    async with spawn("sensors", f'sensors.ais.line="{receiver.address}"'):
        await device(bus, SensorRole.AIS, has(SensorStatus.OK), 12.0)
        assert (await ais.next()).vessels == ()
        report: dict[str, Any] = {"type": 1, "mmsi": 235000001, "lat": 51.4, "lon": -0.9, "speed": 4.0, "course": 90.0}
        size: dict[str, Any] = {"type": 5, "mmsi": 235000001, "to_bow": 8, "to_stern": 6, "to_port": 1}
        for line in (*encode_dict(size, sentence_type="VDM"), *encode_dict(report, sentence_type="VDM")):
            receiver.write(f"{line}\r\n".encode())
        async with asyncio.timeout(10.0):
            while not (heard := (await ais.next()).vessels):
                pass
        assert (heard[0].mmsi, heard[0].to_bow_m, heard[0].cog_rad) == (235000001, 8.0, 0.0)
        receiver.unplug()
        await device(bus, SensorRole.AIS, has(SensorStatus.ABSENT), 12.0)
        received = ais.received
        await asyncio.sleep(2.5)
        assert ais.received == received


async def test_the_turns_of_a_scanner_on_a_serial_line_reach_the_bus(
    spawn: Spawn, open_as: OpenAs, tmp_path: Path
) -> None:
    """What is 2 m to starboard is 90 degrees clockwise for the scanner, and at -90 degrees on the bus."""
    bus, scanner, noise = await open_as("observer"), Terminal(tmp_path / "lidar"), random.Random(1)
    scanner.plug()
    scans = bus.latest(keys.SCAN)
    async with spawn("sensors", f'sensors.lidar.line="{scanner.address}"'):
        async with asyncio.timeout(15.0):
            while scans.value is None:
                turn = lidar_turn(lambda deg: 2.0 + noise.uniform(0.0, 0.02) if abs(deg - 90.0) < 5.0 else 0.0)
                scanner.write(turn)
                await asyncio.sleep(0.1)
        scan = scans.value
        seen_deg = [math.degrees(scan.first_bearing_rad + k * scan.step_rad) for k, r in enumerate(scan.ranges_m) if r]
        assert (min(seen_deg), max(seen_deg)) == pytest.approx((-94.5, -85.5), abs=1.5)
        await device(bus, SensorRole.LIDAR, has(SensorStatus.OK), 5.0)
        scanner.unplug()
        await device(bus, SensorRole.LIDAR, has(SensorStatus.ABSENT), 12.0)


async def test_soundings_on_a_serial_line_reach_the_bus(spawn: Spawn, open_as: OpenAs, tmp_path: Path) -> None:
    """Below the transducer by the sentence; below the surface on the bus."""
    bus, sounder, number = await open_as("observer"), Terminal(tmp_path / "sonar"), 0
    sounder.plug()
    depths = bus.latest(keys.DEPTH)
    async with spawn("sensors", f'sensors.sonar.line="{sounder.address}"', "sensors.sonar.transducer_m=0.2"):
        async with asyncio.timeout(15.0):
            while depths.value is None:
                number += 1
                sounder.write(sentence(f"SDDPT,{3.0 + 0.01 * (number % 3):.2f},").encode())
                await asyncio.sleep(0.2)
        assert depths.value.depth_m == pytest.approx(3.21, abs=0.02)
        await device(bus, SensorRole.SONAR, has(SensorStatus.OK), 5.0)
