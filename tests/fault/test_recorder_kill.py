"""SIGKILL of the recorder at any moment: every file can be read after repair, and at most one second is lost.

`RECORDER_KILLS=100 pytest -s tests/fault/test_recorder_kill.py` kills it a hundred times and prints the figures.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import signal
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import WallClock
from paani.logs.folder import recordings
from paani.logs.layout import MAGIC
from paani.logs.reader import open_log
from paani.logs.repair import is_finished, repair
from tests.at_work import at_work
from tests.conftest import OpenAs, wait_alive
from tests.unit.paani.logs.small_logs import JPEG

KILLS = int(os.environ.get("RECORDER_KILLS", "10"))
LOST_S = 1.0
PERIOD_S = 0.01
CLOCK = WallClock()
pytestmark = [pytest.mark.fault, pytest.mark.timeout(60 + 20 * KILLS)]


class Killed(NamedTuple):
    file: str
    at_us: int


async def speak(plant: Bus, camera: Bus, localization: Bus) -> None:
    """A hundred IMU samples, twenty poses and ten pictures a second."""
    imu, odometry = plant.publisher(keys.IMU), localization.publisher(keys.ODOMETRY)
    pictures = camera.picture_publisher(keys.PICTURE)
    sample: dict[str, Any] = dict.fromkeys(
        ("gyro_x_radps", "gyro_y_radps", "gyro_z_radps", "accel_x_mps2", "accel_y_mps2", "accel_z_mps2"), 0.1
    )
    number = 0
    while True:
        now_us = CLOCK.now_us()
        imu.put(m.ImuSample(source_us=now_us, **sample))
        if number % 5 == 0:
            odometry.put(m.Odometry(source_us=now_us, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.0))
        if number % 10 == 0:
            header = m.PictureHeader(source_us=now_us, frame_seq=number, frame_epoch=1, width_px=320, height_px=240)
            pictures.put_picture(header, JPEG * 15)
        number += 1
        await asyncio.sleep(PERIOD_S)


@contextlib.asynccontextmanager
async def recorder(observer: Bus, folder: Path, sets: tuple[str, ...]) -> AsyncIterator[asyncio.subprocess.Process]:
    words = [word for setting in (f"recorder.folder={folder}", "recorder.min_free_mib=0", *sets)
             for word in ("--set", setting)]  # fmt: skip
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "paani", "recorder", *words, stderr=asyncio.subprocess.PIPE
    )
    try:
        await wait_alive(observer, "recorder", process)
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()


def judge(folder: Path, killed: list[Killed]) -> list[float]:
    """Repair what the last one left; every file must open. Returns what each kill lost [s]."""
    for found in recordings(folder):
        if not is_finished(found.path):
            assert found.size_bytes > len(MAGIC), found
            repair(found.path)
    last_us: dict[str, int] = {}
    for found in recordings(folder):
        log = open_log(found.path)
        samples = list(log.records([keys.IMU.name]))
        assert log.problems == []
        numbers = [sample.seq for sample in samples]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers))) if numbers else True, found.path.name
        last_us[found.path.name] = samples[-1].log_us if samples else log.start_us
    lost = []
    for file, at_us in killed:
        before = [us for name, us in last_us.items() if us <= at_us and name >= file]
        lost.append((at_us - max(before)) * 1e-6)
    return lost


async def test_a_killed_recorder_loses_at_most_a_second(
    open_as: OpenAs, tmp_path: Path, private_sets: tuple[str, ...]
) -> None:
    """P3: the recording survives its recorder."""
    rng = random.Random(1)
    folder = tmp_path / "recordings"
    observer = await open_as("observer")
    killed: list[Killed] = []
    speaking = speak(await open_as("plant"), await open_as("camera"), await open_as("localization"))
    async with at_work(speaking):
        for number in range(KILLS):
            states = observer.queue(keys.RECORDER_STATE)
            # Every other one also ends and begins parts all the time, to be killed in the midst of that.
            async with recorder(
                observer, folder, (*private_sets, *(("recorder.part_s=0.7",) if number % 2 else ()))
            ) as own:
                state = await states.get()
                await asyncio.sleep(1.0 + 1.5 * rng.random())
                os.kill(own.pid, signal.SIGKILL)
                killed.append(Killed(state.file, CLOCK.now_us()))
                await own.wait()
    lost = await asyncio.to_thread(judge, folder, killed)
    files = len(await asyncio.to_thread(recordings, folder))
    print(
        f"{KILLS} kills, {files} files, 0 unreadable; lost {sum(lost) / len(lost):.2f} s mean, {max(lost):.2f} s worst"
    )
    assert len(lost) == KILLS
    assert max(lost) <= LOST_S
