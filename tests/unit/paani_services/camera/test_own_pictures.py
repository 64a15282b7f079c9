"""Which of a webcam's pictures go out, and what is said of a recording's."""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from paani import messages as m
from paani.arrays import U8
from paani.clock import ManualClock, WallClock
from paani.config import CameraConfig, load_config
from paani_services.camera import own_pictures
from paani_services.camera.own_pictures import encode_jpeg, publish_own_pictures
from tests.pictures import river

PICTURES = 100


class Camera:
    """A device that gives a picture each 0.1 s, and then no more."""

    def __init__(self, clock: ManualClock, size: tuple[int, int]) -> None:
        self.size = size
        self._clock, self._count = clock, 0

    def read(self) -> U8 | None:
        self._count += 1
        self._clock.advance(0.1)
        return np.zeros((240, 320, 3), np.uint8) if self._count <= PICTURES else None

    def close(self) -> None:
        """Nothing is open."""


class Output:
    """Where pictures go: keeps what their headers say, and where a new epoch began."""

    def __init__(self) -> None:
        self.entries: list[m.PictureHeader | str] = []

    def put(self, _data: bytes, header: m.PictureHeader) -> None:
        self.entries.append(header)

    def start_new_epoch(self) -> None:
        self.entries.append("epoch")

    def alive(self) -> contextlib.AbstractContextManager[None]:
        return contextlib.nullcontext()

    def note(self, _text: str) -> None:
        """Nobody reads it."""


async def test_a8_every_two_seconds_the_newest_picture_of_a_webcam_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, output = ManualClock(), Output()
    opened: list[Camera] = []

    def open_camera(_index: int, width_px: int, height_px: int) -> Camera:
        opened.append(Camera(clock, (width_px, height_px)))
        return opened[0]

    monkeypatch.setattr(own_pictures, "Webcam", open_camera)
    monkeypatch.setattr(own_pictures, "MonotonicClock", lambda: clock)
    settings = load_config(profile="paper", sets=["camera.source=webcam"]).camera
    ends: Any = output
    with pytest.raises(RuntimeError, match="does not answer"):
        await publish_own_pictures(ends, clock, settings, ends)
    assert opened[0].size == (320, 240)
    taken_us = [header.source_us for header in output.entries if isinstance(header, m.PictureHeader)]
    assert np.diff(taken_us).tolist() == [2_000_000] * 4


@pytest.mark.slow
async def test_b2_i17_a_later_pass_has_another_epoch_and_each_picture_its_own_time(tmp_path: Path) -> None:
    for name in "abc":
        (tmp_path / f"{name}.jpg").write_bytes(encode_jpeg(river(ord(name)), 85))
    output = Output()
    ends: Any = output
    settings = CameraConfig(source=str(tmp_path), rate_hz=40.0)
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(0.5):
            await publish_own_pictures(ends, WallClock(), settings, ends)
    found = [each if isinstance(each, str) else (each.time_base, each.media_us) for each in output.entries]
    one_pass = [(m.TimeBase.FRAME_INDEX, media_us) for media_us in (0, 25_000, 50_000)]
    assert found[:7] == [*one_pass, "epoch", *one_pass]
