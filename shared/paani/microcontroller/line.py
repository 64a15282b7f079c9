"""The three ways to the microcontroller: a serial device, a socket, and the board's router."""

from __future__ import annotations

import asyncio

from paani.port_address import UNIX, is_router, require_line
from paani.serial_port import CONNECT_TIMEOUT_S, Port, PortError, StreamPort, describe, open_port


async def open_line(address: str) -> Port:
    """Open the line. Raises ValueError for what is no address, PortError for what is not to be had."""
    require_line(address)
    if not is_router(address):
        return await open_port(address)
    loop = asyncio.get_running_loop()
    try:
        async with asyncio.timeout(CONNECT_TIMEOUT_S):
            _, stream = await loop.create_unix_connection(lambda: StreamPort(address), address.removeprefix(UNIX))
    except TimeoutError as error:
        raise PortError(f"{address}: no answer") from error
    except OSError as error:
        raise PortError(f"{address}: {describe(error)}") from error
    return stream
