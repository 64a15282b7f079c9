"""The page as other machines reach it: encrypted, after a login; STOP is for everybody, however many strangers wait."""

from __future__ import annotations

import asyncio
import contextlib
import os
import resource
import socket
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from paani.certificates import page_client_tls
from paani.clock import WallClock
from paani.config import Config
from paani.keys import Graph
from paani.operator_key import ensure_operator_key
from paani_services.dashboard.gatekeeper import KEY_HEADER
from paani_services.dashboard.server import LOGGED_OUT
from paani_tools.certs.folder import make
from tests.browser.conftest import Boat
from tests.browser.test_legibility import AXE, SERIOUS, SMALL_TARGETS, SMALL_TEXT
from tests.browser.test_page import until
from tests.conftest import Spawn

pytestmark = [pytest.mark.integration, pytest.mark.timeout(120)]

HELD = {"press": 7}
NAME = "boat.example"


@pytest.fixture
def private_sets(private_sets: tuple[str, ...], tmp_path: Path) -> tuple[str, ...]:
    folder = tmp_path / "certs"
    make(folder, Graph.SIMULATION, (NAME,), WallClock().now_us(), 1)
    return (*private_sets, f"bus.certificates={folder}", "dashboard.host=0.0.0.0")


@pytest.fixture
def origin(config: Config) -> str:
    return f"https://127.0.0.1:{config.dashboard.port}"


@pytest.fixture
async def client(config: Config, origin: str) -> AsyncIterator[aiohttp.ClientSession]:
    """A browser that knows the boat's authority. Cookies of an address are kept, as browsers do."""
    tls = await asyncio.to_thread(page_client_tls, config.bus)
    jar = aiohttp.CookieJar(unsafe=True)
    async with aiohttp.ClientSession(
        origin, connector=aiohttp.TCPConnector(ssl=tls), cookie_jar=jar, headers={"Origin": origin}
    ) as client:
        yield client


async def status_and_field(answering: Any) -> tuple[int, str]:
    async with answering as answer:
        return answer.status, str((await answer.json()).get("field", ""))


async def test_strangers_see_the_login_and_stop_and_whoever_has_the_key_begins_a_session(
    client: aiohttp.ClientSession, spawn: Spawn, boat: Boat, config: Config, origin: str
) -> None:
    key = await asyncio.to_thread(ensure_operator_key, config.bus)
    async with spawn("operator"), spawn("dashboard"):
        async with aiohttp.ClientSession() as unknowing:
            with pytest.raises(aiohttp.ClientConnectorCertificateError):
                await unknowing.get(f"{origin}/login")
            with pytest.raises(aiohttp.ClientError):
                await unknowing.get(f"{origin.replace('https', 'http')}/login")
        async with client.get("/", allow_redirects=False) as answer:
            assert (answer.status, answer.headers["Location"]) == (303, "/login")
        async with client.get("/login") as answer:
            text = await answer.text()
            assert answer.status == 200
            assert 'id="stop"' in text
            assert key not in text
        for path in ("/snapshot.jpg", "/metrics", "/readyz", "/api/topics", "/api/status", "/api/session", "/ws"):
            assert await status_and_field(client.get(path)) == (401, KEY_HEADER), path
        for path in ("/api/arm/hold", "/api/drive/wheel", "/api/tune/promote", "/api/logout"):
            assert await status_and_field(client.post(path, json=HELD)) == (401, KEY_HEADER), path
        assert await status_and_field(client.get("/login", headers={"Host": "elsewhere.example"})) == (403, "Host")
        assert (await status_and_field(client.get("/healthz", headers={"Host": NAME})))[0] == 200

        async with client.post("/api/stop") as answer:
            assert (await answer.json())["stopped"]

        async def log_in(body: object, **headers: str) -> tuple[int, str]:
            return await status_and_field(client.post("/api/login", json=body, headers=headers))

        assert await log_in({"key": "guess"}) == (403, "key")
        assert await log_in({"key": key, "name": "me"}) == (400, "name")
        assert await log_in({"key": "x" * 300}) == (400, "key")
        assert await log_in({"key": key}, Origin="https://elsewhere.example") == (403, "Origin")
        assert not list(client.cookie_jar)

        async with client.post("/api/login", json={"key": key}) as answer:
            assert answer.status == 200
            cookie = answer.headers["Set-Cookie"]
        assert {"Secure", "HttpOnly", "SameSite=Strict", "Path=/"} <= {part.strip() for part in cookie.split(";")}
        assert cookie.startswith("__Host-")
        token = cookie.partition(";")[0]
        assert key not in token

        async with client.get("/") as answer:
            assert 'id="camera-note"' in await answer.text()
        assert (await status_and_field(client.post("/api/arm/hold", json=HELD)))[0] == 200
        foreign = client.post("/api/arm/hold", json=HELD, headers={"Origin": "https://elsewhere.example"})
        assert await status_and_field(foreign) == (403, "Origin")
        async with client.ws_connect("/ws") as watching:
            assert (await watching.receive(timeout=5.0)).type is aiohttp.WSMsgType.BINARY
            assert (await status_and_field(client.post("/api/logout")))[0] == 200
            async with asyncio.timeout(5.0):
                while (message := await watching.receive()).type is aiohttp.WSMsgType.BINARY:
                    pass
            assert message.data == LOGGED_OUT
        assert await status_and_field(client.get("/metrics", headers={"Cookie": token})) == (401, KEY_HEADER)
        assert (await status_and_field(client.get("/readyz", headers={KEY_HEADER: key})))[0] == 503
        assert await status_and_field(client.get("/readyz", headers={KEY_HEADER: "guess"})) == (401, KEY_HEADER)


async def test_a_stop_finds_a_place_among_strangers_that_never_finish_their_handshake(
    client: aiohttp.ClientSession, spawn: Spawn, boat: Boat, config: Config
) -> None:
    async with spawn("operator"), spawn("dashboard") as process, contextlib.AsyncExitStack() as strangers:
        resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (256, 256))
        for number in range(500):
            stranger = socket.create_connection(("127.0.0.1", config.dashboard.port), timeout=5.0)
            strangers.enter_context(stranger)
            if number % 3 == 0:
                with contextlib.suppress(OSError):  # hung up on already
                    stranger.sendall(b"\x16\x03\x01")
        async with asyncio.timeout(5.0):
            async with client.post("/api/stop") as response:
                assert (await response.json())["stopped"]
        assert len(await asyncio.to_thread(os.listdir, f"/proc/{process.pid}/fd")) < 240


@pytest.mark.browser
async def test_the_login_on_a_phone_is_legible_stops_the_boat_and_lets_in_who_has_the_key(
    browser: Any, spawn: Spawn, boat: Boat, config: Config, origin: str
) -> None:
    key, axe = await asyncio.to_thread(ensure_operator_key, config.bus), await asyncio.to_thread(AXE.read_text, "utf-8")
    async with spawn("operator"), spawn("dashboard"):
        context = await browser.new_context(ignore_https_errors=True, viewport={"width": 360, "height": 740})
        page = await context.new_page()
        await page.goto(origin)
        assert page.url == f"{origin}/login"
        for palette in ("day", "dusk", "night"):
            await page.evaluate("(name) => localStorage.setItem('paani-palette', name)", palette)
            await page.reload()
            await until(page, f"document.documentElement.dataset.palette === '{palette}'")
            await page.evaluate(axe)
            assert await page.evaluate(SERIOUS) == [], palette
            assert await page.evaluate(SMALL_TEXT) == []
            assert await page.evaluate(SMALL_TARGETS, 44) == []
            assert await page.evaluate("document.documentElement.scrollWidth") == 360
        note = "document.querySelector('#stop-note').textContent"
        await page.click("#stop")
        await until(page, f"{note} === 'STOPPED: latched until an operator arms.'")
        assert boat.arming.value is not None
        assert boat.arming.value.stopped
        await page.fill("#key", "guess")
        await page.click("#login button")
        await until(
            page, """document.querySelector('#login-note').textContent === "That is not the operator's key.\""""
        )
        await page.fill("#key", key)
        await page.click("#login button")
        await page.wait_for_selector("body[data-link='live']", timeout=20_000)
        assert page.url == f"{origin}/"
        assert key not in await page.evaluate("document.cookie + JSON.stringify({...localStorage, ...sessionStorage})")
        await page.wait_for_selector("#logout:visible", timeout=20_000)
        await page.click("#logout")
        await page.wait_for_selector("#login", timeout=20_000)
        await context.close()
