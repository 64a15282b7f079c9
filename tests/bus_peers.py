"""Routers and clients of a test that has several of them, each with settings of its own."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

from paani.bus import Bus, open_bus
from paani.bus.routing import open_router
from paani.clock import WallClock
from paani.config import BusConfig

CLOCK = WallClock()


@contextlib.asynccontextmanager
async def routing(config: BusConfig) -> AsyncIterator[None]:
    """A router with these settings, in this process."""
    router = await open_router(config)
    try:
        yield
    finally:
        await asyncio.to_thread(router.close)


@contextlib.asynccontextmanager
async def joined(config: BusConfig, user: str, limit_s: float | None = None) -> AsyncIterator[Bus]:
    """The bus as this user; TimeoutError where no router lets it in within the limit (None: it waits)."""
    async with asyncio.timeout(limit_s):
        bus = await open_bus(config, user, CLOCK)
    try:
        yield bus
    finally:
        await bus.close()


async def until(condition: Callable[[], bool], act: Callable[[], object] = lambda: None, limit_s: float = 10.0) -> None:
    """Act again and again until the condition holds; TimeoutError where it does not within the limit."""
    async with asyncio.timeout(limit_s):
        while not condition():
            act()
            await asyncio.sleep(0.02)
