"""Times the pictures of a boat that is under way, from their stamp to the screen of a page."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from statistics import median
from typing import NamedTuple

import cv2
import msgspec
import numpy as np

from paani import keys
from paani import messages as m
from paani.bus import Bus, Latest, Picture
from paani.clock import WallClock, stopwatch_ms
from paani.config import Config
from paani.page_address import page_origin
from paani_services.dashboard.frames import decode_frame
from paani_tools.bench.deck.browser import Deck
from paani_tools.bench.deck.crowd import watching
from paani_tools.bench.deck.page_probe import page_moments
from paani_tools.bench.deck.picture_path import BoatMoments, stage_durations_ms

CLOCK = WallClock()
ENCODED_AGAIN = 40  # pictures; what the encoder takes varies little


class TimedPictures(NamedTuple):
    """Age of each picture [ms] when a client that only reads has it, and when it is on the page's screen.

    `beyond_ms`: the latter without the simulated camera's drawing. `stages`: of those drawn with evidence and mask.
    """

    received_ms: list[float]
    drawn_ms: list[float]
    beyond_ms: list[float]
    stages: list[dict[str, float]]


class BoatStamps:
    """What the boat's processes stamp of each frame, as heard on the bus."""

    def __init__(self, bus: Bus) -> None:
        self.pictures: dict[int, m.PictureHeader] = {}
        self.evidence: dict[int, tuple[m.Evidence, int]] = {}
        self.encoded_us: dict[int, int] = {}
        self.newest: Picture | None = None
        bus.on(keys.EVIDENCE, self._note_evidence)
        self._inboxes: tuple[tuple[Latest[Picture], Callable[[Picture], None]], ...] = (
            (bus.latest_picture(keys.PICTURE), self._note_picture),
            (bus.latest_picture(keys.RENDERED), self._note_rendered),
        )

    @contextlib.asynccontextmanager
    async def noting(self) -> AsyncIterator[None]:
        """Note while the context lasts."""
        async with asyncio.TaskGroup() as tasks:
            running = [tasks.create_task(_note_forever(*each)) for each in self._inboxes]
            yield
            for task in running:
                task.cancel()

    def moments(self, frame_seq: int) -> BoatMoments | None:
        """Of a frame; None where one of its stamps was not heard."""
        picture, (evidence, heard_us) = self.pictures.get(frame_seq), self.evidence.get(frame_seq, (None, 0))
        encoded_us = self.encoded_us.get(picture.source_us) if picture is not None else None
        if picture is None or evidence is None or encoded_us is None:
            return None
        begun_us = picture.source_us + evidence.timing.frame_age_ms * 1e3
        inferred_us = begun_us + evidence.timing.total_ms * 1e3
        return BoatMoments(
            picture.source_us, encoded_us, picture.sent_us, begun_us, inferred_us, evidence.sent_us, heard_us
        )

    def _note_evidence(self, evidence: m.Evidence) -> None:
        self.evidence[evidence.frame_seq] = (evidence, CLOCK.now_us())

    def _note_picture(self, picture: Picture) -> None:
        self.pictures[picture.header.frame_seq], self.newest = picture.header, picture

    def _note_rendered(self, picture: Picture) -> None:
        self.encoded_us[picture.header.source_us] = picture.header.sent_us


async def _note_forever(inbox: Latest[Picture], note: Callable[[Picture], None]) -> None:
    while True:
        note(await inbox.next())


async def time_pictures(config: Config, bus: Bus, deck: Deck, seconds: float) -> TimedPictures:
    """Watch a probed page for so long."""
    stamps, received_ms = BoatStamps(bus), list[float]()
    await deck.take_pictures()
    async with stamps.noting(), watching(page_origin(config)) as socket_:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while True:
                    key, header, _ = decode_frame(await socket_.receive_bytes())
                    if key == keys.PICTURE.name:
                        picture = msgspec.json.decode(header.picture, type=m.PictureHeader)
                        received_ms.append((CLOCK.now_us() - picture.source_us) * 1e-3)
    noted = await deck.take_pictures()
    jpeg_ms = await asyncio.to_thread(encoding_ms, stamps.newest, config.eye.jpeg_quality)
    found = TimedPictures(received_ms, [], [], [])
    for each in noted:
        boat = stamps.moments(int(each["seq"]))
        if boat is None:
            continue
        found.drawn_ms.append((each["shown"] - boat.captured_us) * 1e-3)
        found.beyond_ms.append((each["shown"] - boat.encoded_us) * 1e-3 + jpeg_ms)
        page = page_moments(each)
        if page is not None:
            found.stages.append(stage_durations_ms(boat, page, jpeg_ms))
    return found


def encoding_ms(picture: Picture | None, quality: int) -> float:
    """What the encoder takes for such a picture on this machine now, the median; 0 without one."""
    if picture is None:
        return 0.0
    bgr, found = cv2.imdecode(np.frombuffer(picture.data, np.uint8), cv2.IMREAD_COLOR), list[float]()
    for _ in range(ENCODED_AGAIN):
        begun_ms = stopwatch_ms()
        cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
        found.append(stopwatch_ms() - begun_ms)
    return median(found)
