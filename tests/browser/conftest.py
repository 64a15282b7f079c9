"""Headless Chromium, and a boat that publishes frames of known colours on the bus."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import WallClock
from paani_services.dashboard.pages import StaticFile, load_static_files
from tests.at_work import at_work
from tests.conftest import OpenAs

PICTURE_BGR = (90, 70, 50)
BOX = (0.125, 0.25, 0.375, 0.5)
MASK_EDGE = 0.5  # water to the left, obstacle to the right
PERIOD_S = 0.2


class Boat:
    """Publishes picture, mask, evidence, tracks and advice; the ids agree unless `frame_offset` shifts them."""

    def __init__(self, buses: dict[str, Bus]) -> None:
        self._clock = WallClock()
        self._pictures = buses["camera"].picture_publisher(keys.PICTURE)
        self._masks = buses["perception"].picture_publisher(keys.MASK)
        self._evidence = buses["perception"].publisher(keys.EVIDENCE)
        self._tracks = buses["advisor"].publisher(keys.TRACKS)
        self._advisory = buses["advisor"].publisher(keys.ADVISORY)
        self._applied = buses["plant"].publisher(keys.THRUST_APPLIED)
        self.arming = buses["plant"].latest(keys.ARMING)
        picture = np.full((240, 320, 3), PICTURE_BGR, np.uint8)
        mask = np.zeros((64, 80), np.uint8)
        mask[:, round(80 * MASK_EDGE) :] = 1
        self.jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
        self._png = cv2.imencode(".png", mask)[1].tobytes()
        self.seq = 0
        self.frame_offset = 0
        self.zero_cause: m.ZeroCause | None = None  # what the plant says instead of the truth

    async def publish_forever(self) -> None:
        """Publish until cancelled."""
        while True:
            self.publish()
            await asyncio.sleep(PERIOD_S)

    def publish(self) -> None:
        now_us, self.seq = self._clock.now_us(), self.seq + 1
        picture = m.PictureHeader(source_us=now_us, frame_seq=self.seq, frame_epoch=1, width_px=320, height_px=240)
        self._pictures.put_picture(picture, self.jpeg)
        frame_seq = self.seq + self.frame_offset
        header = msgspec.structs.replace(
            picture, frame_seq=frame_seq, width_px=80, height_px=64, media_type="image/png"
        )
        self._masks.put_picture(header, self._png)
        found = m.Detection(label=m.Label.BUOY, confidence=0.8, box_xyxy=BOX)
        self._evidence.put(
            m.Evidence(
                source_us=now_us, frame_seq=frame_seq, frame_epoch=1, width_px=320, height_px=240, usable=True,
                detections=(found,), segmentation=m.SegmentationSource.LEARNED, navigation_eligible=True,
            )
        )  # fmt: skip
        track = m.Track(
            id=4, label=m.Label.BUOY, hazard=m.Hazard.MARKER, confidence=0.8, box_xyxy=BOX, hits=3, confirmed=True,
            immediate_danger=False, accepted=True, held=False, age_s=1.0, urgency=0.0,
        )  # fmt: skip
        self._tracks.put(m.Tracks(source_us=now_us, frame_seq=frame_seq, frame_epoch=1, tracks=(track,)))
        clear = m.LaneRisk(risk=0.25, non_water=0.4, uncertainty=0.2, clear_width=0.9, blocked=False)
        blocked = m.LaneRisk(risk=0.8, non_water=0.9, obstacle=0.5, uncertainty=0.2, blocked=True, track_ids=(4,))
        self._advisory.put(
            m.Advisory(
                source_us=now_us, direction=m.Direction.RIGHT, reason=m.Reason.CENTER_RISK, left=blocked,
                center=blocked, right=clear, contributing_track_ids=(4,), frame_seq=frame_seq, frame_epoch=1,
                explanation="Turn right: centre risk 0.80 (limit 0.48); left 0.80, right 0.25 (limit 0.58). "
                "Without buoy #4 (left and centre) it would go STRAIGHT.",
            )
        )  # fmt: skip
        armed = self.arming.value is not None and self.arming.value.armed
        cause = self.zero_cause or (m.ZeroCause.NONE if armed else m.ZeroCause.NOT_ARMED)
        thrust = 0.1 if cause is m.ZeroCause.NONE else 0.0
        self._applied.put(
            m.ThrustApplied(
                source_us=now_us, left=thrust, right=thrust, left_n=75 * thrust, right_n=75 * thrust, zero_cause=cause
            )
        )


@pytest.fixture
async def boat(open_as: OpenAs) -> AsyncIterator[Boat]:
    buses = {user: await open_as(user) for user in ("camera", "perception", "advisor", "plant")}
    boat = Boat(buses)
    async with at_work(boat.publish_forever()):
        yield boat


@pytest.fixture
async def scripts_page(browser: Any) -> Any:
    """An empty page that may import the scripts of the dashboard's page; nothing is served beside them."""
    files, origin = await asyncio.to_thread(load_static_files), "http://page.test"

    async def answer(route: Any) -> None:
        file = files.get(route.request.url.removeprefix(f"{origin}/static/"), StaticFile("text/html", b""))
        await route.fulfill(body=file.body, content_type=file.media_type)

    page = await browser.new_page()
    await page.route(f"{origin}/**", answer)
    await page.goto(origin)
    return page


@pytest.fixture
async def browser() -> AsyncIterator[Any]:
    pytest.importorskip("playwright.async_api", reason="playwright is not installed")
    from paani_tools.bench.deck.browser import find_chromium, launched  # noqa: PLC0415  it needs playwright

    path = find_chromium()
    if path is None:
        pytest.skip("no Chromium on this machine")
    async with launched(path) as browser:
        yield browser
