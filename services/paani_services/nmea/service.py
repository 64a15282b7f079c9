"""NMEA 0183 port: what the boat estimates of itself and sees move, to every plotter that connects."""

from __future__ import annotations

import asyncio
import contextlib
import logging

from paani import keys
from paani.bus import Bus
from paani.clock import Clock
from paani.config import Config
from paani.errors import UserError
from paani.port_address import tcp_address
from paani_services.nmea.sentences import position_sentences, target_sentences

LOG = logging.getLogger(__name__)
MAX_UNREAD_BYTES = 65_536  # half a minute of sentences: whoever has not read them is not there
CHUNK = 4096


class Plotters:
    """Whoever is connected. What they send is read and thrown away: a port of this kind takes no commands."""

    def __init__(self, max_clients: int) -> None:
        self._max_clients = max_clients
        self._writers = set[asyncio.StreamWriter]()

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One connection, to its end."""
        with contextlib.closing(writer), contextlib.suppress(OSError):
            if len(self._writers) < self._max_clients:
                self._writers.add(writer)
                while await reader.read(CHUNK):
                    pass
        self._writers.discard(writer)

    def send(self, data: bytes) -> None:
        """To each, without waiting; one that does not read is let go."""
        for writer in tuple(self._writers):
            if writer.transport.get_write_buffer_size() > MAX_UNREAD_BYTES:
                self._writers.discard(writer)
                writer.transport.abort()
            else:
                writer.write(data)

    def close(self) -> None:
        """End every connection."""
        for writer in tuple(self._writers):
            writer.transport.abort()


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Send until told to stop. Raises UserError where the address cannot be had."""
    settings = config.nmea
    host, port = tcp_address(settings.listen)
    odometry, prediction = bus.latest(keys.ODOMETRY), bus.latest(keys.PREDICTION)
    plotters = Plotters(settings.max_clients)
    try:
        server = await asyncio.start_server(plotters.serve, host, port)
    except OSError as error:
        raise UserError(f"nmea.listen {settings.listen}: {error.strerror}") from error
    try:
        with bus.alive():
            LOG.info("NMEA 0183 for plotters at tcp://%s", settings.listen)
            while True:
                own = odometry.fresh(keys.ODOMETRY.fresh_s)
                others = prediction.fresh(keys.PREDICTION.fresh_s)
                plotters.send("".join((*position_sentences(own), *target_sentences(own, others))).encode("ascii"))
                await asyncio.sleep(1.0 / settings.rate_hz)
    finally:
        server.close()
        plotters.close()
