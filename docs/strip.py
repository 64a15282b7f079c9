"""`python -m docs.strip STRIP.webp PAGE.png`: the README's pictures, from the page in Chromium while a boat drives.

Arm, route, swimmer ahead, why, stop, and back to a past moment; PAGE is the swimmer's. Needs the extras `host` and
`dev`, and Chromium.
"""

from __future__ import annotations

import asyncio
import contextlib
import sys
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from playwright.async_api import async_playwright

from paani.config import load_config
from paani.operator_key import ensure_operator_key
from paani.page_address import page_origin
from paani_tools.bench.deck.browser import LIVE
from paani_tools.up.lifecycle import run_plan
from paani_tools.up.plan import Plan, make_plan
from paani_tools.up.terminal import Display

SIZE = {"width": 1440, "height": 900}
COLUMNS, CELL_PX, BAND_PX, GAP_PX = 2, (960, 600), 44, 12
GROUND, INK = (250, 247, 244), (60, 45, 30)  # BGR
SWIMMER_S, PERIOD_S = 180.0, 0.2
UNDER_WAY_S, HOLD_S = 5.0, 1.6
PREDICTED_S, REFUSED_S = 1.2, 15.0
PAGE_FRAME = 2  # of the strip's
TRIES = 30  # to have a picture and the advice on it in one
SWIMMER_AHEAD = "/swimmer|person/i.test(document.querySelector('#explanation').innerText)"
JUDGED = "paani.overlay.advisory_seq"  # of the picture on the page, once the advice on it has come
OBSTACLE_REFUSES = "/person|obstacle/.test(document.querySelector('#heading-legend').innerText)"


async def take_frames(plan: Plan) -> list[tuple[str, bytes]]:
    """Captions and PNG pictures of the page, in the order of a drive."""
    frames: list[tuple[str, bytes]] = []
    key = await asyncio.to_thread(ensure_operator_key, plan.config.bus)

    async def drive() -> None:
        async with async_playwright() as driver:
            browser = await driver.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
            page = await browser.new_page(viewport=SIZE)
            await page.goto(f"{page_origin(plan.config)}/#key={key}")
            await _until(page, LIVE)
            await asyncio.sleep(4.0)
            await _take("Not armed: the page says what it waits for", page)
            await page.hover("#arm")
            await page.mouse.down()
            await asyncio.sleep(HOLD_S)
            await page.mouse.up()
            await asyncio.sleep(UNDER_WAY_S)
            await _take("Armed: it follows its route", page)
            await _until(page, SWIMMER_AHEAD)
            await asyncio.sleep(PREDICTED_S)
            await _until(page, SWIMMER_AHEAD)
            await _take("A swimmer ahead: how fast, and on which side", page)
            await page.click("#map-headings")
            await asyncio.sleep(1.5)
            with contextlib.suppress(TimeoutError):  # where it keeps so far off that nothing else is refused
                await _until(page, OBSTACLE_REFUSES, REFUSED_S)
            await _take("Why this heading: each other one, and what refused it", page)
            await page.click("#stop")
            await asyncio.sleep(2.0)
            await _take("STOP: confirmed by the thrust adapter, and held", page)
            strip = await page.locator("#time-strip").bounding_box()
            await page.mouse.click(strip["x"] + 0.985 * strip["width"], strip["y"] + 0.5 * strip["height"])
            await asyncio.sleep(1.5)
            await _take("A past moment, everywhere on the page", page)
            await browser.close()

    async def _take(caption: str, page: Any) -> None:
        picture = b""
        for _ in range(TRIES):
            judged, picture = await page.evaluate(JUDGED), await page.screenshot()
            if judged is not None and judged == await page.evaluate(JUDGED):
                break
        frames.append((caption, picture))

    await run_plan(plan, None, Display(sys.stdout), drive)
    return frames


async def _until(page: Any, condition: str, limit_s: float = SWIMMER_S) -> None:
    async with asyncio.timeout(limit_s):
        while not await page.evaluate(condition):  # noqa: ASYNC110  # a browser wakes nobody
            await asyncio.sleep(PERIOD_S)


def draw_strip(frames: list[tuple[str, bytes]]) -> npt.NDArray[np.uint8]:
    """The pictures side by side and below each other, each with its number and caption; BGR."""
    width_px, height_px = CELL_PX
    rows = -(-len(frames) // COLUMNS)
    pitch_px = height_px + BAND_PX + GAP_PX
    sheet = np.full((rows * pitch_px + GAP_PX, COLUMNS * (width_px + GAP_PX) + GAP_PX, 3), GROUND, np.uint8)
    for index, (caption, data) in enumerate(frames):
        row, column = divmod(index, COLUMNS)
        x, y = GAP_PX + column * (width_px + GAP_PX), GAP_PX + row * pitch_px
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        sheet[y + BAND_PX : y + BAND_PX + height_px, x : x + width_px] = cv2.resize(
            picture, CELL_PX, interpolation=cv2.INTER_AREA
        )
        text = f"{index + 1}  {caption}"
        cv2.putText(sheet, text, (x + 4, y + BAND_PX - 14), cv2.FONT_HERSHEY_SIMPLEX, 0.8, INK, 2, cv2.LINE_AA)
    return sheet


def main(strip: Path, page: Path) -> None:
    """Drive `river_swimmer` with a bus of its own, and write the strip and one whole picture of it."""
    with tempfile.TemporaryDirectory() as folder:
        sets = ("world.name=river_swimmer", "bus.router=tcp/127.0.0.1:7557", "dashboard.port=8957")
        config = load_config(sets=(*sets, f"bus.runtime_dir={folder}/runtime"))
        frames = asyncio.run(_frames(config))
    page.write_bytes(frames[PAGE_FRAME][1])
    cv2.imwrite(str(strip), draw_strip(frames), [cv2.IMWRITE_WEBP_QUALITY, 80])


async def _frames(config: Any) -> list[tuple[str, bytes]]:
    return await take_frames(await make_plan(config))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
