"""Says whether the other machine of board and host is there."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable

from paani.bus import Bus
from paani.config import BusConfig
from paani.sides import services_on

PATIENCE_S = 3.0


async def report_other_side(bus: Bus, config: BusConfig, say: Callable[[str], None]) -> None:
    """A line when processes of the other side are first heard, when the last is gone, and where none comes."""
    other = config.side.other
    theirs, alive = set(services_on(other, config.graph)) - set(services_on(config.side, config.graph)), set[str]()
    was_there = asyncio.Event()

    async def say_if_absent() -> None:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(PATIENCE_S):
                await was_there.wait()
        if not was_there.is_set():
            say(f"waiting for the {other} (bus.link {config.link}; `paani up --only {other}` there)")

    async with asyncio.TaskGroup() as group:
        group.create_task(say_if_absent())
        async for service, is_alive in bus.alive_events():
            if service not in theirs:
                continue
            before = bool(alive)
            alive = alive | {service} if is_alive else alive - {service}
            was_there.set()
            if bool(alive) is not before:
                say(f"the {other} is there" if alive else f"the {other} is gone; waiting for it")
