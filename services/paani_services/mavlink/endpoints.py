"""UDP and TCP links to ground stations. Each has its own frames: numbers, signatures, damage."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import itertools
import logging
from collections.abc import Callable
from typing import Any

from paani.clock import Clock, steady_beside
from paani.config import MavlinkConfig
from paani.errors import UserError
from paani.port_address import is_loopback, tcp_address
from paani_services.mavlink.codec import Codec
from paani_services.mavlink.gateway import Gateway
from paani_services.mavlink.signing import Signer
from paani_services.mavlink.station import Station

LOG = logging.getLogger(__name__)
MAX_UNREAD_BYTES = 65_536  # ten seconds of telemetry: whoever has not read it is not there
CHUNK_BYTES = 4096
SILENT_S = 5.0  # five heartbeats: a station that says nothing keeps no other out
BROWSER_WORDS = (b"GET ", b"POST ", b"HEAD ", b"OPTIONS ")  # a page of any site reaches the ports of its own machine
PAUSE_S = 0.1  # before the next chunk is read, after one that came too fast and was thrown away


class UdpLink(asyncio.DatagramProtocol):
    """To one station at its address, from where alone anything is taken."""

    def __init__(self) -> None:
        self.receive: Callable[[bytes], object] | None = None
        self._transport: Any = None  # of the event loop, whose buffer is not part of its published type

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport

    def datagram_received(self, data: bytes, addr: tuple[object, ...]) -> None:  # it is connected
        if self.receive is not None:
            self.receive(data)

    def error_received(self, exc: Exception) -> None:
        """Nobody listens there, or not yet."""
        LOG.debug("UDP: %s", exc)

    def write(self, data: bytes) -> None:
        """One frame, which is lost where the socket's buffer is full."""
        if self._transport is not None and self.unsent_bytes() <= MAX_UNREAD_BYTES:
            self._transport.sendto(data)

    def unsent_bytes(self) -> int:
        return 0 if self._transport is None else self._transport.get_write_buffer_size()

    @property
    def own_host(self) -> str:
        """Our end of it."""
        return "" if self._transport is None else str(self._transport.get_extra_info("sockname")[0])

    def close(self) -> None:
        if self._transport is not None:
            self._transport.abort()


class Endpoints:
    """All links of this process; the gateway answers on each."""

    def __init__(self, gateway: Gateway, settings: MavlinkConfig, signer: Signer | None, clock: Clock) -> None:
        self._gateway, self._settings, self._signer, self._clock = gateway, settings, signer, clock
        self._link_ids = itertools.count()
        self._udp: list[UdpLink] = []
        self._steady = steady_beside(clock)
        self._heard_us = dict[asyncio.StreamWriter, int]()  # when each connection last said something
        self._server: asyncio.Server | None = None

    async def open(self) -> None:
        """Raises UserError that names the setting whose address cannot be had."""
        loop = asyncio.get_running_loop()
        for host, port in self._settings.udp_addresses:
            try:
                _, link = await loop.create_datagram_endpoint(UdpLink, remote_addr=(host, port))
            except OSError as error:
                raise UserError(f"mavlink.udp {host}:{port}: {error.strerror}") from error
            station = self._add(f"udp {host}:{port}", link.write, link.unsent_bytes, host, link.own_host)
            link.receive = functools.partial(self._receive, station)
            self._udp.append(link)
        if self._settings.tcp:
            host, port = tcp_address(self._settings.tcp)
            try:
                self._server = await asyncio.start_server(self._serve, host, port)
            except OSError as error:
                raise UserError(f"mavlink.tcp {self._settings.tcp}: {error.strerror}") from error

    def close(self) -> None:
        """End every link."""
        if self._server is not None:
            self._server.close()
        for writer in tuple(self._heard_us):
            writer.transport.abort()
        for link in self._udp:
            link.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One connection, to its end."""
        with contextlib.closing(writer), contextlib.suppress(OSError):
            if len(self._heard_us) >= self._settings.max_clients and not self._let_silent_go():
                return
            self._heard_us[writer] = self._steady.now_us()
            address = writer.get_extra_info("peername")
            unsent_bytes = writer.transport.get_write_buffer_size
            station = self._add(
                f"tcp {address[0]}:{address[1]}", lambda data: _write(writer, data), unsent_bytes, address[0],
                writer.get_extra_info("sockname")[0],
            )  # fmt: skip
            try:
                while data := await reader.read(CHUNK_BYTES):
                    if data.startswith(BROWSER_WORDS):
                        return
                    self._heard_us[writer] = self._steady.now_us()
                    if not self._gateway.receive(station, data, self._clock.now_us()):
                        await asyncio.sleep(PAUSE_S)
            finally:
                self._gateway.remove(station)
                self._heard_us.pop(writer, None)

    def _let_silent_go(self) -> bool:
        """Whether a place was made: that of who is silent for longest, whose link may be lost and nobody notice."""
        writer, heard_us = min(self._heard_us.items(), key=lambda each: each[1])
        if self._steady.now_us() - heard_us <= SILENT_S * 1e6:
            return False
        del self._heard_us[writer]
        writer.transport.abort()
        return True

    def _receive(self, station: Station, data: bytes) -> None:
        self._gateway.receive(station, data, self._clock.now_us())

    def _add(
        self, name: str, write: Callable[[bytes], None], unsent_bytes: Callable[[], int], host: str, own_host: str
    ) -> Station:
        codec = Codec(next(self._link_ids), self._signer)
        station = Station(name, codec, write, unsent_bytes, is_local=is_loopback(host), own_host=own_host)
        self._gateway.stations.append(station)
        return station


def _write(writer: asyncio.StreamWriter, data: bytes) -> None:
    """Without waiting; a station that does not read is let go."""
    if writer.transport.is_closing():
        return
    if writer.transport.get_write_buffer_size() > MAX_UNREAD_BYTES:
        writer.transport.abort()
    else:
        writer.write(data)
