"""Sensor process: devices of a real hull in; fixes, samples, vessels, scans and soundings out."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import Clock, MonotonicClock, WallTime, has_passed
from paani.config import Config
from paani.config.sensors import recording_of
from paani.serial_port import PortError, open_port
from paani_services.sensors.backoff import Backoff
from paani_services.sensors.playback import play
from paani_services.sensors.suite import Reading, SensorSuite

MAX_BYTES_PER_S = 100_000  # more than a line of 921600 baud carries: the device babbles
REPORT_S = 1.0


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Publish what the devices say, and their state once a second."""
    suite = SensorSuite(config.sensors)
    steady = MonotonicClock()
    wall_time = WallTime(clock, steady)
    gps, imu, state = bus.publisher(keys.GPS), bus.publisher(keys.IMU), bus.publisher(keys.SENSORS_STATE)
    ais, scan, depth = bus.publisher(keys.AIS), bus.publisher(keys.SCAN), bus.publisher(keys.DEPTH)

    def publish(reading: Reading) -> None:
        reading = reading.dated(wall_time.offset_us())
        for fix in reading.fixes:
            gps.put(fix)
        for sample in reading.samples:
            imu.put(sample)
        for turn in reading.scans:
            scan.put(turn)
        for sounding in reading.depths:
            depth.put(sounding)

    with bus.alive():
        async with asyncio.TaskGroup() as group:
            for address in suite.lines:
                group.create_task(_serve_line(address, suite, publish, steady))
            counted = Counter[str]()
            while True:
                now_us, steady_us = clock.now_us(), steady.now_us()
                devices = suite.report(steady_us)
                state.put(m.SensorsState(source_us=now_us, devices=devices))
                vessels = suite.vessels(steady_us)
                if vessels is not None:
                    dated = tuple(_dated_fix(each, wall_time.offset_us()) for each in vessels)
                    ais.put(m.AisVessels(source_us=now_us, vessels=dated))
                bus.note(_summary(devices))
                for cause, n in (suite.drops - counted).items():
                    bus.count_drop(cause, n)
                counted = suite.drops.copy()
                await asyncio.sleep(REPORT_S)


def _dated_fix(vessel: m.AisVessel, offset_us: int) -> m.AisVessel:
    return msgspec.structs.replace(vessel, fixed_us=max(vessel.fixed_us + offset_us, 0))


async def _serve_line(address: str, suite: SensorSuite, publish: Callable[[Reading], None], steady: Clock) -> None:
    """Open a line, and open it again whenever it is lost."""
    backoff = Backoff()
    while True:
        frames = suite.lines[address].frames
        try:
            async for data in _play_file(address) if address.startswith("file:") else _read_port(address, steady):
                if data is None:
                    suite.opened(address, steady.now_us())
                else:
                    publish(suite.take(address, data, steady.now_us()))
        except PortError as error:
            wait_s = backoff.after(is_useful=suite.lines[address].frames > frames)
            suite.lost(address, f"{error}; next try after {wait_s:g} s")
            await asyncio.sleep(wait_s)
        else:
            suite.lost(address, "played to the end")
            return


async def _read_port(address: str, steady: Clock) -> AsyncIterator[bytes | None]:
    """None once the device is open, then its bytes. Raises PortError when it is not to be had, gone, or babbles."""
    port = await open_port(address)
    try:
        yield None
        began_us, n = steady.now_us(), 0
        while True:
            data = await port.read()
            now_us = steady.now_us()
            if has_passed(began_us, 1e6, now_us):
                began_us, n = now_us, 0
            n += len(data)
            if n > MAX_BYTES_PER_S:
                raise PortError(f"{address}: babbles, with over {MAX_BYTES_PER_S // 1000} kB in a second")
            yield data
    finally:
        await port.close()


async def _play_file(address: str) -> AsyncIterator[bytes | None]:
    """None once the log is open, then its bytes at the time and speed that they are due. Raises PortError."""
    name, speed = recording_of(address)
    try:
        log = await asyncio.to_thread(Path(name).open, "rb")
    except OSError as error:
        raise PortError(f"{address}: {error.strerror}") from error
    try:
        yield None
        pieces = play(log)
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while (piece := await asyncio.to_thread(next, pieces, None)) is not None:
            if speed is not None:
                due_s += piece.wait_s / speed
                await asyncio.sleep(due_s - loop.time())
            yield piece.data
    finally:
        await asyncio.to_thread(log.close)


def _summary(devices: tuple[m.SensorDevice, ...]) -> str:
    return "; ".join(
        f"{device.role} {device.status}" + (f" ({device.note})" if device.note else "")
        for device in devices
        if device.status is not m.SensorStatus.OFF
    )
