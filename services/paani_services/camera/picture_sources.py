"""Sources of pictures other than the simulator: picture files, folders and videos on disk, and webcams.

All calls may block, so they belong into a thread beside the event loop.
"""

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from paani.arrays import U8
from paani.config import CameraConfig
from paani.errors import UserError
from paani.messages import TimeBase

PICTURE_SUFFIXES = frozenset({".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff"})
VIDEO_SUFFIXES = frozenset({".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mpg", ".mpeg", ".mjpeg", ".mjpg"})
MIN_LONG_SIDE_PX = 480  # pictures are not scaled down below this
MAX_RATE_HZ = 1000.0  # a video that states more states no usable rate


class Frame(NamedTuple):
    """One picture of a recording.

    bgr: uint8 [H, W, 3], None where the file is no picture. name: of the file or frame. `media_us` is its time in the
    recording as `time_base` says; `wait_s` the time from the frame before it until it is due; `restarted` marks the
    first frame of each later pass.
    """

    bgr: U8 | None
    name: str
    media_us: int
    time_base: TimeBase
    wait_s: float
    restarted: bool = False


def play_frames(path: Path, config: CameraConfig) -> Iterator[Frame]:
    """Frames of a picture, a folder of pictures (by name) or a video; endlessly with `loop`.

    `timing` "fixed" yields every frame at `rate_hz`; "original" keeps a video's own times, leaving out frames that come
    faster than `rate_hz`. A single picture never restarts: it stands for a camera that always shows the same.
    Raises UserError naming a path that is missing, empty or unreadable, before the first frame; a damaged picture
    among others is a frame without a picture.
    """
    still = path.is_file() and path.suffix.lower() not in VIDEO_SUFFIXES
    for number in itertools.count() if config.loop else range(1):
        for index, frame in enumerate(read_frames(path, config)):
            began = index == 0 and number == 0
            yield frame._replace(
                wait_s=0.0 if began else frame.wait_s,
                media_us=round(number / config.rate_hz * 1e6) if still else frame.media_us,
                restarted=index == 0 and not began and not still,
            )


def read_frames(path: Path, config: CameraConfig) -> Iterator[Frame]:
    """The frames of one pass. Raises UserError as `play_frames` does."""
    if not path.exists():
        raise UserError(f"{path}: no such file or folder")
    if path.is_dir():
        files = list_pictures(path)
        if not files:
            raise UserError(f"{path}: holds no pictures")
        yield from _read_pictures(files, config)
    elif path.suffix.lower() in VIDEO_SUFFIXES:
        yield from _read_video(path, config)
    else:
        yield from _read_pictures([path], config)


def list_pictures(folder: Path) -> list[Path]:
    """Picture files of a folder and those below, by path. Raises UserError naming a folder that cannot be read."""
    try:
        return sorted(file for file in folder.rglob("*") if file.suffix.lower() in PICTURE_SUFFIXES and file.is_file())
    except OSError as error:
        raise UserError(f"{folder}: {error.strerror}") from error


def read_picture(file: Path) -> U8 | None:
    """BGR uint8 [H, W, 3], None where the file is no picture. Raises UserError naming a file that cannot be read."""
    try:
        data = np.frombuffer(file.read_bytes(), np.uint8)
    except OSError as error:
        raise UserError(f"{file}: {error.strerror}") from error
    try:
        bgr = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    except cv2.error:
        return None
    return None if bgr is None else np.asarray(bgr, np.uint8)


def shrink_to_fit(bgr: U8, width_px: int) -> U8:
    """Scaled down until its long side is at most max(`width_px`, 480), with its aspect kept."""
    height, width = bgr.shape[:2]
    scale = max(width_px, MIN_LONG_SIDE_PX) / max(height, width)
    if scale >= 1.0:
        return bgr
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    return np.asarray(cv2.resize(bgr, size, interpolation=cv2.INTER_AREA), np.uint8)


class Webcam:
    """A V4L2 camera."""

    def __init__(self, index: int, width_px: int, height_px: int) -> None:
        """Raises UserError naming a camera that is not there or does not answer."""
        device = Path(f"/dev/video{index}")
        if not device.exists():
            raise UserError(f"camera.source webcam:{index}: no camera at {device}")
        self._capture = cv2.VideoCapture(index, cv2.CAP_V4L2)
        self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, width_px)
        self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height_px)
        self._capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        if not self._capture.isOpened() or self.read() is None:
            self._capture.release()
            raise UserError(f"camera.source webcam:{index}: {device} gives no pictures")

    def read(self) -> U8 | None:
        """Wait for the next picture, BGR uint8 [H, W, 3]; None when the camera does not answer any more."""
        ok, bgr = self._capture.read()
        return np.asarray(bgr, np.uint8) if ok else None

    def close(self) -> None:
        self._capture.release()


def parse_webcam_index(source: str) -> int | None:
    """N of `webcam:N`, 0 of `webcam`, None of any other source. Raises UserError for an N that is no number."""
    name, _, number = source.partition(":")
    if name != "webcam":
        return None
    if number and not number.isdecimal():
        raise UserError(f"camera.source {source}: expected webcam or webcam:N")
    return int(number or 0)


def _read_pictures(files: list[Path], config: CameraConfig) -> Iterator[Frame]:
    for index, file in enumerate(files):
        bgr = read_picture(file)
        if bgr is None and len(files) == 1:
            raise UserError(f"{file}: not a picture")
        yield Frame(
            None if bgr is None else shrink_to_fit(bgr, config.width_px),
            str(file),
            round(index / config.rate_hz * 1e6),
            TimeBase.FRAME_INDEX,
            1.0 / config.rate_hz,
        )


def _read_video(path: Path, config: CameraConfig) -> Iterator[Frame]:
    capture = cv2.VideoCapture(str(path))
    try:
        rate_hz = capture.get(cv2.CAP_PROP_FPS)
        rate_hz = rate_hz if 0.0 < rate_hz <= MAX_RATE_HZ else config.rate_hz
        last_us, index, base = -1, 0, TimeBase.MEDIA
        while True:
            ok, bgr = capture.read()
            if not ok:
                break
            media_us = round(capture.get(cv2.CAP_PROP_POS_MSEC) * 1e3) if base is TimeBase.MEDIA else 0
            if base is TimeBase.FRAME_INDEX or media_us < 0 or (index > 0 and media_us <= last_us):
                base, media_us = TimeBase.FRAME_INDEX, round(index / rate_hz * 1e6)
            index += 1
            period_us = 1e6 / config.rate_hz
            if config.timing == "original" and last_us >= 0 and media_us - last_us < 0.9 * period_us:
                continue
            wait_s = 1.0 / config.rate_hz if config.timing == "fixed" else max(0, media_us - max(last_us, 0)) * 1e-6
            yield Frame(
                shrink_to_fit(np.asarray(bgr, np.uint8), config.width_px), f"{path}#{index - 1}", media_us, base, wait_s
            )
            last_us = media_us
        if index == 0:
            raise UserError(f"{path}: not a video that can be read")
    finally:
        capture.release()
