"""How every service starts and stops."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from importlib.metadata import entry_points

from paani.bus import Bus, open_bus
from paani.bus.routing import open_router
from paani.clock import Clock, WallClock
from paani.config import Config
from paani.errors import UserError
from paani.log_limit import LogLimit

Service = Callable[[Bus, Clock, Config], Awaitable[None]]
ROUTER = "router"


def services() -> dict[str, Callable[[], Service]]:
    """Every installed service by name, loaded when called."""
    return {point.name: point.load for point in entry_points(group="paani.services")}


def run_service(name: str, config: Config) -> int:
    """Run one service until it ends or is told to stop. Exit codes: 0 stopped, 2 user's mistake, 1 crash."""
    handler = logging.StreamHandler(sys.stderr)
    handler.addFilter(LogLimit())
    logging.basicConfig(handlers=[handler], level=logging.INFO, format=f"%(asctime)s {name} %(levelname)s %(message)s")
    try:
        asyncio.run(_serve(name, services()[name](), config))
    except UserError as error:
        sys.stderr.write(f"paani {name}: {error}\n")
        return 2
    except KeyboardInterrupt:
        pass
    return 0


async def _serve(name: str, service: Service, config: Config) -> None:
    clock = WallClock()
    task = asyncio.current_task()
    assert task is not None
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, task.cancel)
    with contextlib.suppress(asyncio.CancelledError):
        async with _bus(name, config, clock) as bus:
            await service(bus, clock, config)


@contextlib.asynccontextmanager
async def _bus(name: str, config: Config, clock: Clock) -> AsyncIterator[Bus]:
    router = await open_router(config.bus) if name == ROUTER else None
    bus = await open_bus(config.bus, name, clock)
    try:
        yield bus
    finally:
        await bus.close()
        if router is not None:
            await asyncio.to_thread(router.close)
