"""The router session: listens, authenticates, and enforces the authority table."""

from __future__ import annotations

import asyncio
import errno
import socket

import zenoh

from paani.authority import USERS_FILE, access_control, ensure_credentials, password_of
from paani.bus.session import shared_settings, zenoh_config
from paani.config import BusConfig
from paani.errors import UserError


def router_config(config: BusConfig) -> zenoh.Config:
    """A router that denies by default."""
    credentials = ensure_credentials(config)
    return zenoh_config(
        {
            "mode": "router",
            "listen/endpoints": [config.router],
            "transport/auth/usrpwd/user": "router",
            "transport/auth/usrpwd/password": password_of(config, "router"),
            "transport/auth/usrpwd/dictionary_file": str(credentials / USERS_FILE),
            "access_control": access_control(config),
            **shared_settings(config),
        }
    )


async def open_router(config: BusConfig) -> zenoh.Session:
    """Start listening on `bus.router`. Raises UserError when the address is taken or wrong."""
    require_free(config.router)
    try:
        return await asyncio.to_thread(lambda: zenoh.open(router_config(config)))
    except zenoh.ZError as error:
        raise UserError(f"bus.router {config.router}: {error}") from error


def require_free(endpoint: str) -> None:
    """Raises UserError unless `tcp/<host>:<port>` can be bound."""
    scheme, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    if scheme not in {"tcp", "tls"} or not host or not port.isdecimal():
        raise UserError(f"bus.router {endpoint}: expected tcp/<host>:<port>")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, int(port)))
        except (OSError, OverflowError) as error:
            if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
                raise UserError(
                    f"bus.router {endpoint}: in use by another program, perhaps another `paani up`: stop that, or "
                    f"choose another port (--set bus.router={scheme}/{host}:{int(port) + 1})"
                ) from error
            raise UserError(f"bus.router {endpoint}: {error}") from error
