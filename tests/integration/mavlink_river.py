"""A drive on the simulated river with the MAVLink port, for stations that others wrote."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import TypeVar

from paani.config import Config, load_config
from paani_services.operator.latch import LATCH_FILE
from paani_services.operator.state import CLEAR
from tests.conftest import find_free_port
from tests.integration.test_up import READY_S, Up, words_of

LINK_LOSS_S = 3.0
T = TypeVar("T")


class River:
    """`paani up --with mavlink`: in order, not armed, no STOP."""

    def __init__(self, folder: Path) -> None:
        self.udp, self.tcp = find_free_port(), find_free_port()
        self.sets = (
            f"bus.router=tcp/127.0.0.1:{find_free_port()}",
            f"bus.runtime_dir={folder / 'runtime'}",
            f"dashboard.port={find_free_port()}",
            f"mavlink.udp=127.0.0.1:{self.udp}",
            f"mavlink.tcp=127.0.0.1:{self.tcp}",
            f"mavlink.link_loss_s={LINK_LOSS_S}",
            "up.arm_at_start=false",
        )
        self.config: Config = load_config(sets=self.sets)
        (folder / "runtime").mkdir(mode=0o700)
        (folder / "runtime" / LATCH_FILE).write_text(CLEAR)
        self.up = Up(folder, *words_of(self.sets, "--with", "mavlink"))

    @property
    def page(self) -> str:
        """Its page."""
        return f"http://127.0.0.1:{self.config.dashboard.port}"


@contextlib.contextmanager
def river_in(folder: Path) -> Iterator[River]:
    """The drive, begun; a dirty exit fails."""
    started = River(folder)
    try:
        started.up.until(lambda: "http://127.0.0.1:" in started.up.out, READY_S)
        yield started
    finally:
        started.up.process.send_signal(signal.SIGINT)
        assert started.up.process.wait(20.0) == 0


async def until(read: Callable[[], Awaitable[T]], is_reached: Callable[[T], bool], limit_s: float = 20.0) -> T:
    """The first message for which that holds; fails after `limit_s`. read: `next` of an inbox."""
    async with asyncio.timeout(limit_s):
        while not is_reached(value := await read()):
            pass
    return value
