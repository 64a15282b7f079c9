"""Foxglove port: the bus to the viewers. It writes nothing on the bus but its health."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

from paani import keys
from paani.bus import Bus, Latest, Picture, Queue
from paani.clock import Clock
from paani.config import Config, FoxgloveConfig
from paani.errors import UserError
from paani.extras import require_modules
from paani_services.foxglove.channels import MASK, channels, forwarded_topics
from paani_services.foxglove.parameters import parameters
from paani_services.foxglove.relay import Relay

if TYPE_CHECKING:
    from paani_services.foxglove.server import ViewerServer

LOG = logging.getLogger(__name__)
LAYOUT_FILE = Path(__file__).with_name("layout.json")
REPORT_PERIOD_S = 1.0
WATCH_PERIOD_S = 0.2  # how soon masks are pulled once somebody wants them


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Serve until told to stop. Raises UserError for an address or a certificate that cannot be had."""
    require_modules("the port foxglove", "foxglove")
    server = await start(config)
    relay = Relay(config, lambda name, data: server.send(name, data, clock.now_us()), server.is_watched, bus.count_drop)
    try:
        queues = [(topic, bus.queue(topic)) for topic in forwarded_topics(bus.graph)]
        pictures, masks = bus.latest_picture(keys.PICTURE), bus.pull_picture(keys.MASK)
        with bus.alive():
            scheme = "wss" if config.foxglove.tls_pem else "ws"
            LOG.info(
                "viewers at %s://%s:%d; layout: %s", scheme, config.foxglove.host, config.foxglove.port, LAYOUT_FILE
            )
            async with asyncio.TaskGroup() as tasks:
                for topic, inbox in queues:
                    tasks.create_task(forward(relay, topic, inbox))
                tasks.create_task(forward_pictures(relay, pictures))
                tasks.create_task(forward_masks(relay, server, masks))
                tasks.create_task(report(bus, server))
    finally:
        await asyncio.to_thread(server.stop)


async def start(config: Config) -> ViewerServer:
    """The server, once it listens."""
    from paani_services.foxglove.server import ViewerServer  # noqa: PLC0415  # of an extra

    tls_pem = await asyncio.to_thread(read_pem, config.foxglove)
    name, offered = f"PAANI {config.bus.vessel}", channels(config.bus.graph)
    return await asyncio.to_thread(ViewerServer, config.foxglove, name, offered, parameters(config), tls_pem)


def read_pem(config: FoxgloveConfig) -> bytes | None:
    """None where none is set. Raises UserError naming the file that cannot be read."""
    if not config.tls_pem:
        return None
    try:
        return Path(config.tls_pem).read_bytes()
    except OSError as error:
        raise UserError(f"foxglove.tls_pem {config.tls_pem}: {error.strerror}") from error


async def forward(relay: Relay, topic: keys.Topic[Any], inbox: Queue[Any]) -> None:
    while True:
        relay.take(topic, await inbox.get())


async def forward_pictures(relay: Relay, inbox: Latest[Picture]) -> None:
    while True:
        relay.take_picture(await inbox.next())


async def forward_masks(relay: Relay, server: ViewerServer, inbox: Latest[Picture]) -> None:
    """Pull masks while somebody watches them, so that none travels for nobody."""
    while True:
        if server.is_watched(MASK):
            relay.take_mask(await inbox.next())
        else:
            await asyncio.sleep(WATCH_PERIOD_S)


async def report(bus: Bus, server: ViewerServer) -> None:
    """Hand what viewers were refused to the health report."""
    while True:
        for cause, n in server.refusals.take().items():
            bus.count_drop(cause, n)
        bus.note(f"{server.watched} channels watched")
        await asyncio.sleep(REPORT_PERIOD_S)
