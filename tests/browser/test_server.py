"""The web server as a stranger meets it: what it serves, what it refuses, what it answers."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import os
import resource
import socket
import sys
from collections.abc import AsyncIterator
from typing import Any

import aiohttp
import msgspec
import pytest
from msgspec.structs import replace

from paani import keys
from paani.clock import WallClock
from paani.config import Config
from paani.mission_client import MissionClient
from paani.operator_client import OperatorClient
from paani.runtime import LOGS, runtime_path
from paani_services.dashboard.answers import ErrorAnswer, ReadyAnswer
from paani_services.dashboard.gatekeeper import KEY_HEADER, Gatekeeper
from paani_services.dashboard.history import History
from paani_services.dashboard.hub import Hub
from paani_services.dashboard.openapi import LOGIN_OPERATIONS, OPERATIONS
from paani_services.dashboard.picture_stream import MAX_STREAMS
from paani_services.dashboard.server import GIVEN_AWAY, MAX_CLIENTS, Server
from paani_services.dashboard.tuning import Tuner
from tests.arming import arm_on_page, headers_of, hold_on_page
from tests.browser.conftest import Boat
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.integration, pytest.mark.timeout(90)]

HELD = {"press": 7}


@pytest.fixture
async def client(config: Config) -> AsyncIterator[aiohttp.ClientSession]:
    async with aiohttp.ClientSession(f"http://127.0.0.1:{config.dashboard.port}") as client:
        yield client


async def test_page_and_headers(client: aiohttp.ClientSession, spawn: Spawn) -> None:
    async with spawn("dashboard"):
        for path, media_type in (
            ("/", "text/html"), ("/static/main.js", "text/javascript"), ("/static/uPlot.min.css", "text/css"),
        ):  # fmt: skip
            async with client.get(path) as answer:
                assert answer.status == 200
                assert answer.content_type == media_type
                assert answer.headers["Cache-Control"] == "no-cache"
                policy = answer.headers["Content-Security-Policy"]
                assert policy.startswith("default-src 'self'; img-src 'self' blob: data:")
                assert "unsafe" not in policy
        for path in (
            "/static/../service.py",
            "/static/%2e%2e%2fservice.py",
            "/static/absent.js",
            "/static/README.md",
            "/etc/passwd",
        ):
            async with client.get(path) as answer:
                assert answer.status == 404
        async with client.get("/api/topics") as answer:
            assert [row["name"] for row in await answer.json()] == [topic.name for topic in keys.TOPICS]


async def test_arming_needs_the_own_page_the_operators_key_and_a_valid_request(
    client: aiohttp.ClientSession, spawn: Spawn, boat: Boat, config: Config
) -> None:
    """The page itself holds no secret: who can load it can watch, and stop."""
    page = f"http://127.0.0.1:{config.dashboard.port}"
    async with spawn("operator"), spawn("dashboard"):
        ours = await asyncio.to_thread(headers_of, page, config.bus)
        async with client.get("/") as answer:
            assert ours[KEY_HEADER] not in await answer.text()
        cases: list[tuple[dict[str, str], object, int, str]] = [
            ({}, HELD, 403, "Origin"),
            ({**ours, "Origin": "http://elsewhere.example"}, HELD, 403, "Origin"),
            ({"Origin": page}, HELD, 403, KEY_HEADER),
            ({**ours, KEY_HEADER: "guess"}, HELD, 403, KEY_HEADER),
            (ours, {"press": 0}, 400, "press"),
            (ours, {"press": 7, "speed": 9}, 400, "speed"),
            ({**ours, "Host": "elsewhere.example"}, HELD, 403, "Host"),
        ]
        for act in ("hold", "release"):
            for headers, body, status, field in cases:
                async with client.post(f"/api/arm/{act}", json=body, headers=headers) as answer:
                    assert (answer.status, (await answer.json())["field"]) == (status, field)
        status, text = await hold_on_page(page, config.bus, held_s=0.4, press=1)
        assert (status, "less than a second" in text) == (409, True)
        assert boat.arming.value is not None
        assert not boat.arming.value.armed
        await arm_on_page(page, config.bus, press=2)
        await until_arming(boat, armed=True)


async def test_driving_needs_the_own_page_the_operators_key_and_a_valid_request(
    client: aiohttp.ClientSession, spawn: Spawn, boat: Boat, config: Config
) -> None:
    """A refused mode says why; another hand of the page takes the wheel over."""
    page = f"http://127.0.0.1:{config.dashboard.port}"
    bodies: dict[str, dict[str, object]] = {
        "mode": {"hand": 1, "mode": "IDLE"},
        "wheel": {"hand": 1},
        "override": {"hand": 1},
        "setpoint": {"hand": 1, "number": 1, "surge": 0.5, "turn": 0.0},
    }
    async with spawn("operator"), spawn("dashboard"):
        ours = await asyncio.to_thread(headers_of, page, config.bus)

        async def ask(act: str, headers: dict[str, str] = ours, **changes: object) -> tuple[int, str]:
            async with client.post(f"/api/drive/{act}", json=bodies[act] | changes, headers=headers) as answer:
                return answer.status, await answer.text()

        for act in bodies:
            assert (await ask(act, {}))[0] == 403
            assert (await ask(act, {**ours, KEY_HEADER: "guess"}))[0] == 403
            status, text = await ask(act, hand=0)
            assert (status, '"field":"hand"' in text) == (400, True)
        for field, wrong in (("surge", 1.01), ("turn", -2), ("number", 0), ("speed", 1)):
            status, text = await ask("setpoint", ours, **{field: wrong})
            assert (status, f'"field":"{field}"' in text) == (400, True)
        assert (await ask("mode", mode="FAST"))[0] == 400
        for length, status, why in ((1, 409, "takes 2 to 10000"), (100_000, 413, "error")):
            leg = {"kind": "follow_route", "waypoints": [{"x_m": 0.5, "y_m": -0.25}] * length}
            body = json.dumps({"hand": 1, "legs": [leg]}).encode()
            for headers, expected in ((ours, status), ({"Origin": page}, 403)):
                async with client.post("/api/mission", data=io.BytesIO(body), headers=headers) as answer:
                    assert answer.status == expected
                    assert (why if expected != 403 else "key") in await answer.text()
        assert await ask("mode") == (200, '{"done":true}')
        status, text = await ask("mode", mode="MANUAL")
        assert (status, "the boat is not armed" in text) == (409, True)
        status, text = await ask("override")
        assert (status, "not driven by hand" in text) == (409, True)
        status, text = await ask("mode", hand=2)
        assert (status, "another hand holds the wheel" in text) == (409, True)
        assert (await ask("wheel", hand=2))[0] == 200
        assert (await ask("mode", hand=2))[0] == 200
        assert (await ask("setpoint", hand=2))[0] == 200
        assert boat.arming.value is not None
        assert not boat.arming.value.armed
    async with spawn("dashboard"):
        status, text = await ask("wheel")
        assert (status, "does not answer" in text) == (503, True)


async def test_anybody_may_stop_with_any_body(
    client: aiohttp.ClientSession, spawn: Spawn, boat: Boat, config: Config
) -> None:
    async with spawn("operator"), spawn("dashboard"):
        await arm_on_page(f"http://127.0.0.1:{config.dashboard.port}", config.bus)
        await until_arming(boat, armed=True)
        async with client.post("/api/stop", data=b"\xff not json", headers={"Host": "elsewhere.example"}) as answer:
            assert (await answer.json()) == {"stopped": True, "kept": True}
        await until_arming(boat, armed=False)
        assert boat.arming.value is not None
        assert boat.arming.value.stopped


async def test_a_stop_that_nobody_latches_is_said_to_be_none(client: aiohttp.ClientSession, spawn: Spawn) -> None:
    async with spawn("dashboard"), client.post("/api/stop") as answer:
        assert (answer.status, (await answer.json())["field"]) == (503, "stopped")


async def until_arming(boat: Boat, *, armed: bool) -> None:
    async with asyncio.timeout(5):
        while boat.arming.value is None or boat.arming.value.armed is not armed:
            await asyncio.sleep(0.02)


async def test_snapshot(client: aiohttp.ClientSession, spawn: Spawn, boat: Boat) -> None:
    async with spawn("dashboard"):
        async with asyncio.timeout(10):
            while True:
                async with client.get("/snapshot.jpg?max_age_s=2") as answer:
                    if answer.status == 200:
                        assert (await answer.read()).startswith(b"\xff\xd8")
                        break
                await asyncio.sleep(0.1)
        async with client.get("/snapshot.jpg?max_age_s=soon") as answer:
            assert (answer.status, (await answer.json())["field"]) == (400, "max_age_s")


async def test_machines_ask_for_life_readiness_and_metrics(
    client: aiohttp.ClientSession, spawn: Spawn, boat: Boat, config: Config
) -> None:
    """The processes of this test send no reports but the dashboard: it lives, the whole is not ready."""
    async with spawn("dashboard"):
        async with client.get("/healthz") as answer:
            assert (answer.status, (await answer.json())["ok"]) == (200, True)
        async with asyncio.timeout(10):
            while True:
                async with client.get("/readyz") as answer:
                    assert answer.status == 503
                    unready = (await answer.json())["unready"]
                if "dashboard" not in unready:
                    break
                await asyncio.sleep(0.1)
        assert set(unready) == {name for name in config.services if name != "dashboard"}
        async with asyncio.timeout(10):
            lines: list[str] = []
            while not any(line.startswith("paani_advice{") for line in lines):
                async with client.get("/metrics") as answer:
                    assert (answer.status, answer.content_type) == (200, "text/plain")
                    lines = (await answer.text()).splitlines()
        assert 'paani_service_ready{service="dashboard"} 1.0' in lines
        assert 'paani_service_ready{service="navigator"} 0.0' in lines
        assert 'paani_advice{direction="RIGHT"} 1.0' in lines
        async with client.get("/metrics?all=1") as answer:
            assert answer.status == 400
        async with client.get("/openapi.json") as answer:
            described = (await answer.json())["paths"]
        for each in OPERATIONS:
            path = each.path.replace("{name}", "main.js")
            if path in {"/ws", "/stream.mjpg"}:
                continue
            async with client.request(each.method, path) as answer:
                response = described[each.path][each.method]["responses"][str(answer.status)]
                content = answer.content_type in response["content"] or "{name}" in each.path
                assert content, (path, answer.status, answer.content_type)
                if answer.content_type == "application/json":
                    is_error = answer.status >= 400 and each.answer is not ReadyAnswer
                    found = msgspec.json.decode(await answer.read(), type=ErrorAnswer if is_error else each.answer)
                    assert msgspec.json.decode(msgspec.json.encode(found)) == await answer.json(), path


async def test_every_route_is_described_and_nothing_else(open_as: OpenAs, config: Config) -> None:
    bus, clock = await open_as("dashboard"), WallClock()
    for exposed in (False, True):
        whole = replace(config, dashboard=replace(config.dashboard, host="0.0.0.0" if exposed else "127.0.0.1"))
        tuner = Tuner(bus.publisher(keys.TUNING), clock)
        gatekeeper = Gatekeeper(whole, "key", clock)
        operator, missions = OperatorClient(bus, clock), MissionClient(bus, clock)
        server = Server(Hub(), History(()), operator, missions, tuner, clock, whole, {}, gatekeeper)
        routes = {
            (each.method.lower(), each.resource.canonical) for each in server.app().router.routes() if each.resource
        }
        described = {(each.method, each.path) for each in (*OPERATIONS, *(LOGIN_OPERATIONS if exposed else ()))}
        assert {route for route in routes if route[0] != "head"} == described


async def test_streams_send_the_newest_picture_to_a_bounded_number(
    client: aiohttp.ClientSession, spawn: Spawn, boat: Boat
) -> None:
    async with spawn("dashboard"), contextlib.AsyncExitStack() as stack:
        streams = [await stack.enter_async_context(client.get("/stream.mjpg")) for _ in range(MAX_STREAMS)]
        async with client.get("/stream.mjpg") as answer:
            assert (answer.status, (await answer.json())["field"]) == (503, "/stream.mjpg")
        numbers = []
        for _ in range(3):
            head = (await streams[0].content.readuntil(b"\r\n\r\n")).decode()
            length = int(head.partition("Content-Length: ")[2].partition("\r\n")[0])
            assert (await streams[0].content.readexactly(length)).startswith(b"\xff\xd8")
            numbers.append(int(head.partition("X-Frame-Id: ")[2].partition("\r\n")[0].partition(".")[2]))
        assert numbers == sorted(set(numbers))
        streams[1].close()
        async with asyncio.timeout(5.0):
            while True:
                async with client.get("/stream.mjpg") as answer:
                    if answer.status == 200:
                        break
                await asyncio.sleep(0.1)


async def test_the_past_and_the_logs_are_bounded_and_refuse_what_is_not_there(
    client: aiohttp.ClientSession, spawn: Spawn, boat: Boat, config: Config
) -> None:
    folder = runtime_path(config.bus) / LOGS
    await asyncio.to_thread(folder.mkdir, exist_ok=True)
    await asyncio.to_thread((folder / "advisor.log").write_text, "one\ntwo\n", encoding="utf-8")
    async with spawn("dashboard"):

        async def ask(path: str) -> tuple[int, dict[str, Any]]:
            async with client.get(path) as answer:
                return answer.status, await answer.json()

        assert await ask("/api/logs/advisor") == (200, {"lines": ["one", "two"], "cut": False})
        for path, status, field in (
            ("/api/logs/navigator", 404, "service"),
            ("/api/logs/..%2Foperator-key", 404, "service"),
            ("/api/logs/advisor?lines=9", 400, "lines"),
            ("/api/history?all=1", 400, "all"),
            ("/api/history/frames?from_us=5&to_us=4", 400, "to_us"),
            ("/api/history/frames?from_us=0&to_us=15000001", 400, "to_us"),
            ("/api/history/frames?from_us=-1&to_us=4", 400, "from_us"),
        ):
            found, refusal = await ask(path)
            assert (found, refusal["field"]) == (status, field), path
        async with asyncio.timeout(10):
            while True:
                _, series = await ask("/api/history")
                columns = dict(zip(series["samples"]["names"], series["samples"]["values"], strict=True))
                if "RIGHT" in columns["advice"]:
                    break
                await asyncio.sleep(0.1)
        last_us = columns["at_us"][-1]
        async with client.get(f"/api/history/frames?from_us={last_us}&to_us={last_us}") as answer:
            assert answer.content_type == "application/octet-stream"
            assert b"camera/picture" in await answer.read()


async def test_a_client_that_never_reads_delays_nobody(
    client: aiohttp.ClientSession, spawn: Spawn, boat: Boat, config: Config
) -> None:
    origin = f"http://127.0.0.1:{config.dashboard.port}"
    async with spawn("dashboard"):
        with socket.create_connection(("127.0.0.1", config.dashboard.port)) as stalled:
            stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            stalled.sendall(
                f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{config.dashboard.port}\r\nOrigin: {origin}\r\n"
                "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
            )
            async with client.ws_connect("/ws", origin=origin) as watching:
                frames = 0
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(3):
                        while True:
                            frames += b"camera/picture" in (await watching.receive_bytes())[:32]
                assert frames >= 10


async def test_idle_connections_leave_room_for_a_stop(
    client: aiohttp.ClientSession, spawn: Spawn, boat: Boat, config: Config
) -> None:
    """With as many descriptors as a process usually has, and more strangers than these, a third amid a request."""
    async with spawn("operator"), spawn("dashboard") as process, contextlib.AsyncExitStack() as strangers:
        resource.prlimit(process.pid, resource.RLIMIT_NOFILE, (1024, 1024))
        for number in range(1100):
            stranger = socket.create_connection(("127.0.0.1", config.dashboard.port), timeout=5.0)
            strangers.enter_context(stranger)
            if number % 3 == 0:
                with contextlib.suppress(OSError):  # hung up on already
                    stranger.sendall(b"POST /api/stop HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow")
        async with asyncio.timeout(5.0):
            async with client.post("/api/stop") as response:
                assert (await response.json())["stopped"]
            while boat.arming.value is None or not boat.arming.value.stopped:
                await boat.arming.next()
        assert len(await asyncio.to_thread(os.listdir, f"/proc/{process.pid}/fd")) < 512


async def test_one_page_too_many_takes_the_place_of_the_oldest(
    client: aiohttp.ClientSession, spawn: Spawn, config: Config
) -> None:
    origin = f"http://127.0.0.1:{config.dashboard.port}"
    async with spawn("dashboard"), contextlib.AsyncExitStack() as stack:
        pages = [
            await stack.enter_async_context(client.ws_connect("/ws", origin=origin)) for _ in range(MAX_CLIENTS + 1)
        ]
        for page in pages[1:]:
            assert (await page.receive(timeout=5.0)).type is aiohttp.WSMsgType.BINARY
        async with asyncio.timeout(5.0):
            while (message := await pages[0].receive()).type is aiohttp.WSMsgType.BINARY:
                pass
        assert message.data == GIVEN_AWAY
        assert not pages[-1].closed


async def test_a_foreign_page_cannot_open_the_socket(client: aiohttp.ClientSession, spawn: Spawn) -> None:
    async with spawn("dashboard"):
        with pytest.raises(aiohttp.WSServerHandshakeError) as caught:
            await client.ws_connect("/ws", origin="http://elsewhere.example")
        assert caught.value.status == 403


async def test_without_a_page_nothing_listens(spawn: Spawn, config: Config) -> None:
    async with spawn("dashboard", "dashboard.serve=false"):
        with pytest.raises(ConnectionRefusedError):
            await asyncio.open_connection("127.0.0.1", config.dashboard.port)


async def test_busy_port_is_one_line_and_exit_2(open_as: OpenAs, private_sets: tuple[str, ...], config: Config) -> None:
    await open_as("observer")
    with socket.create_server(("127.0.0.1", config.dashboard.port)):
        arguments = [word for setting in private_sets for word in ("--set", setting)]
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "paani", "dashboard", *arguments, stderr=asyncio.subprocess.PIPE
        )
        async with asyncio.timeout(30):
            _, errors = await process.communicate()
    assert process.returncode == 2
    lines = errors.decode().splitlines()
    assert len(lines) == 1
    assert "dashboard.port" in lines[0]
