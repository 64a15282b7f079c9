"""The real recorder on a real bus: what was put is in the file, to the byte, and the sums are right."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import threading
from collections.abc import AsyncIterator, Sequence
from pathlib import Path

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus, Queue
from paani.clock import WallClock
from paani.config import load_config
from paani.logs.folder import recordings
from paani.logs.reader import open_log
from paani.logs.repair import is_finished
from paani_services.recorder.backlog import QueuedMessage
from paani_services.recorder.recording import Recording
from paani_services.recorder.service import run
from tests.conftest import OpenAs, Spawn, put_raw
from tests.unit.paani.logs.small_logs import JPEG, unfinished

pytestmark = pytest.mark.integration
CLOCK = WallClock()


def odometry(number: int) -> m.Odometry:
    return m.Odometry(source_us=CLOCK.now_us(), x_m=float(number), y_m=0.0, yaw_rad=0.0, surge_mps=0.0)


async def state_when(states: Queue[m.RecorderState], condition: object) -> m.RecorderState:
    async with asyncio.timeout(10):
        while True:
            state = await states.get()
            if callable(condition) and condition(state):
                return state


@contextlib.asynccontextmanager
async def recording(spawn: Spawn, open_as: OpenAs, folder: Path, *sets: str) -> AsyncIterator[Queue[m.RecorderState]]:
    states = (await open_as("observer")).queue(keys.RECORDER_STATE)
    async with spawn("recorder", f"recorder.folder={folder}", "recorder.min_free_mib=0", *sets):
        yield states


class Recorded:
    """All of a folder's one drive."""

    def __init__(self, folder: Path) -> None:
        self.files = sorted(folder.glob("*.mcap"))
        self.finished = [is_finished(path) for path in self.files]
        log = open_log(folder)
        self.data: dict[str, list[bytes]] = {}
        for record in log.records():
            self.data.setdefault(record.topic, []).append(record.data)
        self.problems, self.counts, self.config = log.problems, log.metadata("recorder"), log.config()


async def recorded(folder: Path) -> Recorded:
    return await asyncio.to_thread(Recorded, folder)


async def test_what_was_on_the_bus_is_in_the_file(open_as: OpenAs, spawn: Spawn, tmp_path: Path) -> None:
    """P3: produced = written + dropped, by the numbers of the producers."""
    localization, camera, plant = [await open_as(name) for name in ("localization", "camera", "plant")]
    async with recording(spawn, open_as, tmp_path / "r") as states:
        poses, pictures = localization.publisher(keys.ODOMETRY), camera.picture_publisher(keys.PICTURE)
        truth = plant.publisher(keys.TRUE_POSE)
        sent: list[bytes] = []
        headers: list[bytes] = []
        for number in range(200):
            sent.append(msgspec.json.encode(poses.put(odometry(number))))
            if number % 10 == 0:
                header = m.PictureHeader(
                    source_us=CLOCK.now_us(), frame_seq=number, frame_epoch=1, width_px=320, height_px=240
                )
                headers.append(msgspec.json.encode(pictures.put_picture(header, JPEG)))
            await asyncio.sleep(0.005)
        truth.put(
            m.TruePose(
                source_us=CLOCK.now_us(), sim_us=0, x_m=0, y_m=0, z_m=0, roll_rad=0, pitch_rad=0, yaw_rad=0,
                surge_mps=0, sway_mps=0, yaw_rate_radps=0,
            )
        )  # fmt: skip
        put_raw(localization, keys.ODOMETRY.name, b"\xff is no message")
        state = await state_when(
            states, lambda s: any(t.topic == "localization/odometry" and t.written == 201 for t in s.topics)
        )
        assert (state.recording, state.problem, state.dropped, state.missing) == (True, "", 0, 0)
        assert next(t for t in state.topics if t.topic == "localization/odometry").unreadable == 1
    log = await recorded(tmp_path / "r")
    assert [path.name for path in log.files] == [state.file]
    assert log.finished == [True]
    assert log.problems == []
    assert log.data["localization/odometry"] == sent
    assert log.data["localization/odometry/unreadable"] == [b"\xff is no message"]
    assert log.data["camera/picture/header"] == headers
    assert len(log.data["camera/picture"]) == len(headers) == 20
    assert len(log.data["@truth/pose"]) == 1
    assert log.counts["localization/odometry"] == "written=201 dropped=0 missing=0 unreadable=1"
    assert log.data["recorder/state"]
    assert log.config.recorder.folder == str(tmp_path / "r")


async def test_numbers_that_never_arrived_are_missing(open_as: OpenAs, spawn: Spawn, tmp_path: Path) -> None:
    localization = await open_as("localization")
    async with recording(spawn, open_as, tmp_path) as states:
        for seq in (0, 1, 2, 7, 8):
            pose = msgspec.structs.replace(odometry(seq), seq=seq, epoch=3)
            put_raw(localization, keys.ODOMETRY.name, msgspec.json.encode(pose))
            await asyncio.sleep(0.02)
        await state_when(states, lambda s: s.missing == 4)
    counts = (await recorded(tmp_path)).counts
    assert counts["localization/odometry"] == "written=5 dropped=0 missing=4 unreadable=0"


async def test_pictures_are_dropped_before_anything_else(
    open_as: OpenAs, private_sets: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """P3: while the disk holds up the writing, a queue of 20 messages takes bursts of pictures; what was dropped is
    counted, on the bus and in the file.
    """
    is_held, may_go_on, write, loop = asyncio.Event(), threading.Event(), Recording.write, asyncio.get_running_loop()

    def held_up(recording: Recording, messages: Sequence[QueuedMessage], now_us: int) -> None:
        if messages:
            loop.call_soon_threadsafe(is_held.set)
            may_go_on.wait()
        write(recording, messages, now_us)

    monkeypatch.setattr(Recording, "write", held_up)
    sets = (f"recorder.folder={tmp_path}", "recorder.min_free_mib=0", "recorder.queue_messages=20")
    own = 'recorder.leave_out=["recorder/state", "health/recorder"]'
    config = load_config(sets=(*private_sets, *sets, own))
    observer, localization, camera = [await open_as(name) for name in ("observer", "localization", "camera")]
    states, poses = observer.queue(keys.RECORDER_STATE), localization.publisher(keys.ODOMETRY)
    pictures = camera.picture_publisher(keys.PICTURE)
    recorder = asyncio.create_task(run(await open_as("recorder"), CLOCK, config))
    try:
        await state_when(states, lambda s: s.recording)
        poses.put(odometry(0))
        async with asyncio.timeout(10):
            await is_held.wait()
        for burst in range(1, 4):
            for number in range(40):
                header = m.PictureHeader(
                    source_us=CLOCK.now_us(), frame_seq=number, frame_epoch=burst, width_px=320, height_px=240
                )
                pictures.put_picture(header, JPEG)
            poses.put(odometry(burst))
            await state_when(states, lambda s, sent=41 * burst: s.waiting + s.dropped == sent)
        may_go_on.set()
        await state_when(states, lambda s: any(t.topic == "camera/picture" and t.written for t in s.topics))
    finally:
        may_go_on.set()
        recorder.cancel()
        await asyncio.gather(recorder, return_exceptions=True)
    log = await recorded(tmp_path)
    assert len(log.data["camera/picture"]) == 17
    assert log.counts == {
        "camera/picture": "written=17 dropped=103 missing=0 unreadable=0",
        "localization/odometry": "written=4 dropped=0 missing=0 unreadable=0",
    }


async def test_an_unfinished_file_is_repaired_while_the_next_is_written(
    open_as: OpenAs, spawn: Spawn, tmp_path: Path
) -> None:
    torn = await asyncio.to_thread(unfinished, tmp_path, 40, 10)
    async with recording(spawn, open_as, tmp_path) as states:
        await state_when(states, lambda s: s.recording)
        async with asyncio.timeout(10):
            while not await asyncio.to_thread(is_finished, torn):
                await asyncio.sleep(0.05)
    mended = await asyncio.to_thread(open_log, torn)
    assert mended.problems == []
    assert mended.topics["localization/odometry"] == 40
    assert len(await asyncio.to_thread(recordings, tmp_path)) == 2


async def test_a_full_disk_is_reported_and_nothing_is_written(open_as: OpenAs, spawn: Spawn, tmp_path: Path) -> None:
    bus: Bus = await open_as("observer")
    states = bus.queue(keys.RECORDER_STATE)
    async with spawn("recorder", f"recorder.folder={tmp_path}", "recorder.min_free_mib=900000000"):
        state = await state_when(states, lambda s: not s.recording)
    assert "recorder.min_free_mib" in state.problem
    assert await asyncio.to_thread(lambda: list(tmp_path.iterdir())) == [tmp_path / "runtime"]


@pytest.mark.usefixtures("open_as")
async def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path, private_sets: tuple[str, ...]) -> None:
    (tmp_path / "file").touch()
    words = [word for setting in private_sets for word in ("--set", setting)]
    for folder, expected in ((tmp_path / "file" / "x", "Not a directory"), ("", "not set")):
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "paani", "recorder", *words, "--set", f'recorder.folder="{folder}"',
            stderr=asyncio.subprocess.PIPE,
        )  # fmt: skip
        _, errors = await process.communicate()
        assert process.returncode == 2
        assert expected in errors.decode()
