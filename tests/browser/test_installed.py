"""The page on a telephone: installed, it opens while the network is down; alerts sound where somebody asked for it."""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import Any

import pytest

from paani.config import Config
from paani_services.dashboard.pages import LIST, load_static_files
from tests.browser.test_page import until, watch
from tests.conftest import Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

LISTEN = """() => {
  window.given = { tones: 0, vibrations: 0 };
  const Own = AudioContext;
  window.AudioContext = class extends Own {
    createOscillator() { window.given.tones++; return super.createOscillator(); }
  };
  navigator.vibrate = () => { window.given.vibrations++; return true; };
}"""
STOP = "fetch('/api/stop', { method: 'POST' })"
KEPT = "caches.open('paani-page').then((c) => c.keys()).then((all) => all.map((r) => new URL(r.url).pathname))"


async def given(page: Any) -> tuple[int, int]:
    return tuple(await page.evaluate("[given.tones, given.vibrations]"))


@pytest.mark.rotating(cpu_s=7)
async def test_an_installed_page_alerts_on_demand_and_opens_without_a_network(
    browser: Any, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    async with spawn("dashboard"):
        async with spawn("operator"):
            page = (await watch(browser, config, width=390, height=844)).page
            await page.evaluate(LISTEN)
            await until(page, "document.querySelector('#order-word').textContent === 'STOPPED'")
            await page.evaluate(STOP)
            await until(page, "document.querySelector('#log').textContent.includes('STOP')")
            assert await given(page) == (0, 0), "silent until somebody asks for it"
            for name in ("Sound", "Sound, vibration"):
                await page.click("#alerts")
                assert await page.inner_text("#alerts-name") == name
            assert await given(page) == (2, 1), "each choice is heard and felt at once"
            await page.screenshot(path=tmp_path / "phone.png")
        await until(page, "given.tones >= 3 && given.vibrations >= 2")
        manifest = await page.evaluate("fetch('/static/manifest.webmanifest').then((answer) => answer.json())")
        for icon in manifest["icons"]:
            answer = await page.request.get(f"http://127.0.0.1:{config.dashboard.port}{icon['src']}")
            assert (answer.status, answer.headers["content-type"].split(";")[0]) == (200, icon["type"])
        await until(page, "navigator.serviceWorker.controller !== null")
        kept = set(await page.evaluate(KEPT))
    files = {f"/static/{name}" for name in await asyncio.to_thread(load_static_files) if name != LIST}
    assert kept == files | {"/"}, "its own files alone"
    await page.reload()
    assert await page.title() == "PAANI"
    await until(page, "document.querySelector('#link-age').textContent === 'no connection'")
    assert await page.inner_text("#alerts-name") == "Sound, vibration"
    await page.click("#stop")
    await until(page, "document.querySelector('#order-word').textContent === 'NOT CONFIRMED'")
    await page.screenshot(path=tmp_path / "offline.png")
    assert json.dumps(manifest).count("http") == 0
