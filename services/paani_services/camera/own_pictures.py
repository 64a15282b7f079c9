"""Publishes pictures that this process reads or decodes itself: a webcam's, or a recording's."""

import asyncio
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

import cv2

from paani import messages as m
from paani.arrays import U8
from paani.bus import Bus
from paani.clock import Clock, MonotonicClock, patience_us
from paani.config import CameraConfig
from paani_services.camera.picture_publisher import PicturePublisher
from paani_services.camera.picture_sources import Frame, Webcam, parse_webcam_index, play_frames, shrink_to_fit

T = TypeVar("T")


async def publish_own_pictures(bus: Bus, clock: Clock, settings: CameraConfig, output: PicturePublisher) -> None:
    """Publish what `camera.source` names. Raises UserError where it cannot be opened, RuntimeError where it ends."""
    index = parse_webcam_index(settings.source)
    worker = ThreadPoolExecutor(1, "camera")
    try:
        if index is not None:
            await _publish_webcam(bus, clock, settings, output, worker, index)
        else:
            await _play_recording(bus, clock, settings, output, worker)
    finally:
        worker.shutdown(wait=False)


async def _publish_webcam(
    bus: Bus, clock: Clock, settings: CameraConfig, output: PicturePublisher, worker: ThreadPoolExecutor, index: int
) -> None:
    """Publish the webcam's newest picture: all are read, so that none waits in the driver; those due go out."""
    camera = await _run_in_worker(worker, Webcam, index, settings.width_px, settings.height_px)
    period_us, due_us, monotonic = patience_us(settings.rate_hz), 0, MonotonicClock()
    try:
        with bus.alive():
            while True:
                bgr = await _run_in_worker(worker, camera.read)
                source_us, now_us = clock.now_us(), monotonic.now_us()
                if bgr is None:
                    raise RuntimeError(
                        f"camera.source {settings.source}: the camera does not answer any more; check its cable"
                    )
                if now_us >= due_us:
                    due_us = now_us + period_us
                    small = await _run_in_worker(worker, shrink_to_fit, bgr, settings.width_px)
                    data = await _run_in_worker(worker, encode_jpeg, small, settings.jpeg_quality)
                    output.put(data, _make_header(small, source_us))
    finally:
        worker.submit(camera.close)


async def _play_recording(
    bus: Bus, clock: Clock, settings: CameraConfig, output: PicturePublisher, worker: ThreadPoolExecutor
) -> None:
    """Publish the frames of a recording in order; a file that is no picture goes out unchanged."""
    frames, monotonic = play_frames(Path(settings.source), settings), MonotonicClock()
    frame = await _run_in_worker(worker, next, frames, None)
    with bus.alive():
        due_us = monotonic.now_us()
        while frame is not None:
            if frame.restarted:
                output.start_new_epoch()
            data = await _run_in_worker(worker, _encode_frame, frame, settings.jpeg_quality)
            due_us = max(due_us + round(frame.wait_s * 1e6), monotonic.now_us() - round(1e6 / settings.rate_hz))
            await asyncio.sleep(max(due_us - monotonic.now_us(), 0) * 1e-6)
            output.put(data, _make_header(frame.bgr, clock.now_us(), frame))
            bus.note(frame.name)
            frame = await _run_in_worker(worker, next, frames, None)
        bus.note(f"{settings.source}: played to the end")
        await asyncio.Event().wait()


def encode_jpeg(bgr: U8, quality: int) -> bytes:
    """The picture as JPEG."""
    _, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, min(quality, 100)])
    return data.tobytes()


def _encode_frame(frame: Frame, quality: int) -> bytes:
    return Path(frame.name).read_bytes() if frame.bgr is None else encode_jpeg(frame.bgr, quality)


def _make_header(bgr: U8 | None, source_us: int, frame: Frame | None = None) -> m.PictureHeader:
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


async def _run_in_worker(worker: ThreadPoolExecutor, call: Callable[..., T], *arguments: Any) -> T:
    return await asyncio.get_running_loop().run_in_executor(worker, call, *arguments)
