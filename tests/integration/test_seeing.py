"""Camera, perception and advisor as processes over a real router."""

from __future__ import annotations

import asyncio
import itertools
import statistics
from pathlib import Path

import cv2
import numpy as np
import pytest

from paani import keys
from paani import messages as m
from paani.bus import Latest
from paani.clock import WallClock
from tests.conftest import OpenAs, Spawn
from tests.pictures import PICTURES, noisy, river

pytestmark = pytest.mark.integration
CLEAR = m.LaneEvidence(non_water=0.05, uncertainty=0.05, clear_width=1.0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Fifteen rivers, then ten black pictures."""
    for i in range(25):
        picture = noisy(river(), 3.0, seed=i) if i < 15 else PICTURES["black"]
        cv2.imwrite(str(tmp_path / f"{i:02}.png"), picture)
    return tmp_path


async def until(inbox: Latest[m.Advisory], direction: m.Direction, reason: m.Reason) -> m.Advisory:
    async with asyncio.timeout(20):
        while True:
            advice = await inbox.next()
            if (advice.direction, advice.reason) == (direction, reason):
                return advice


async def test_pictures_become_advice_and_black_stops_it(spawn: Spawn, open_as: OpenAs, folder: Path) -> None:
    """B1, B2, J19: a folder through three processes; evidence, mask and advice name the same frames."""
    bus = await open_as("observer")
    advisory, evidence = bus.latest(keys.ADVISORY), bus.queue(keys.EVIDENCE, 64)
    mask = bus.latest_picture(keys.MASK)
    async with spawn("advisor"), spawn("perception"), spawn("camera", f"camera.source={folder}"):
        await until(advisory, m.Direction.STRAIGHT, m.Reason.CENTER_CLEAR)
        stop = await until(advisory, m.Direction.STOP, m.Reason.UNUSABLE_IMAGE)
        assert stop.cause is m.UnusableCause.BLACK
        seen = evidence.drain()
    frames = [(e.frame_epoch, e.frame_seq) for e in seen]
    assert frames == sorted(set(frames))
    first_black = next(e for e in seen if e.cause is m.UnusableCause.BLACK)
    assert first_black.frame_seq == 15
    assert (stop.frame_epoch, stop.frame_seq) in frames
    assert mask.value is not None
    assert (mask.value.header.frame_epoch, mask.value.header.frame_seq) in frames
    assert mask.value.header.media_type == "image/png"


async def test_a_frame_seen_before_or_older_is_no_evidence_again(spawn: Spawn, open_as: OpenAs) -> None:
    """B3: judged by epoch, number and stamp before any network runs, and counted; B6: the mask has a key of its own."""
    camera, observer = await open_as("camera"), await open_as("observer")
    pictures, clock = camera.picture_publisher(keys.PICTURE), WallClock()
    evidence, mask = observer.queue(keys.EVIDENCE, 64), observer.latest_picture(keys.MASK)
    health = observer.latest(keys.health("perception"))
    data = cv2.imencode(".jpg", river())[1].tobytes()
    seen: list[m.Evidence] = []

    def show(epoch: int, seq: int) -> None:
        header = m.PictureHeader(
            source_us=clock.now_us(), frame_seq=seq, frame_epoch=epoch, width_px=320, height_px=240
        )
        pictures.put_picture(header, data)

    async def judge(epoch: int, seq: int) -> None:
        show(epoch, seq)
        async with asyncio.timeout(20):
            seen.append(await evidence.get())
            picture = await mask.next()
        assert (picture.header.frame_epoch, picture.header.frame_seq) == (epoch, seq)
        cells = cv2.imdecode(np.frombuffer(picture.data, np.uint8), cv2.IMREAD_UNCHANGED)
        assert cells is not None
        assert cells.shape == (64, 80)

    async def refuse(epoch: int, seq: int, cause: str, times: int) -> None:
        show(epoch, seq)
        async with asyncio.timeout(10):
            while m.DropCount(cause=cause, count=times) not in (await health.next()).drops:
                pass

    async with spawn("perception", "perception.rate_hz=50"):
        await judge(5, 0)
        await judge(5, 1)
        await refuse(5, 1, "duplicate_frame", 1)
        await refuse(5, 0, "old_frame", 1)
        await refuse(4, 7, "old_frame", 2)
        await judge(6, 0)
    seen += evidence.drain()
    assert [(e.frame_epoch, e.frame_seq) for e in seen] == [(5, 0), (5, 1), (6, 0)]


@pytest.mark.parametrize("measured", [False, True])
async def test_a_picture_says_whether_its_camera_is_calibrated(
    spawn: Spawn, open_as: OpenAs, folder: Path, measured: bool
) -> None:
    """B2, B16: time of capture, epoch and number of every frame; no calibration unless one is established as valid."""
    observer, clock = await open_as("observer"), WallClock()
    pictures, began_us = observer.latest_picture(keys.PICTURE), clock.now_us()
    known = ("calibration.hfov_deg=70", "calibration.height_m=0.9", "calibration.valid=true") if measured else ()
    headers = []
    async with spawn("camera", f"camera.source={folder}", "camera.rate_hz=20", *known):
        async with asyncio.timeout(20):
            for _ in range(3):
                headers.append((await pictures.next()).header)
    assert {header.calibrated for header in headers} == {measured}
    assert len({header.frame_epoch for header in headers}) == 1
    assert [header.frame_seq for header in headers] == sorted({header.frame_seq for header in headers})
    stamps_us = [header.source_us for header in headers]
    assert began_us < stamps_us[0] < stamps_us[1] < stamps_us[2] <= clock.now_us()


async def test_the_advice_stops_when_the_evidence_ends(spawn: Spawn, open_as: OpenAs) -> None:
    """J14, J16, J17: NO_DATA before any evidence; republished with its date; STOP once it is older than 0.6 s."""
    perception, observer = await open_as("perception"), await open_as("observer")
    publisher, advisory = perception.publisher(keys.EVIDENCE), observer.latest(keys.ADVISORY)
    clock = WallClock()
    async with spawn("advisor"):
        await until(advisory, m.Direction.NO_DATA, m.Reason.NO_EVIDENCE)
        sent = publisher.put(evidence_at(clock.now_us()))
        given = [await until(advisory, m.Direction.STRAIGHT, m.Reason.CENTER_CLEAR)]
        async with asyncio.timeout(5):
            while given[-1].direction is m.Direction.STRAIGHT:
                given.append(await advisory.next())
        late_s = (clock.now_us() - sent.source_us) * 1e-6
    assert len(given) >= 3
    assert {(a.source_us, a.frame_seq) for a in given} == {(sent.source_us, 0)}
    assert given[-1].reason is m.Reason.STALE_EVIDENCE
    assert 0.6 <= late_s < 0.9


async def test_the_simulators_pictures_keep_their_time(spawn: Spawn, open_as: OpenAs) -> None:
    """A9: the camera passes the rendered picture on with the stamp of the pose that it shows."""
    eye, observer = await open_as("eye"), await open_as("observer")
    rendered, pictures = eye.picture_publisher(keys.RENDERED), observer.latest_picture(keys.PICTURE)
    data = cv2.imencode(".jpg", river())[1].tobytes()
    clock = WallClock()
    async with spawn("camera", "camera.source=sim"):
        for seq in range(4):
            stamp_us = clock.now_us() - 100_000
            header = m.PictureHeader(
                source_us=stamp_us, frame_seq=seq % 2, frame_epoch=seq // 2, width_px=320, height_px=240
            )
            rendered.put_picture(header, data)
            async with asyncio.timeout(10):
                picture = await pictures.next()
            assert picture.header.source_us == stamp_us
            assert picture.data == data
            assert picture.header.frame_seq == seq % 2


def evidence_at(now_us: int) -> m.Evidence:
    return m.Evidence(
        source_us=now_us, frame_seq=0, frame_epoch=1, width_px=320, height_px=240, usable=True,
        left=CLEAR, center=CLEAR, right=CLEAR, segmentation=m.SegmentationSource.LEARNED, navigation_eligible=True,
    )  # fmt: skip


async def test_j17_advice_is_repeated_five_times_a_second(spawn: Spawn, open_as: OpenAs) -> None:
    """Of nothing, too."""
    advisory, sent_us = (await open_as("observer")).latest(keys.ADVISORY), []
    async with spawn("advisor"), asyncio.timeout(20):
        for _ in range(9):
            sent_us.append((await advisory.next()).sent_us)
    gaps_us = [after - before for before, after in itertools.pairwise(sent_us)]
    assert statistics.median(gaps_us) == pytest.approx(200_000, rel=0.1)


async def test_j16_j17_perception_takes_pictures_at_its_own_rate_and_none_that_is_old(
    spawn: Spawn, open_as: OpenAs
) -> None:
    camera, observer, clock = await open_as("camera"), await open_as("observer"), WallClock()
    pictures, evidence = camera.picture_publisher(keys.PICTURE), observer.queue(keys.EVIDENCE, 64)
    data, numbers = cv2.imencode(".jpg", river())[1].tobytes(), itertools.count()

    def put(age_us: int) -> None:
        taken_us = clock.now_us() - age_us
        header = m.PictureHeader(
            source_us=taken_us, frame_seq=next(numbers), frame_epoch=5, width_px=320, height_px=240
        )
        pictures.put_picture(header, data)

    async with spawn("perception", "perception.rate_hz=2"):
        async with asyncio.timeout(20):
            while not evidence.drain():
                put(0)
                await asyncio.sleep(0.1)
        for _ in range(30):
            put(0)
            await asyncio.sleep(0.1)
        assert 5 <= len(evidence.drain()) <= 7
        put(900_000)
        async with asyncio.timeout(10):
            while (await evidence.get()).cause is not m.UnusableCause.STALE:
                pass
