"""The page in headless Chromium: loads, moments at which a picture is drawn, presses, and its heap."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
from collections.abc import AsyncIterator
from typing import Any

import msgspec
from playwright.async_api import async_playwright

from paani.config import Config
from paani.errors import UserError
from paani.operator_key import ensure_operator_key
from paani.page_address import page_origin
from paani_tools.bench.deck.loads import PageLoad
from paani_tools.bench.deck.page_probe import PROBE, TAKE

CHROMIUM = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")  # what shows no window first
LIVE_TIMEOUT_S, POLL_S = 30.0, 0.01
LIVE = "document.body.dataset.link === 'live'"
LOADED = """() => {
  const files = performance.getEntriesByType('resource'), page = performance.getEntriesByType('navigation')[0];
  return { load_ms: performance.now(), files: 1 + files.length,
    bytes: page.transferSize + files.reduce((all, file) => all + file.transferSize, 0) };
}"""
HIDE_OVERLAYS = """() => {
  const range = document.querySelector('#camera-opacity');
  range.value = 0;
  range.dispatchEvent(new Event('input'));
}"""
PRESS_STOP = """() => {
  const at = 1e3 * (performance.timeOrigin + performance.now());
  document.querySelector('#stop').dispatchEvent(new PointerEvent('pointerdown'));
  return at;
}"""
TAKE_WHEEL = """() => {
  const buttons = ['#drive-take:not([hidden])', '[data-drive=MANUAL]:enabled'];
  for (const name of buttons) document.querySelector(name)?.click();
}"""
KEY = """([type, code]) => {
  const at = 1e3 * (performance.timeOrigin + performance.now());
  dispatchEvent(new KeyboardEvent(type, { code }));
  return at;
}"""


@contextlib.asynccontextmanager
async def answering(otherwise: str) -> AsyncIterator[None]:
    """Wait for a page for so long. Raises TimeoutError that says what it did not do."""
    try:
        async with asyncio.timeout(LIVE_TIMEOUT_S):
            yield
    except TimeoutError:
        raise TimeoutError(f"{otherwise} within {LIVE_TIMEOUT_S:g} s") from None


class Deck:
    """One page, kept open. Moments are Unix time [us], by the clock of this machine, which the boat has too."""

    def __init__(self, page: Any) -> None:
        self._page = page
        self._devtools: Any = None

    async def close(self) -> None:
        await self._page.context.close()

    async def take_pictures(self) -> list[dict[str, Any]]:
        """What the probe noted of each picture that was drawn since the last time; of a probed page alone."""
        found: list[dict[str, Any]] = await self._page.evaluate(TAKE)
        return found

    async def hide_overlays(self) -> None:
        """Show the picture alone, which waits for nothing that is found in it."""
        await self._page.evaluate(HIDE_OVERLAYS)

    async def press_stop(self) -> float:
        """When it was pressed."""
        return float(await self._page.evaluate(PRESS_STOP))

    async def press_key(self, code: str) -> float:
        """Hold a key until it is let go; when it went down."""
        return float(await self._page.evaluate(KEY, ["keydown", code]))

    async def let_key_go(self, code: str) -> None:
        await self._page.evaluate(KEY, ["keyup", code])

    async def take_wheel(self) -> None:
        """Drive by hand. Raises TimeoutError where the page may not."""
        async with answering("the page did not get the wheel"):
            while await self._page.evaluate("document.querySelector('#drive').dataset.driving") != "true":
                await self._page.evaluate(TAKE_WHEEL)
                await asyncio.sleep(0.3)

    async def heap_mib(self) -> float:
        """Of JavaScript, after a collection."""
        tools = await self._tools()
        await tools.send("HeapProfiler.collectGarbage")
        return float((await tools.send("Runtime.getHeapUsage"))["usedSize"]) / 2**20

    async def _tools(self) -> Any:
        if self._devtools is None:
            self._devtools = await self._page.context.new_cdp_session(self._page)
        return self._devtools


class Browser:
    """Headless Chromium."""

    def __init__(self, browser: Any, config: Config, key: str) -> None:
        self._browser, self._origin, self._key = browser, page_origin(config), key

    async def open_page(self, origin: str = "", *, probed: bool = False) -> tuple[Deck, PageLoad]:
        """A page of a visitor who comes for the first time: nothing is kept. origin: where, if not at the server.

        probed: what it does with each picture is noted.
        """
        context = await self._browser.new_context(viewport={"width": 1440, "height": 900}, service_workers="block")
        page = await context.new_page()
        if probed:
            await page.add_init_script(PROBE)
        await page.goto(f"{origin or self._origin}/#key={self._key}")
        async with answering("the page heard nothing of the boat"):
            while not await page.evaluate(LIVE):  # noqa: ASYNC110  # a browser wakes nobody, and the page forbids eval
                await asyncio.sleep(POLL_S)
        return Deck(page), msgspec.convert(await page.evaluate(LOADED), PageLoad)

    async def load_page(self) -> PageLoad:
        """What a load takes; the page is closed then."""
        deck, load = await self.open_page()
        await deck.close()
        return load


def find_chromium() -> str | None:
    """Where this machine has Chromium; None without one."""
    return next((found for name in CHROMIUM if (found := shutil.which(name))), None)


@contextlib.asynccontextmanager
async def launched(path: str, drawing: tuple[str, ...] = ("--disable-gpu",)) -> AsyncIterator[Any]:
    """The browser of Playwright that this program is. drawing: its options for how it draws."""
    async with async_playwright() as driver:
        browser = await driver.chromium.launch(executable_path=path, args=["--no-sandbox", *drawing])
        try:
            yield browser
        finally:
            await browser.close()


@contextlib.asynccontextmanager
async def chromium(config: Config) -> AsyncIterator[Browser]:
    """Raises UserError where there is none on this machine."""
    path = find_chromium()
    if path is None:
        raise UserError(f"bench deck: no Chromium on this machine (looked for {', '.join(CHROMIUM)})")
    key = await asyncio.to_thread(ensure_operator_key, config.bus)
    async with launched(path) as browser:
        yield Browser(browser, config, key)
