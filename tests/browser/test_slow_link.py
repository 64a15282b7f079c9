"""A link that carries less than the boat says: what comes late looks late, and what waits is the newest."""

from __future__ import annotations

import asyncio
import re
import socket
from typing import Any

import cv2
import numpy as np
import pytest

from paani.clock import WallClock
from paani.config import Config
from tests.browser.conftest import Boat
from tests.conftest import Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]

STALLED_S = 4.0
SOURCE_US = re.compile(rb'(?:"source_us":|X-Source-Us: )(\d{16})')
MAX_WAITING_BYTES = 600_000  # three pictures; the kernel alone would keep megabytes
# Ages of frames that were each 100 ms old when they were made, by when they were made and came [ms]; of the last is
# told whether the page has given up the connection.
AGES_MS = """async (frames) => {
  const encode = (text) => new TextEncoder().encode(text);
  let now = 0, isClosed = false, socket;
  performance.now = () => now;
  window.WebSocket = class { constructor() { socket = this; } close() { isClosed = true; } };
  const { connect } = await import("/static/socket.js"), ages = [];
  connect((key, header) => ages.push(Math.round(header.age_ms)), () => {});
  for (const [madeMs, cameMs] of frames) {
    const head = encode(JSON.stringify({ age_ms: 100, made_us: madeMs * 1000 }));
    now = cameMs;
    socket.onmessage({ data: new Uint8Array([1, 0, head.length, ...encode("k"), ...head, ...encode("{}")]).buffer });
  }
  return [ages, isClosed];
}"""


async def test_a_frame_that_waited_on_the_way_is_told_to_be_older(scripts_page: Any) -> None:
    frames = [[7_000_050, 100], [7_001_000, 1000], [7_002_000, 2000], [7_003_000, 5000], [7_007_000, 7000]]
    ages_ms, is_closed = await scripts_page.evaluate(AGES_MS, frames)
    assert ages_ms == pytest.approx([100, 100, 100, 2100, 100], abs=5)
    assert not is_closed


async def test_a_connection_that_is_far_behind_is_given_up(scripts_page: Any) -> None:
    _, is_closed = await scripts_page.evaluate(AGES_MS, [[7_000_000, 0], [7_001_000, 6500]])
    assert is_closed


async def test_clocks_that_drift_apart_make_nothing_old(scripts_page: Any) -> None:
    hours = [[7_000_000 + at, at * (1 + 2e-4)] for at in range(0, 3 * 3_600_000, 60_000)]
    ages_ms, _ = await scripts_page.evaluate(AGES_MS, hours)
    assert max(ages_ms) <= 120


@pytest.mark.parametrize("path", ["/ws", "/stream.mjpg"])
async def test_whoever_could_not_read_for_a_while_is_told_of_now_and_not_of_then(
    spawn: Spawn, boat: Boat, config: Config, path: str
) -> None:
    noise = np.random.default_rng(1).integers(0, 255, (480, 640, 3), np.uint8)
    boat.jpeg = cv2.imencode(".jpg", noise, [cv2.IMWRITE_JPEG_QUALITY, 60])[1].tobytes()
    host = f"127.0.0.1:{config.dashboard.port}"
    upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n" if path == "/ws" else ""
    async with spawn("dashboard"):
        reader, writer = await asyncio.open_connection(sock=_small_socket(config.dashboard.port))
        writer.write(
            f"GET {path} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n{upgrade}"
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
        )
        await reader.readuntil(b"\r\n\r\n")
        writer.transport.pause_reading()  # type: ignore[attr-defined]
        await asyncio.sleep(STALLED_S)
        resumed_us, waiting = WallClock().now_us(), b""
        writer.transport.resume_reading()  # type: ignore[attr-defined]
        while max(map(int, SOURCE_US.findall(waiting)), default=0) < resumed_us:
            waiting += await reader.read(65_536)
        writer.close()
    assert len(waiting) < MAX_WAITING_BYTES


def _small_socket(port: int) -> socket.socket:
    """Connected, and without room for what is not read."""
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 32_768)
    connection.connect(("127.0.0.1", port))
    return connection
