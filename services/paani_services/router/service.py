"""Router process: relays between this machine's services, enforces who may write what, and joins board and host."""

from __future__ import annotations

import asyncio

from paani import keys
from paani.bus import Bus
from paani.clock import Clock
from paani.config import Config
from paani.sides import Side
from paani_services.router.picture_exchange import connected_to_board, exchange_pictures
from paani_services.router.route_watch import WATCHED, watch_route


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Report health; the listening session is opened before, by `paani.process`.

    A host's exchanges pictures with its board as well. It ends, to be started again, where the board is heard on that
    connection and not through the routers: whoever listens behind them would wait for ever.
    """
    with bus.alive():
        if config.bus.side is not Side.HOST:
            await asyncio.Event().wait()
        pulse = keys.pulse(WATCHED)
        async with connected_to_board(config.bus, clock) as board, asyncio.TaskGroup() as tasks:
            tasks.create_task(exchange_pictures(bus, board, config.bus.graph))
            tasks.create_task(watch_route(board.latest(pulse), bus.latest(pulse)))
