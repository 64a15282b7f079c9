"""Router process: relays between this machine's services and enforces who may write what."""

from __future__ import annotations

import asyncio

from paani.bus import Bus
from paani.clock import Clock
from paani.config import Config


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Report health; the listening session itself is opened before the bus, by `paani.process`."""
    with bus.alive():
        await asyncio.Event().wait()
