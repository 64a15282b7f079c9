"""Router process: relays between this machine's services, enforces who may write what, and joins board and host."""

from __future__ import annotations

import asyncio

from paani.bus import Bus
from paani.clock import Clock
from paani.config import Config
from paani.sides import Side
from paani_services.router.picture_exchange import exchange_pictures


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Report health, and exchange pictures on a host; the listening session is opened before, by `paani.process`."""
    with bus.alive():
        if config.bus.side is Side.HOST:
            await exchange_pictures(bus, config.bus, clock)
        await asyncio.Event().wait()
