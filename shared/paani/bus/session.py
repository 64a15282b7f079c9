"""Opening a Zenoh session off the event loop, as a client of the local router."""

from __future__ import annotations

import asyncio
import json
import logging

import zenoh

from paani.authority import password_of, require_place
from paani.certificates import client_settings, endpoint
from paani.config import BusConfig
from paani.port_address import parse_endpoint

LOG = logging.getLogger(__name__)
RETRY = {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5}
REACH_S = 1.0
MAX_BYTES = 32 << 20  # of anything that a peer sends, twice the largest picture; Zenoh alone would take a gigabyte


def client_config(config: BusConfig, user: str) -> zenoh.Config:
    """A client that speaks to one router and to nobody else."""
    settings: dict[str, object] = {
        "mode": "client",
        "connect/endpoints": [endpoint(config, config.router)],
        "connect/timeout_ms": 2000,
        "connect/retry": RETRY,
        **_identity(config, user),
        **shared_settings(config),
    }
    return zenoh_config(settings)


def _identity(config: BusConfig, user: str) -> dict[str, object]:
    """Who this client is, by certificate or by password. Raises UserError."""
    require_place(config, user)
    if config.certificates:
        return client_settings(config, user)
    return {"transport/auth/usrpwd/user": user, "transport/auth/usrpwd/password": password_of(config, user)}


def shared_settings(config: BusConfig) -> dict[str, object]:
    """Transport settings that are safety settings: a silent link is torn down within the lease."""
    return {
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        "transport/link/tx/lease": config.lease_ms,
        "transport/link/tx/keep_alive": 4,
        # Each express message takes a whole batch: with Zenoh's 2, a busy machine lost up to 15 % of commands sent in
        # pairs; with 16, its most, under 0.4 %.
        "transport/link/tx/queue/size/real_time": 16,
        "transport/shared_memory/enabled": False,
        "transport/link/rx/max_message_size": MAX_BYTES,
    }


def zenoh_config(settings: dict[str, object]) -> zenoh.Config:
    result = zenoh.Config()
    for path, value in settings.items():
        result.insert_json5(path, json.dumps(value))
    return result


async def open_client(config: BusConfig, user: str) -> zenoh.Session:
    """Open a session; waits for the router as long as it takes, and says once what it waits for."""
    problem = ""
    while True:
        try:
            return await asyncio.to_thread(lambda: zenoh.open(client_config(config, user)))
        except zenoh.ZError:
            was, problem = problem, await _reach(config)
            if problem != was:
                LOG.warning("the router at %s %s (user %s); waiting", config.router, problem, user)
            await asyncio.sleep(0.1)


async def _reach(config: BusConfig) -> str:
    """Why no session was opened: Zenoh itself does not tell."""
    _, host, port = parse_endpoint(config.router)
    try:
        async with asyncio.timeout(REACH_S):
            _, writer = await asyncio.open_connection(host, port)
    except (OSError, TimeoutError):
        return "does not answer"
    writer.close()
    return f"lets nobody in by these credentials, which are of a {config.graph} (--profile says of what)"
