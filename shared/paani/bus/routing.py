"""The router session: listens, authenticates, enforces the authority table, and joins a boat's board and its host."""

from __future__ import annotations

import asyncio
import errno
import socket

import zenoh

from paani.authority import USERS_FILE, access_control, board_router_id, ensure_credentials, password_of
from paani.bus.session import RETRY, shared_settings, zenoh_config
from paani.certificates import endpoint, router_settings
from paani.config import BusConfig
from paani.errors import UserError
from paani.link_access import LINK
from paani.port_address import parse_endpoint
from paani.sides import ROUTER, Side

# An attempt to connect that takes longer is begun again: TCP itself waits ever longer, 7 s after a cut of 10 s.
LINK_OPEN_MS = 2000
ACCEPT_MS, MAX_PENDING = 1000, 1000


def router_config(config: BusConfig) -> zenoh.Config:
    """A router that denies by default. The board's also listens at the link, where the host's connects as `LINK`."""
    return zenoh_config(
        {
            "mode": "router",
            "listen/endpoints": listening(config),
            **_identity(config),
            "access_control": access_control(config),
            # Strangers that connect and say nothing are dropped soon, and do not keep others waiting meanwhile.
            "transport/unicast/accept_timeout": ACCEPT_MS,
            "transport/unicast/accept_pending": MAX_PENDING,
            **_link_settings(config),
            **shared_settings(config),
        }
    )


def listening(config: BusConfig) -> list[str]:
    """Endpoints at which this side's router listens."""
    return [endpoint(config, address) for address in _doors(config).values()]


def _doors(config: BusConfig) -> dict[str, str]:
    """Where this side's router listens, by the setting."""
    doors = {"bus.router": config.router}
    if config.side is Side.BOARD:
        doors["bus.link"] = config.link
    if config.shore and config.side is not Side.HOST:
        doors["bus.shore"] = config.shore
    return doors


def _identity(config: BusConfig) -> dict[str, object]:
    """How the router knows others, and who it is to the other side's: by certificates or by passwords."""
    credentials = ensure_credentials(config)
    if config.certificates:
        return router_settings(config, LINK if config.side is Side.HOST else None)
    user = LINK if config.side is Side.HOST else ROUTER
    return {
        "transport/auth/usrpwd/user": user,
        "transport/auth/usrpwd/password": password_of(config, user),
        "transport/auth/usrpwd/dictionary_file": str(credentials / USERS_FILE),
    }


def _link_settings(config: BusConfig) -> dict[str, object]:
    """The board's router is known by its id; the host's goes on trying to reach it, from the start and after a cut."""
    match config.side:
        case Side.BOARD:
            return {} if config.certificates else {"id": board_router_id(config)}
        case Side.HOST:
            return {
                "connect/endpoints": [endpoint(config, config.link)],
                "connect/timeout_ms": -1,
                "connect/exit_on_failure": False,
                "connect/retry": RETRY,
                "transport/unicast/open_timeout": LINK_OPEN_MS,
            }
        case _:
            return {}


async def open_router(config: BusConfig) -> zenoh.Session:
    """Start listening. Raises UserError when an address is taken or wrong."""
    require_addresses(config)
    try:
        return await asyncio.to_thread(lambda: zenoh.open(router_config(config)))
    except zenoh.ZError as error:
        raise UserError(f"bus.router {', '.join(listening(config))}: {error}") from error


def require_addresses(config: BusConfig) -> None:
    """Raises UserError unless this side's router can listen where it is to, and has a link to the other side."""
    if config.side is not Side.BOTH and not config.link:
        raise UserError(
            f"bus.link: not set (board and host meet at tcp/ADDRESS:PORT of the board; this is the {config.side})"
        )
    for name, address in (("bus.router", config.router), ("bus.link", config.link), ("bus.shore", config.shore)):
        if address.startswith("tls/") and not config.certificates:
            raise UserError(f"{name} {address}: needs certificates (`paani certs make`, then bus.certificates)")
    for name, address in _doors(config).items():
        require_free(name, endpoint(config, address))


def require_free(name: str, address: str) -> None:
    """Raises UserError naming the setting where nothing can listen at the address."""
    _, host, port = parse_endpoint(address)
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                raise UserError(
                    f"{name} {address}: in use by another program, perhaps another `paani up`: stop that, or "
                    f"choose another port (--set {name}={address.rpartition(':')[0]}:{port + 1})"
                ) from error
            raise UserError(f"{name} {address}: {error}") from error
