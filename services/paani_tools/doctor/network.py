"""Where the router and the page listen: free, or taken by whom."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Iterator
from http.client import HTTPException

from paani.bus.routing import require_addresses
from paani.config import BusConfig, Config
from paani.errors import UserError
from paani.page_address import LOGIN_PATH, is_page_exposed
from paani.page_connection import connect_to_page
from paani.port_address import parse_endpoint
from paani.sides import Side
from paani_tools.doctor.finding import Verdict, failed, passed, warned
from paani_tools.inspect.listen import observer

REACH_S = 2.0
ENTER_S = 5.0  # a router on a busy machine takes a second
PAGE_MARK = b"<title>PAANI</title>"


def check_router(config: Config) -> Iterator[Verdict]:
    """Free for a router, or one is running that lets us in; and the other side, if there is one."""
    bus = config.bus
    try:
        require_addresses(bus)
    except UserError as error:
        if asyncio.run(_lets_us_in(bus)):
            yield passed(f"{bus.router}: a router is running and lets us in")
        else:
            yield failed(str(error))
    else:
        yield passed(f"{bus.router}: free")
    if bus.side is Side.HOST and bus.link:
        if _is_connected(bus.link):
            yield passed(f"bus.link {bus.link}: the board answers")
        else:
            yield warned(f"bus.link {bus.link}: the board does not answer", "start the board; the host waits for it")


async def _lets_us_in(bus: BusConfig) -> bool:
    """Whether a router is there and takes our credentials; other programs take neither."""
    try:
        async with asyncio.timeout(ENTER_S), observer(bus):
            return True
    except (UserError, TimeoutError):
        return False


def _is_connected(endpoint: str) -> bool:
    _, host, port = parse_endpoint(endpoint)
    with contextlib.suppress(OSError), socket.create_connection((host, port), REACH_S):
        return True
    return False


def check_page(config: Config) -> Iterator[Verdict]:
    """Free for the page, or a page of PAANI is there already."""
    page = config.dashboard
    if not page.serve or "dashboard" not in config.services:
        yield passed("not served here")
        return
    address = f"dashboard.port {page.host}:{page.port}"
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((page.host, page.port))
        except OSError as error:
            if _shows_page(config):
                yield passed(f"{address}: a page of PAANI is served there")
            else:
                yield failed(f"{address}: {error.strerror}", "stop that program, or --set dashboard.port=...")
            return
    yield passed(f"{address}: free")


def _shows_page(config: Config) -> bool:
    try:
        connection = connect_to_page(config, REACH_S)
        with contextlib.closing(connection):
            connection.request("GET", LOGIN_PATH if is_page_exposed(config) else "/")
            return PAGE_MARK in connection.getresponse().read(1 << 16)
    except (OSError, HTTPException, UserError):
        return False
