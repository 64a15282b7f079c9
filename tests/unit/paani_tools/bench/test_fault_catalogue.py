"""What is in the catalogue of faults, and how certificates, cables and versions are made that hurt a drive."""

from __future__ import annotations

import asyncio
import os
import resource
import subprocess
import tty
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.bus.admission import Admission
from paani.bus.hearing import DEAF_S
from paani.certificates import require_certificates
from paani.clock import WallClock
from paani.config import BusConfig, load_config
from paani.errors import UserError
from paani_tools.bench.faults.cable import Cable
from paani_tools.bench.faults.drives import faults_of
from paani_tools.bench.faults.expiry import EXPIRING, KILLED, Certificates
from paani_tools.bench.faults.fault import Drive, Expected
from paani_tools.bench.faults.processes import NEEDS_A_HAND
from paani_tools.bench.faults.running import MONOTONIC, Loop, ShiftedClock
from paani_tools.bench.faults.versions import OTHER_NAMES, in_other_words
from tests.mcu_peer import until

NOW_US = WallClock().now_us()


@pytest.mark.parametrize("drive", Drive)
def test_faults_are_made_on_the_drive_that_they_are_listed_for(drive: Drive) -> None:
    assert {fault.drive for fault in faults_of(drive)} == {drive}


def test_every_process_is_killed_not_run_and_refused_memory() -> None:
    expected = {fault.name: fault.expected for fault in faults_of(Drive.PLAIN)}
    for service in (*load_config().services, "recorder"):
        killed, frozen = expected[f"{service} killed"], expected[f"{service} not running"]
        refused = expected[f"{service} refused memory"]
        assert (killed is Expected.HAND) == (service in NEEDS_A_HAND) == (refused is Expected.MAY_STAND)
        assert (frozen is Expected.GOES_ON) == (service == "recorder")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("disk full", Expected.GOES_ON),
        ("no descriptors left", Expected.GOES_ON),
        ("controller of another version", Expected.STOPS),
        ("controller's certificate expires", Expected.STOPS),
        ("advisor killed, its certificate expired", Expected.HAND),
        ("thrusters' serial line unplugged for half a second", Expected.STOPS),
        ("thrusters' serial line unplugged", Expected.HAND),
        ("bridge's serial line unplugged", Expected.GOES_ON),
    ],
)
def test_what_is_expected_of_the_boat(name: str, expected: Expected) -> None:
    assert [fault.expected for drive in Drive for fault in faults_of(drive) if fault.name == name] == [expected]


class OneProcess(Loop):
    """A drive all of whose services are one process."""

    def __init__(self, pid: int) -> None:
        self.clock, self._pid = ShiftedClock(), pid

    def pid_of(self, service: str) -> int:
        return self._pid


@pytest.mark.slow
async def test_a_process_refused_memory_is_followed_until_it_has_spoken_long_after() -> None:
    fault = next(fault for fault in faults_of(Drive.PLAIN) if fault.name == "advisor refused memory")
    process = await asyncio.create_subprocess_exec("cat", stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE)
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(b"it has all that it needs\n")
    await process.stdout.readline()
    try:
        loop, before = OneProcess(process.pid), resource.prlimit(process.pid, resource.RLIMIT_AS)
        healthy_us: dict[str, int] = {}
        loop.watch = SimpleNamespace(healthy_us=healthy_us)  # type: ignore[assignment]
        await fault.begin(loop)
        assert 0 < resource.prlimit(process.pid, resource.RLIMIT_AS)[0] < 1 << 30
        ending = asyncio.ensure_future(fault.end(loop))
        await until(lambda: resource.prlimit(process.pid, resource.RLIMIT_AS) == before)
        for heard_after_s, has_ended in ((0.5, False), (DEAF_S, False), (DEAF_S + 2.0, True)):
            healthy_us["advisor"] = MONOTONIC.now_us() + round(heard_after_s * 1e6)
            await asyncio.wait({ending}, timeout=0.2)
            assert ending.done() is has_ended
    finally:
        process.kill()
        await process.wait()


async def test_a_process_without_descriptors_is_given_none_that_it_has_not_and_has_them_back() -> None:
    fault = next(fault for fault in faults_of(Drive.PLAIN) if fault.name == "no descriptors left")
    process = await asyncio.create_subprocess_exec("cat", stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(b"\n")
        await process.stdout.readline()  # a program that is being started has the files of its libraries open
        loop, before = OneProcess(process.pid), resource.prlimit(process.pid, resource.RLIMIT_NOFILE)
        await fault.begin(loop)
        assert resource.prlimit(process.pid, resource.RLIMIT_NOFILE) == (3, before[1])  # input, output and errors
        await fault.end(loop)
        assert resource.prlimit(process.pid, resource.RLIMIT_NOFILE) == before
    finally:
        process.kill()
        await process.wait()


def test_nothing_but_the_names_of_its_fields_keeps_an_order_of_another_version_out() -> None:
    order = m.Thrust(source_us=NOW_US, left=0.3, right=0.3, enabled=True, echo_us=1)
    order = keys.THRUST.stamp(order, domain=43, seq=0, epoch=NOW_US // 1000, sent_us=NOW_US)
    data = in_other_words(order)
    assert Admission(keys.THRUST, 43, 1.0).judge(data, NOW_US) == (None, "wrong_type")
    ours = {other: name for name, other in OTHER_NAMES.items()}
    fields = {ours.get(name, name): value for name, value in msgspec.json.decode(data).items()}
    assert Admission(keys.THRUST, 43, 1.0).judge(msgspec.json.encode(fields), NOW_US) == (order, "")


@pytest.mark.slow
def test_an_expired_certificate_takes_the_place_of_one_and_gives_it_back(tmp_path: Path) -> None:
    certificates = Certificates(tmp_path)
    certificates.make()
    bus = BusConfig(certificates=str(certificates.live))
    names = {name: require_certificates(bus, keys.SERVICES).common_name(name) for name in (EXPIRING, KILLED)}
    certificates.replace(KILLED, NOW_US - 1_000_000)
    with pytest.raises(UserError, match=rf"{names[KILLED]}\.pem: expired"):
        require_certificates(bus, [KILLED])
    others = [name for name in keys.SERVICES if name != KILLED]
    require_certificates(bus, others)
    certificates.restore()
    back = require_certificates(bus, keys.SERVICES)
    assert {name: back.common_name(name) for name in names} == names


@pytest.mark.slow
async def test_a_cable_carries_both_ways_hangs_up_and_comes_back_by_its_name() -> None:
    """What is sent while it is out is lost, and the far end does not notice."""
    mcu, line = os.openpty()
    tty.setraw(line)
    os.set_blocking(mcu, False)
    cable = Cable(f"serial:{os.ttyname(line)}")
    address, device = cable.address, device_of(cable)
    try:
        os.write(device, b"call")
        await until(lambda: received(mcu) == b"call")
        os.write(mcu, b"answer")
        await until(lambda: received(device) == b"answer")
        cable.pull_out()
        with pytest.raises(OSError, match="Input/output"):
            os.write(device, b"call")
        os.close(device)
        os.write(mcu, b"nobody hears")
        await asyncio.sleep(0.05)
        cable.plug_in()
        assert cable.address == address
        device = device_of(cable)
        os.write(mcu, b"again")
        await until(lambda: received(device) == b"again")
    finally:
        cable.close()
        for descriptor in (device, mcu, line):
            os.close(descriptor)


async def test_a_cable_whose_name_another_program_has_is_not_plugged_in() -> None:
    mcu, line = os.openpty()
    cable = Cable(f"serial:{os.ttyname(line)}")
    device = device_of(cable)
    cable.pull_out()  # the device keeps its number while somebody has it open
    try:
        with pytest.raises(OSError, match="taken by another program"):
            cable.plug_in()
    finally:
        cable.close()
        for descriptor in (device, mcu, line):
            os.close(descriptor)


def device_of(cable: Cable) -> int:
    """What its user opens."""
    name = cable.address.removeprefix("serial:").partition("@")[0]
    return os.open(name, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)


def received(descriptor: int) -> bytes:
    try:
        return os.read(descriptor, 64)
    except BlockingIOError:
        return b""
