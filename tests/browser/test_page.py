"""The page in a real browser, on a real bus: overlays sit on their own frame, STOP latches, silence is red (P1)."""

from __future__ import annotations

import asyncio
import contextlib
from pathlib import Path
from typing import Any

import pytest

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani.config import Config
from paani.operator_key import ensure_operator_key
from tests.browser.conftest import BOX, MASK_EDGE, PICTURE_BGR, Boat
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

WAIT_S = 20.0
TOLERANCE = 14
# Chromium ends requests under way when a device of the machine comes or goes, as containers' do beside these tests;
# the page is then loaded again.
NETWORK_CHANGED = "net::ERR_NETWORK_CHANGED"
OWN_HULL = "[[0.4, 1.0], [0.4, 0.95], [0.6, 0.95], [0.6, 1.0]]"
WATER_RGBA, OBSTACLE_RGBA = (23, 184, 214, 66), (242, 140, 30, 100)
ACCEPTED_RGB = (255, 180, 84)
ROUTE_RGB, TRACK_RGB, TRUTH_RGB = (185, 164, 240), (79, 195, 224), (223, 230, 235)
MAP_PX_PER_M = 6.0  # as the page begins
MAP_PIXELS = """([x, y]) => {
  const c = document.querySelector("#map"), ratio = c.width / c.clientWidth;
  const place = [c.clientWidth / 2 + x, c.clientHeight / 2 - y].map((v) => Math.round(v * ratio) - 2);
  const data = [...c.getContext("2d").getImageData(place[0], place[1], 5, 5).data];
  return Array.from({ length: 25 }, (_, i) => data.slice(4 * i, 4 * i + 4));
}"""
REMAINING = """(() => {
  const list = document.querySelector("#arm-reasons"), lines = [...list.children].map((each) => each.textContent);
  const reasons = ["Position: no recent position", "Navigator: no recent order", "Controller: no recent thrust"];
  return !list.hidden && lines[0] === "Armed, the boat still stands:" && reasons.every((each) => lines.includes(each))
    && !lines.some((each) => each.startsWith("Operator"));
})()"""
RED_ON_MAP = """(() => {
  const c = document.querySelector("#map"), { data } = c.getContext("2d").getImageData(0, 0, c.width, c.height);
  for (let i = 0; i < data.length; i += 4) if (data[i] > 200 && data[i + 1] < 140 && data[i + 2] < 140) return true;
  return false;
})()"""
PIXEL = """([x, y]) => {
  const c = document.querySelector("#camera");
  return [...c.getContext("2d").getImageData(Math.round(x * c.width), Math.round(y * c.height), 1, 1).data].slice(0, 3);
}"""

# Whether an expression is true, and what is wrong with it; both are asked at one instant, as the page may be loading.
TRY = """(async () => {
  try { return [!!(await (%s)), null]; }
  catch (fault) { return [false, typeof paani === "undefined" ? null : `${fault}`]; }
})()"""

LIMITS = "[...document.querySelectorAll('.lane u')].map((mark) => (parseFloat(mark.style.left) / 100).toFixed(2))"


# A button that orders a mode is closed when it comes into the page.
NOTE_OPEN_MODES = """new MutationObserver((changes) => {
  for (const { addedNodes } of changes) for (const { dataset, disabled } of addedNodes)
    if (dataset?.drive && !disabled) console.error(`${dataset.drive} may be ordered before anything is heard`);
}).observe(document, { childList: true, subtree: true })"""


class Watched:
    """A page, its console errors, and its requests to other hosts."""

    def __init__(self, page: Any, origin: str) -> None:
        self.page, self.errors = page, []
        self.foreign_requests: list[str] = []
        page.on("console", lambda line: self._note_line(line.type, line.text))
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("request", lambda request: self._note_request(request.url, origin))

    errors: list[str]

    def _note_line(self, kind: str, text: str) -> None:
        if kind == "error" and NETWORK_CHANGED not in text:
            self.errors.append(text)

    def _note_request(self, url: str, origin: str) -> None:
        if not url.startswith((origin, "blob:", "data:")):
            self.foreign_requests.append(url)


async def watch(browser: Any, config: Config, width: int = 1440, height: int = 900) -> Watched:
    origin = f"http://127.0.0.1:{config.dashboard.port}"
    page = await browser.new_page(viewport={"width": width, "height": height}, color_scheme="dark")
    watched = Watched(page, origin)
    await page.add_init_script(NOTE_OPEN_MODES)
    key = await asyncio.to_thread(ensure_operator_key, config.bus)
    await page.goto(f"{origin}/#key={key}")
    return watched


async def overlay(page: Any) -> dict[str, int | None]:
    return dict(await page.evaluate("({...paani.overlay})"))


def blend(rgba: tuple[int, int, int, int]) -> tuple[float, ...]:
    """The picture's colour under a tint."""
    share = rgba[3] / 255
    return tuple(p * (1 - share) + t * share for p, t in zip(PICTURE_BGR[::-1], rgba[:3], strict=True))


def is_colour(pixel: list[int], colour: tuple[float, ...]) -> bool:
    return all(abs(a - b) <= TOLERANCE for a, b in zip(pixel, colour, strict=True))


async def check_own_hull_and_opacity(page: Any) -> None:
    shaded = tuple(0.55 * part + 0.45 * dark for part, dark in zip(blend(WATER_RGBA), (8, 11, 14), strict=True))
    place = [0.45, 0.975]
    assert is_colour(await page.evaluate(PIXEL, place), shaded)
    await page.keyboard.press("5")
    await page.wait_for_timeout(300)
    assert is_colour(await page.evaluate(PIXEL, place), blend(WATER_RGBA))
    await page.keyboard.press("2")
    await page.wait_for_timeout(300)
    assert is_colour(await page.evaluate(PIXEL, [BOX[0], 0.4]), blend(WATER_RGBA)), "no box"
    await page.keyboard.press("2")
    await page.click("[data-layer=mask]")
    await page.wait_for_timeout(300)
    assert is_colour(await page.evaluate(PIXEL, place), PICTURE_BGR[::-1]), "no mask"
    await page.click("[data-layer=mask]")
    await page.fill("#camera-opacity", "0")
    await page.wait_for_timeout(300)
    assert is_colour(await page.evaluate(PIXEL, place), PICTURE_BGR[::-1])
    assert is_colour(await page.evaluate(PIXEL, [BOX[0], 0.4]), PICTURE_BGR[::-1])
    await page.reload()
    await until(page, "paani.overlay.mask_seq !== null")
    await until(page, "document.querySelector('#advice-word').textContent !== 'NO DATA'")
    assert is_colour(await page.evaluate(PIXEL, [BOX[0], 0.4]), PICTURE_BGR[::-1]), "it is kept"


LONG_SENTENCE_GAP_PX = """() => {
  const [sentence, below] = ["explanation", "path"].map((id) => document.getElementById(id));
  const text = sentence.textContent;
  sentence.textContent = "something that may be a person ".repeat(20);
  const range = document.createRange();
  range.selectNodeContents(sentence);
  const gap = below.getBoundingClientRect().top - range.getBoundingClientRect().bottom;
  sentence.textContent = text;
  return gap;
}"""


async def test_the_overlay_lies_on_its_own_frame(
    browser: Any, boat: Boat, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    async with spawn("dashboard", f"perception.ego_polygon={OWN_HULL}"):
        watched = await watch(browser, config)
        page = watched.page
        await until(page, "paani.overlay.mask_seq !== null")
        for _ in range(10):
            overlay_state = await overlay(page)
            assert (
                len(
                    {
                        overlay_state["frame_seq"],
                        overlay_state["picture_seq"],
                        overlay_state["mask_seq"],
                        overlay_state["evidence_seq"],
                    }
                )
                == 1
            )
            await asyncio.sleep(0.1)
        await page.screenshot(path=tmp_path / "page.png")
        for layer in ("3", "4"):
            await page.keyboard.press(layer)
        await page.wait_for_timeout(300)

        for x, tint in ((MASK_EDGE - 0.02, WATER_RGBA), (MASK_EDGE + 0.02, OBSTACLE_RGBA)):
            for y in (0.1, 0.9):
                pixel = await page.evaluate(PIXEL, [x, y])
                assert is_colour(pixel, blend(tint)), (x, y, pixel)
        x1, y1, x2, y2 = BOX
        for x, y in ((x1, 0.4), (x2, 0.4), (0.3, y2)):
            assert is_colour(await page.evaluate(PIXEL, [x, y]), ACCEPTED_RGB), (x, y)
        for x, y in ((x1 + 0.02, y1 + 0.06), (x2 + 0.02, 0.4), (0.3, y2 + 0.03)):
            assert is_colour(await page.evaluate(PIXEL, [x, y]), blend(WATER_RGBA)), (x, y)
        await check_own_hull_and_opacity(page)

        assert await page.evaluate(LONG_SENTENCE_GAP_PX) >= 0.0
        assert await page.inner_text("#advice-word") == "RIGHT"
        assert "centre risk 0.80" in await page.inner_text("#explanation")
        assert "Without buoy #4 (left and centre) it would go STRAIGHT." in await page.inner_text("#explanation")
        assert await page.evaluate("[...document.querySelectorAll('.lane .verdict')].map(e => e.textContent)") == [
            "blocked", "blocked", "clear",
        ]  # fmt: skip
        steps = await page.evaluate("[...document.querySelectorAll('#path li')].map((e) => e.dataset.step)")
        assert steps == ["passed", "passed", "passed", "decided", ""], "the branch taken"
        assert (await page.inner_text("#path [data-step=decided]")) == "Centre risk"
        assert await page.evaluate(LIMITS) == ["0.58", "0.48", "0.58"], "each lane against its own limit"
        parts = await page.evaluate("document.querySelector('.lane .parts').textContent.replace(/\\s+/g, ' ')")
        assert "N 0.90" in parts
        assert "O 0.50" in parts
        assert await page.inner_text("#tracks span") == "#4 buoy 0.80 accepted"
        assert (tmp_path / "page.png").stat().st_size > 20_000
        assert watched.errors == []
        assert watched.foreign_requests == []


async def test_evidence_of_another_frame_is_not_drawn(browser: Any, boat: Boat, spawn: Spawn, config: Config) -> None:
    boat.frame_offset = 500
    async with spawn("dashboard"):
        page = (await watch(browser, config)).page
        await until(page, "paani.overlay.picture_seq > 5")
        overlay_state = await overlay(page)
        assert overlay_state["evidence_seq"] is None
        assert overlay_state["mask_seq"] is None
        for x, y in ((0.3, 0.9), (0.7, 0.9), (BOX[0], 0.4), (0.5, 0.97)):
            assert is_colour(await page.evaluate(PIXEL, [x, y]), PICTURE_BGR[::-1]), (x, y)
        await until(page, "document.querySelector('#camera-note').textContent.includes('overlay left out')")


async def test_stop_latches_and_outlives_the_operators_process(
    browser: Any, boat: Boat, spawn: Spawn, config: Config
) -> None:
    async with spawn("operator"), spawn("dashboard"):
        watched = await watch(browser, config)
        page = watched.page
        await until(page, "paani.link === 'live'")
        await hold_to_arm(page)
        await wait_for_arming(boat, armed=True, stopped=False)
        await page.keyboard.press("Space")
        await wait_for_arming(boat, armed=False, stopped=True)
        await until(
            page, "document.querySelector('#order-detail').textContent.startsWith('confirmed by the thrust adapter in')"
        )
        assert watched.errors == []
    await until(page, "paani.link === 'lost'")
    assert (await page.inner_text("#link-word")).startswith("LOST")
    frame = "getComputedStyle(document.body, '::after').borderTopWidth"
    assert await page.evaluate(frame) == "6px"

    boat.arming.value = None
    async with spawn("operator"), spawn("dashboard"):
        await wait_for_arming(boat, armed=False, stopped=True)
        await until(page, "paani.link === 'live'")
        assert await page.evaluate(frame) == "3px", "nobody has seen the loss yet"
        assert "was lost" in await page.inner_text("#link-age")
        await page.click("#link-seen")
        await until(page, "document.body.dataset.loss === ''")
        assert await page.evaluate(frame) == "0px"
        await hold_to_arm(page)
        await wait_for_arming(boat, armed=True, stopped=False)


async def test_arming_needs_a_hold_that_has_not_expired(browser: Any, boat: Boat, spawn: Spawn, config: Config) -> None:
    async with spawn("operator"), spawn("dashboard"):
        page = (await watch(browser, config)).page
        await until(page, "!document.querySelector('#arm').disabled")
        await page.focus("#arm")
        await page.keyboard.down("Enter")
        await until(page, REMAINING)
        await page.evaluate("document.querySelector('#arm').blur()")  # lets it go without arming, however late
        await page.keyboard.up("Enter")
        await until(page, "document.querySelector('#arm-reasons').hidden")
        for held_s in (0.3, 5.4):
            await hold_to_arm(page, held_s)
            await asyncio.sleep(0.5)
            assert boat.arming.value is not None
            assert not boat.arming.value.armed, held_s


@pytest.mark.rotating(cpu_s=4)
async def test_a_phone_shows_everything_without_scrolling_sideways(
    browser: Any, boat: Boat, spawn: Spawn, config: Config
) -> None:
    async with spawn("operator"), spawn("dashboard"):
        page = (await watch(browser, config, 360, 740)).page
        await until(page, "paani.overlay.mask_seq !== null")
        assert await page.evaluate("document.documentElement.scrollWidth") == 360
        stop = await page.locator("#stop").bounding_box()
        assert stop["y"] + stop["height"] <= 740
        await page.locator("#stop").click()
        await wait_for_arming(boat, armed=False, stopped=True)


@pytest.mark.rotating(cpu_s=3)
async def test_the_choice_of_frame(scripts_page: Any) -> None:
    """The pure chooser, in the engine that runs it."""
    choose = """async ([pictures, evidence, masks]) => {
      const { chooseFrame } = await import("/static/frame_matching.js");
      const c = chooseFrame(pictures, (id) => evidence.includes(id), (id) => masks.includes(id));
      return [c.id, c.evidence, c.mask];
    }"""
    cases: list[tuple[list[str], list[str], list[str], list[object]]] = [
        ([], [], [], [None, False, False]),
        (["3", "2", "1"], [], ["3"], ["3", False, False]),
        (["3", "2", "1"], ["2", "1"], ["2", "1"], ["2", True, True]),
        (["3", "2", "1"], ["3", "2"], ["2"], ["2", True, True]),
        (["4", "3", "2"], ["4", "3", "2"], ["2"], ["4", True, False]),
        (["3"], ["9"], ["9"], ["3", False, False]),
    ]
    for pictures, evidence, masks, expected in cases:
        assert await scripts_page.evaluate(choose, [pictures, evidence, masks]) == expected


async def hold_to_arm(page: Any, held_s: float = 1.3) -> None:
    await until(page, "!document.querySelector('#arm').disabled")
    box = await page.locator("#arm").bounding_box()
    await page.mouse.move(box["x"] + 20, box["y"] + 20)
    await page.mouse.down()
    await page.wait_for_timeout(held_s * 1000)
    await page.mouse.up()


async def wait_for_arming(boat: Boat, *, armed: bool, stopped: bool) -> None:
    """Wait until the operator's state on the bus is this."""
    async with asyncio.timeout(10):
        while True:
            word = boat.arming.value
            if word is not None and (word.armed, word.stopped) == (armed, stopped):
                return
            await asyncio.sleep(0.02)


async def until(page: Any, expression: str) -> None:
    """Wait until an expression is true; the page's policy forbids Playwright's own waiting, which evaluates text.

    Raises AssertionError where the expression fails on the dashboard's page once all of its scripts have run; before
    that, and on any other page, it is taken for false.
    """
    from playwright.async_api import Error  # noqa: PLC0415  without a browser these tests skip

    async with asyncio.timeout(WAIT_S):
        while True:
            # Playwright itself fails where the page is loaded anew meanwhile.
            with contextlib.suppress(Error):
                is_true, fault = await page.evaluate(TRY % expression)
                assert not fault, f"{expression}: {fault}"
                if is_true:
                    return
            await asyncio.sleep(0.05)


async def has_colour_on_map(page: Any, rgb: tuple[int, int, int], east_m: float, north_m: float) -> bool:
    """Whether something of a colour is drawn there, seen from the boat, which the map follows."""
    pixels = await page.evaluate(MAP_PIXELS, [east_m * MAP_PX_PER_M, north_m * MAP_PX_PER_M])
    return any(alpha > 60 and is_colour(colour, rgb) for *colour, alpha in pixels)


async def test_the_map_shows_route_and_position(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config
) -> None:
    route = (await open_as("navigator")).publisher(keys.ROUTE)
    odometry = (await open_as("localization")).publisher(keys.ODOMETRY)
    truth = (await open_as("plant")).publisher(keys.TRUE_POSE)
    async with spawn("dashboard"):
        watched = await watch(browser, config)
        for step in range(20):
            now_us = WallClock().now_us()
            route.put(
                m.Route(
                    source_us=now_us,
                    name="straight",
                    waypoints=(m.Waypoint(x_m=0.0, y_m=0.0), m.Waypoint(x_m=9.0, y_m=4.0)),
                )
            )
            odometry.put(m.Odometry(source_us=now_us, x_m=0.5 * step, y_m=1.0, yaw_rad=0.0, surge_mps=0.5))
            truth.put(
                m.TruePose(
                    source_us=now_us, sim_us=now_us, x_m=0.5 * step, y_m=-4.0, z_m=0.0, roll_rad=0.0, pitch_rad=0.0,
                    yaw_rad=0.0, surge_mps=0.5, sway_mps=0.0, yaw_rate_radps=0.0,
                )
            )  # fmt: skip
            await asyncio.sleep(0.1)
        await until(watched.page, "document.querySelector('#map-pose').textContent.startsWith('9.5 m E, 1.0 m N')")
        await until(watched.page, "document.querySelector('#speed').textContent === '0.50'")
        assert await has_colour_on_map(watched.page, ROUTE_RGB, -5.0, 1.0), "the middle of the only leg"
        assert not await has_colour_on_map(watched.page, ROUTE_RGB, -5.0, -1.0), "north is up"
        assert await has_colour_on_map(watched.page, TRACK_RGB, -5.0, 0.0), "where the boat was"
        assert await has_colour_on_map(watched.page, TRACK_RGB, 1.0, 0.0), "its bow, ahead of where it was"
        assert await has_colour_on_map(watched.page, TRUTH_RGB, 1.0, -5.0), (
            "where it is in truth, which a simulator knows"
        )
        assert await watched.page.inner_text("#map-error") == "error 5.0 m"
        await until(watched.page, RED_ON_MAP)  # a ghost of the boat that is heard no more
        assert watched.errors == []
