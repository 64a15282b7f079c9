"""Messages of one topic as they arrive, for tools that only look."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Any

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import Bus, Latest, open_bus
from paani.clock import WallClock
from paani.config import BusConfig
from paani.errors import UserError
from paani.port_address import parse_endpoint

CONNECT_S = 1.0
DEPTH = 1024


async def is_up(config: BusConfig) -> bool:
    """Whether something listens at `bus.router`."""
    _, host, port = parse_endpoint(config.router)
    try:
        async with asyncio.timeout(CONNECT_S):
            _, writer = await asyncio.open_connection(host, port)
    except OSError:
        return False
    writer.close()
    with contextlib.suppress(OSError):
        await writer.wait_closed()
    return True


@contextlib.asynccontextmanager
async def observer(config: BusConfig) -> AsyncIterator[Bus]:
    """A bus that reads everything and writes nothing. Raises UserError when there is no router."""
    if not await is_up(config):
        raise UserError(f"bus.router {config.router}: nothing listens there (`paani up` starts it)")
    bus = await open_bus(config, OBSERVER, WallClock())
    try:
        yield bus
    finally:
        await bus.close()


async def messages(bus: Bus, topic: keys.Topic[Any]) -> AsyncIterator[m.Message]:
    """Every message from now on; of pictures the headers, pulled."""
    if topic.stance is keys.Stance.PICTURE:
        pictures = bus.pull_picture(topic)
        while True:
            yield (await pictures.next()).header
    queue = bus.queue(topic, DEPTH)
    while True:
        yield await queue.get()


async def rates(bus: Bus, seconds: float) -> dict[str, float]:
    """Messages a second of every topic of the table, counted over `seconds`; of pictures only what is pushed."""
    inboxes = {topic.name: _count(bus, topic) for topic in keys.TOPICS}
    await asyncio.sleep(seconds)
    return {name: inbox.received / seconds for name, inbox in inboxes.items()}


def _count(bus: Bus, topic: keys.Topic[Any]) -> Latest[Any]:
    return bus.latest_picture(topic) if topic.stance is keys.Stance.PICTURE else bus.latest(topic)
