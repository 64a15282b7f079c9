"""Somebody who does not go by the router: a peer that looks for others, waits for them, and says what it can."""

from __future__ import annotations

import asyncio
import contextlib
import json
import threading
from collections.abc import AsyncIterator
from pathlib import Path

import zenoh

from paani.bus.session import client_config
from paani.config import BusConfig
from tests.conftest import find_free_port
from tests.integration.exposure import sockets_of

EVERYBODY = {"router": ["router", "peer", "client"], "peer": ["router", "peer", "client"]}
ESTABLISHED = "01"


class Stranger:
    """A Zenoh peer that listens, announces itself by multicast and gossip, and connects to all that it is told of.

    `heard`: names of the keys of this vessel on which somebody else put something.
    """

    def __init__(self, session: zenoh.Session, port: int, prefix: str) -> None:
        self.port, self.heard = port, list[str]()
        self._session, self._prefix = session, prefix

        def take(sample: zenoh.Sample) -> None:
            self.heard.append(str(sample.key_expr).removeprefix(f"{prefix}/"))

        hear = zenoh.handlers.Callback(take, indirect=False)
        self._ears = [
            session.declare_subscriber(key, hear, allowed_origin=zenoh.Locality.REMOTE)
            for key in (f"{prefix}/**", f"{prefix}/@truth/**")
        ]

    @property
    def id(self) -> str:
        return str(self._session.info.zid())

    def peers(self) -> set[str]:
        """Ids of whoever has a session with it and is no router."""
        return {str(each) for each in self._session.info.peers_zid()}

    def routers(self) -> set[str]:
        return {str(each) for each in self._session.info.routers_zid()}

    def say(self, name: str, data: bytes) -> None:
        """Put on a key of the vessel."""
        self._session.put(f"{self._prefix}/{name}", data, congestion_control=zenoh.CongestionControl.BLOCK)


@contextlib.asynccontextmanager
async def stranger(config: BusConfig, user: str | None) -> AsyncIterator[Stranger]:
    """A peer of no boat; with a user, it has that user's credentials and joins the router as well."""
    port = find_free_port()
    session = await asyncio.to_thread(_open, config, user, port)
    try:
        yield Stranger(session, port, f"paani/{config.domain}/{config.vessel}")
    finally:
        await asyncio.to_thread(session.close)


def _open(config: BusConfig, user: str | None, port: int) -> zenoh.Session:
    settings = zenoh.Config() if user is None else client_config(config, user)
    changes: dict[str, object] = {
        "mode": "peer",
        "listen/endpoints": [f"tcp/127.0.0.1:{port}"],
        "scouting/multicast/enabled": True,
        "scouting/multicast/autoconnect": EVERYBODY,
        "scouting/gossip/enabled": True,
        "scouting/gossip/multihop": True,
        "scouting/gossip/autoconnect": EVERYBODY,
    }
    for path, value in changes.items():
        settings.insert_json5(path, json.dumps(value))
    return zenoh.open(settings)


def scouted(seconds: float) -> set[str]:
    """Ids of all that answer who is there, by multicast."""
    found: set[str] = set()
    scout = zenoh.scout(what="router|peer|client")
    try:
        threading.Event().wait(seconds)
        while (hello := scout.try_recv()) is not None:
            found.add(str(hello.zid))
    finally:
        scout.stop()  # type: ignore[no-untyped-call]  # zenoh's stubs
    return found


def connections_to(pid: int, port: int) -> int:
    """TCP connections that a process has with this port of its machine."""
    found = 0
    inodes = sockets_of(pid)
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text(encoding="ascii").splitlines()[1:]:
            words = line.split()
            remote = int(words[2].rpartition(":")[2], 16)
            found += words[3] == ESTABLISHED and words[9] in inodes and remote == port
    return found
