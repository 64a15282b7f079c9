"""Pictures between a boat's board and its host: pulled one at a time, on a connection that carries nothing else.

The host asks the board for its pictures and hands them out at home as if they had been made there, and it offers its
own to the board. Whoever subscribes to pictures, on either side, knows nothing of the other. At most one picture of a
topic is under way, so what decides and what stops the boat never waits behind pictures in the sockets of the link.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from typing import Protocol

from msgspec.structs import replace

from paani import messages as m
from paani.bus import Bus, Picture, open_bus
from paani.clock import Clock
from paani.config import BusConfig
from paani.keys import Graph
from paani.link_access import LINK
from paani.sides import Side, pictures_sent

WATCH_PERIOD_S = 0.2


class PictureInput(Protocol):
    """Pictures to be had one at a time."""

    async def next(self) -> Picture:
        """The newest that was not returned before; waits for one."""
        ...


class PictureOutput(Protocol):
    """Where pictures are handed on."""

    def is_watched(self) -> bool:
        """Whether anybody subscribes or has asked lately."""
        ...

    def forward_picture(self, header: m.PictureHeader, data: bytes) -> None:
        """Hand on one picture with its header as it is."""
        ...


@contextlib.asynccontextmanager
async def connected_to_board(config: BusConfig, clock: Clock) -> AsyncIterator[Bus]:
    """A connection to the board's router beside that of the host's router; waits for the board as long as it takes."""
    board = await open_bus(replace(config, router=config.link), LINK, clock)
    try:
        yield board
    finally:
        await board.close()


async def exchange_pictures(host: Bus, board: Bus, graph: Graph) -> None:
    """Pull and offer until cancelled."""
    async with asyncio.TaskGroup() as group:
        for topic in pictures_sent(Side.BOARD, graph):
            group.create_task(forward_pictures(board.pull_picture(topic), host.picture_publisher(topic)))
        for topic in pictures_sent(Side.HOST, graph):
            offered = board.picture_publisher(topic, push=False)
            group.create_task(forward_pictures(host.pull_picture(topic), offered))


async def forward_pictures(pictures: PictureInput, output: PictureOutput) -> None:
    """Hand on the newest picture, again and again, while somebody wants it."""
    while True:
        if output.is_watched():
            picture = await pictures.next()
            output.forward_picture(picture.header, picture.data)
        else:
            await asyncio.sleep(WATCH_PERIOD_S)
