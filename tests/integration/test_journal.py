"""Perception keeps its observations by itself, with no recorder running."""

from __future__ import annotations

import asyncio
from pathlib import Path

import cv2
import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani_services.perception.journal import JOURNAL_FOLDER, NEWER_FILE
from tests.conftest import OpenAs, Spawn
from tests.pictures import noisy, river

pytestmark = pytest.mark.integration


async def test_every_observation_is_in_the_journal(spawn: Spawn, open_as: OpenAs, tmp_path: Path) -> None:
    """P2, P5: one line for each evidence, as it was sent; beside it neither recording nor table."""
    camera, observer = await open_as("camera"), await open_as("observer")
    pictures, evidence = camera.picture_publisher(keys.PICTURE), observer.queue(keys.EVIDENCE)
    data = cv2.imencode(".jpg", noisy(river(), 3.0, seed=1))[1].tobytes()
    sent = []
    async with spawn("perception"):
        for number in range(3):
            pictures.put_picture(
                m.PictureHeader(
                    source_us=WallClock().now_us(), frame_seq=number, frame_epoch=1, width_px=320, height_px=240
                ),
                data,
            )
            async with asyncio.timeout(20):
                sent.append(await evidence.get())
    runtime = tmp_path / "runtime"
    lines = (await asyncio.to_thread((runtime / JOURNAL_FOLDER / NEWER_FILE).read_bytes)).splitlines()
    assert [msgspec.json.decode(line, type=m.Evidence) for line in lines] == sent
    files = await asyncio.to_thread(lambda: [file.suffix for file in runtime.rglob("*")])
    assert ".mcap" not in files
    assert ".csv" not in files
