"""Camera process: whatever `camera.source` names, as pictures on the bus."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

import cv2
import msgspec

from paani import keys
from paani import messages as m
from paani.arrays import U8
from paani.bus import Bus
from paani.clock import Clock, patience_us
from paani.config import CameraConfig, Config
from paani_services.camera.picture_sources import Frame, Webcam, fitted, play, webcam_index

T = TypeVar("T")


class Output:
    """Numbers the pictures and publishes them; every picture is a distinct frame."""

    def __init__(self, bus: Bus, clock: Clock) -> None:
        self._publisher, self._clock = bus.picture_publisher(keys.PICTURE), clock
        self._epoch, self._seq = clock.now_us() // 1000, -1

    def begin_again(self) -> None:
        """The source began again: nothing before compares with what follows."""
        self._publisher.new_epoch()
        self._epoch, self._seq = max(self._epoch + 1, self._clock.now_us() // 1000), -1

    def put(self, data: bytes, header: m.PictureHeader) -> None:
        """Publish; the frame's number and epoch are filled here."""
        self._seq += 1
        numbered = msgspec.structs.replace(header, frame_seq=self._seq, frame_epoch=self._epoch)
        self._publisher.put_picture(numbered, data)


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Publish at most `camera.rate_hz` pictures a second."""
    settings, index = config.camera, webcam_index(config.camera.source)
    output = Output(bus, clock)
    worker = ThreadPoolExecutor(1, "camera")
    try:
        if settings.source == "sim":
            await _relay(bus, clock, settings, output)
        elif index is not None:
            await _watch(bus, clock, settings, output, worker, index)
        else:
            await _replay(bus, clock, settings, output, worker)
    finally:
        worker.shutdown(wait=False)


async def _relay(bus: Bus, clock: Clock, settings: CameraConfig, output: Output) -> None:
    """The simulator's pictures as they are, dated by the pose they show."""
    rendered = bus.pull_picture(keys.RENDERED)
    period_us = patience_us(settings.rate_hz)
    origin, due_us = None, 0
    with bus.alive():
        while True:
            await asyncio.sleep(min(max(due_us - clock.now_us(), 0), period_us) * 1e-6)
            picture = await rendered.next()
            due_us = clock.now_us() + period_us
            came_from = (picture.header.epoch, picture.header.frame_epoch)
            if origin not in {None, came_from}:
                output.begin_again()
            origin = came_from
            output.put(picture.data, picture.header)


async def _watch(
    bus: Bus, clock: Clock, settings: CameraConfig, output: Output, worker: ThreadPoolExecutor, index: int
) -> None:
    """The webcam's newest picture: every one is taken from the camera, those that are due are published."""
    camera = await _off_loop(worker, Webcam, index, settings.width_px, settings.height_px)
    period_us, due_us = patience_us(settings.rate_hz), 0
    try:
        with bus.alive():
            while True:
                bgr = await _off_loop(worker, camera.read)
                now_us = clock.now_us()
                if bgr is None:
                    raise RuntimeError(f"camera.source {settings.source}: the camera has gone")
                if now_us >= due_us:
                    due_us = now_us + period_us
                    small = await _off_loop(worker, fitted, bgr, settings.width_px)
                    data = await _off_loop(worker, jpeg, small, settings.jpeg_quality)
                    output.put(data, _header(small, now_us))
    finally:
        worker.submit(camera.close)


async def _replay(bus: Bus, clock: Clock, settings: CameraConfig, output: Output, worker: ThreadPoolExecutor) -> None:
    """A recording in its own order; a file that is no picture goes out as it is, to be refused by perception."""
    frames = play(Path(settings.source), settings)
    frame = await _off_loop(worker, next, frames, None)
    with bus.alive():
        due_us = clock.now_us()
        while frame is not None:
            if frame.restarted:
                output.begin_again()
            data = await _off_loop(worker, _encoded, frame, settings.jpeg_quality)
            due_us = max(due_us + round(frame.wait_s * 1e6), clock.now_us() - round(1e6 / settings.rate_hz))
            await asyncio.sleep(max(due_us - clock.now_us(), 0) * 1e-6)
            output.put(data, _header(frame.bgr, clock.now_us(), frame))
            bus.note(frame.name)
            frame = await _off_loop(worker, next, frames, None)
        bus.note(f"{settings.source}: played to its end")
        await asyncio.Event().wait()


def jpeg(bgr: U8, quality: int) -> bytes:
    """One encoded picture."""
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, min(quality, 100)])
    return data.tobytes()


def _encoded(frame: Frame, quality: int) -> bytes:
    return Path(frame.name).read_bytes() if frame.bgr is None else jpeg(frame.bgr, quality)


def _header(bgr: U8 | None, source_us: int, frame: Frame | None = None) -> m.PictureHeader:
    height, width = bgr.shape[:2] if bgr is not None else (0, 0)
    return m.PictureHeader(
        source_us=source_us,
        frame_seq=0,
        frame_epoch=0,
        width_px=width,
        height_px=height,
        time_base=frame.time_base if frame else m.TimeBase.CAPTURE,
        media_us=frame.media_us if frame else 0,
    )


async def _off_loop(worker: ThreadPoolExecutor, call: Callable[..., T], *arguments: Any) -> T:
    return await asyncio.get_running_loop().run_in_executor(worker, call, *arguments)
