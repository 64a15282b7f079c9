"""Hostile requests for every route of `/openapi.json`, and hostile frames: refused with a reason, and nothing moves.

`FUZZ_COUNT=N` sets how many requests. Those of types alone, without a server, are in `tests/fuzz/lines.py`.
"""

from __future__ import annotations

import asyncio
import json
import os
import random
import struct
from pathlib import Path
from typing import Any

import aiohttp
import pytest

from paani.config import Config
from tests.arming import headers_of
from tests.at_work import at_work
from tests.browser.conftest import Boat
from tests.conftest import Spawn
from tests.fuzz.damage import ODD_TEXTS, damaged_bytes, damaged_text, damaged_tree, json_bytes

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

FEW = int(os.environ.get("FUZZ_COUNT", "400"))
WORKERS = 8
MAY_GROW_KIB = 64 << 10
ENDLESS = {"/ws", "/stream.mjpg"}
METHODS = ("get", "post", "put", "delete", "patch", "options", "head", "NONSENSE")
PARTS = (
    "main.js", "advisor", "..%2f..%2fetc%2fpasswd", "%00", "%ff%fe", "a" * 3000, "-1", "9" * 20, "18", "%2e",
)  # fmt: skip
NUMBERS = ("1", "-1", "0", "1e400", "nan", "9" * 400, "x", "", "5.5", "%ff")
RAW_REQUESTS = (
    b"GET / HTTP/9.9\r\n\r\n",
    b"\x16\x03\x01\x02\x00\x01\x00",
    b"POST /api/stop HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: -5\r\n\r\n",
    b"POST /api/tune/propose HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
    b"GET / HTTP/1.1\r\n" + b"X: " + b"a" * 100_000 + b"\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: [::1\r\n\r\n",
    b"GET /\xff\xfe HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
)
UPGRADE = (
    "GET /ws HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)
CLOSE, SIZE_16, SIZE_64 = 8, 126, 127
MASK = bytes(4)  # leaves the payload as it is
# What it is, its bytes, and the code with which the server closes (RFC 6455, 7.4.1).
FRAMES = (
    ("a field that nobody knows", b"\x81\x87" + MASK + b'{"a":1}', 1008),
    ("text that is no UTF-8", b"\x81\x82" + MASK + b"\xff\xfe", 1007),
    ("bytes", b"\x82\x83" + MASK + b"abc", 1008),
    ("too large", b"\x82\xfe" + struct.pack("!H", 2000) + MASK + bytes(2000), 1009),
    ("a length of 2^62", b"\x82\xff" + struct.pack("!Q", 1 << 62) + MASK, 1009),
    ("an opcode that is reserved", b"\x83\x81" + MASK + b"x", 1002),
    ("a bit that is reserved", b"\xc1\x81" + MASK + b"x", 1002),
    ("a ping in pieces", b"\x09\x81" + MASK + b"x", 1002),
)


def valid(schema: dict[str, Any], schemas: dict[str, Any], rng: random.Random) -> Any:
    """A value that the schema takes."""
    if "$ref" in schema:
        return valid(schemas[schema["$ref"].rpartition("/")[2]], schemas, rng)
    if "enum" in schema:
        return rng.choice(schema["enum"])
    if "anyOf" in schema:
        return valid(rng.choice(schema["anyOf"]), schemas, rng)
    match schema.get("type"):
        case "object":
            return {name: valid(each, schemas, rng) for name, each in schema.get("properties", {}).items()}
        case "array":
            return [valid(schema.get("items", {}), schemas, rng) for _ in range(rng.randrange(3))]
        case "string":
            return rng.choice(("", "a1", "advisor.policy.center_block_risk", "0.4"))
        case "integer":
            return schema.get("minimum", 0) + rng.randrange(5)
        case "number":
            return rng.uniform(schema.get("minimum", 0.0), schema.get("maximum", 1.0))
    return rng.choice((True, None))


class Hostile:
    """Requests for the operations of a document, damaged in one way or several."""

    def __init__(self, document: dict[str, Any], ours: dict[str, str], rng: random.Random) -> None:
        self._schemas, self._ours, self._rng = document["components"]["schemas"], ours, rng
        self._operations = [
            (method, path, operation)
            for path, methods in document["paths"].items()
            for method, operation in methods.items()
            if path not in ENDLESS
        ]

    def next(self, number: int) -> tuple[str, str, dict[str, str], bytes, dict[str, Any]]:
        """Method, address, headers, body, and what the document says of it. Every operation comes in turn."""
        rng = self._rng
        method, path, operation = self._operations[number % len(self._operations)]
        for parameter in operation["parameters"]:
            if parameter["in"] == "path":
                path = path.replace(f"{{{parameter['name']}}}", rng.choice(PARTS))
        names = [each["name"] for each in operation["parameters"] if each["in"] == "query"]
        if names or rng.random() < 0.1:
            path += "?" + "&".join(
                f"{name}={rng.choice(NUMBERS)}" for name in rng.choices([*names, "x"], k=rng.randrange(4))
            )
        sent = rng.choice(METHODS) if rng.random() < 0.1 else method
        headers = dict(self._ours) if rng.random() < 0.7 else {}
        if rng.random() < 0.15:
            name = rng.choice(("Origin", "Host", "Cookie", "X-Paani-Key", "Content-Type", "Range", "If-None-Match"))
            headers[name] = rng.choice(("null", "é", "a" * 5000, "elsewhere.example", "\x7f"))
        return sent, path, headers, self._body(operation), operation

    def _body(self, operation: dict[str, Any]) -> bytes:
        rng = self._rng
        if "requestBody" not in operation:
            return rng.choice((b"", b"\xff", b"{}"))
        tree = valid(operation["requestBody"]["content"]["application/json"]["schema"], self._schemas, rng)
        match rng.randrange(6):
            case 0:
                return json.dumps(tree).encode()
            case 1:
                return damaged_bytes(json.dumps(tree).encode(), rng)
            case 2:
                return damaged_text(json.dumps(tree).encode(), rng)
            case 3:
                return json.dumps(tree | {rng.choice(ODD_TEXTS): 1}).encode()
            case 4:
                return b'{"hand":1,"name":"' + b"a" * rng.choice((5_000, 70_000)) + b'"}'
        return json_bytes(damaged_tree(tree, rng), rng)


async def test_every_route_refuses_what_is_hostile_and_nothing_moves(spawn: Spawn, boat: Boat, config: Config) -> None:
    origin = f"http://127.0.0.1:{config.dashboard.port}"
    armed = False

    async def watch_arming() -> None:
        nonlocal armed
        while True:
            armed |= (await boat.arming.next()).armed

    async with (
        spawn("operator"),
        spawn("dashboard") as process,
        aiohttp.ClientSession(origin) as client,
        at_work(watch_arming()),
    ):
        ours = await asyncio.to_thread(headers_of, origin, config.bus)
        async with client.get("/openapi.json") as answer:
            hostile = Hostile(await answer.json(), ours, random.Random(1))
        statuses: set[int] = set()

        async def ask(number: int) -> None:
            method, path, headers, body, operation = hostile.next(number)
            what = (number, method, path[:200], headers, body[:300])
            try:
                async with client.request(method, path, headers=headers, data=body, allow_redirects=False) as answer:
                    text = await answer.read()
            except ValueError:  # a header that no client may send
                return
            statuses.add(answer.status)
            assert answer.status != 500, what
            assert answer.status < 500 or str(answer.status) in operation["responses"], (answer.status, *what)
            if answer.status >= 400 and answer.content_type == "application/json" and method != "head":
                refusal = json.loads(text)
                assert "unready" in refusal or (refusal["error"] and refusal["field"]), what
                assert "\n" not in refusal.get("error", ""), what

        async def work(first: int) -> None:
            for number in range(first, FEW, WORKERS):
                await ask(number)

        await asyncio.gather(*(ask(number) for number in range(WORKERS)))
        before_kib = await asyncio.to_thread(rss_kib, process.pid)
        await asyncio.gather(*(work(first) for first in range(WORKERS)))
        for raw in RAW_REQUESTS:
            assert b" 5" not in (await answer_to(config, raw)).partition(b"\r\n")[0], raw[:80]
        async with client.ws_connect("/ws", origin=origin) as fine:
            upgrade = UPGRADE.format(host=f"127.0.0.1:{config.dashboard.port}").encode()
            for what, frame, code in FRAMES:
                assert await close_code(config, upgrade + frame) == code, what
            assert (await fine.receive(timeout=5.0)).type is aiohttp.WSMsgType.BINARY
        assert {200, 400, 403, 404, 405, 413} <= statuses
        assert await asyncio.to_thread(rss_kib, process.pid) - before_kib < MAY_GROW_KIB
        async with client.post("/api/stop") as answer:
            assert (await answer.json())["stopped"]
    assert not armed


def rss_kib(pid: int) -> int:
    """Resident memory of a process."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    return int(status.partition("VmRSS:")[2].split()[0])


async def answer_to(config: Config, data: bytes) -> bytes:
    """The first that the server answers, empty where it hangs up."""
    reader, writer = await asyncio.open_connection("127.0.0.1", config.dashboard.port)
    writer.write(data)
    try:
        async with asyncio.timeout(10.0):
            return await reader.read(200)
    except ConnectionError:
        return b""
    finally:
        writer.close()


async def close_code(config: Config, data: bytes) -> int:
    """The code of the server's closing frame after these bytes."""
    reader, writer = await asyncio.open_connection("127.0.0.1", config.dashboard.port)
    writer.write(data)
    try:
        async with asyncio.timeout(10.0):
            assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 101")
            while True:
                opcode, size = await reader.readexactly(2)
                if size == SIZE_16:
                    (size,) = struct.unpack("!H", await reader.readexactly(2))
                elif size == SIZE_64:
                    (size,) = struct.unpack("!Q", await reader.readexactly(8))
                payload = await reader.readexactly(size)
                if opcode & 0x0F == CLOSE:
                    return int.from_bytes(payload[:2], "big")
    finally:
        writer.close()
