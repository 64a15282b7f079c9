"""Serves the camera's pictures to players by RTSP."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
from collections.abc import Callable

from paani.bus import PulledPicture
from paani.config import MavlinkConfig
from paani.errors import UserError
from paani.port_address import tcp_address
from paani_services.mavlink import rtsp
from paani_services.mavlink.rtp_jpeg import Scan, packets, parse_scan

LOG = logging.getLogger(__name__)
CHUNK_BYTES = 4096
MAX_UNSENT_BYTES = 262_144  # a few pictures: a player that is behind by more misses the next
SILENT_S = 30.0  # for which a player may ask for nothing before it plays
WATCH_PERIOD_S = 0.2  # a new player waits at most so long for its first picture
LET_GO_S = 10.0  # after which a player that reads nothing is gone


class Player:
    """One connection. Sequence numbers and the stream's number are its own."""

    def __init__(self, writer: asyncio.StreamWriter, title: str) -> None:
        host = writer.get_extra_info("sockname")[0]
        self.session = rtsp.Session(secrets.token_hex(8), host, title)
        self.is_playing = False
        self._writer = writer
        self._sequence, self._source_id = secrets.randbits(16), secrets.randbits(32)
        self._behind_since_s: float | None = None

    async def send(self, data: bytes) -> None:
        """An answer; waits while earlier ones are not read. A player that reads none is gone: raises TimeoutError."""
        self._writer.write(data)
        try:
            async with asyncio.timeout(LET_GO_S):
                await self._writer.drain()
        except TimeoutError:
            self.close()
            raise

    def show(self, scan: Scan, source_us: int, now_s: float) -> None:
        """Send one picture, whole or not at all; a player that does not read is let go after a while."""
        if self._writer.transport.is_closing():
            return
        if self._writer.transport.get_write_buffer_size() > MAX_UNSENT_BYTES:
            self._behind_since_s = now_s if self._behind_since_s is None else self._behind_since_s
            if now_s - self._behind_since_s > LET_GO_S:
                self._writer.transport.abort()
            return
        self._behind_since_s = None
        found = list(packets(scan, sequence=self._sequence, source_us=source_us, source_id=self._source_id))
        self._sequence += len(found)
        self._writer.write(b"".join(rtsp.interleaved(self.session.channel or 0, packet) for packet in found))

    def close(self) -> None:
        self._writer.transport.abort()


class Video:
    """count: something refused, by its cause. size_px: of the last picture, None before the first."""

    def __init__(
        self, pictures: PulledPicture, settings: MavlinkConfig, title: str, count: Callable[[str], None]
    ) -> None:
        self._pictures, self._settings, self._title, self._count = pictures, settings, title, count
        self._players = set[Player]()
        self._server: asyncio.Server | None = None
        self.size_px: tuple[int, int] | None = None

    async def open(self) -> None:
        """Raises UserError where the address cannot be had."""
        if not self._settings.video:
            return
        host, port = tcp_address(self._settings.video)
        try:
            self._server = await asyncio.start_server(self._serve, host, port)
        except OSError as error:
            raise UserError(f"mavlink.video {self._settings.video}: {error.strerror}") from error
        LOG.info("video at rtsp://%s%s", self._settings.video, rtsp.PATH)

    def close(self) -> None:
        """End every connection."""
        if self._server is not None:
            self._server.close()
        for player in tuple(self._players):
            player.close()

    async def show_pictures(self) -> None:
        """Pull pictures while somebody watches, and one for its size before that."""
        while self._server is not None:
            if self.size_px is not None and not any(player.is_playing for player in self._players):
                await asyncio.sleep(WATCH_PERIOD_S)
                continue
            picture = await self._pictures.next()
            scan = parse_scan(picture.data)
            if scan is None:
                self._count("video_not_rtp")
                continue
            self.size_px = scan.width_px, scan.height_px
            now_s = asyncio.get_running_loop().time()
            for player in tuple(self._players):
                if player.is_playing:
                    player.show(scan, picture.header.source_us, now_s)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One player, to its end."""
        with contextlib.closing(writer), contextlib.suppress(OSError):
            if len(self._players) >= self._settings.max_clients:
                return
            player = Player(writer, self._title)
            self._players.add(player)
            try:
                await self._converse(player, reader)
            except (ValueError, TimeoutError):
                self._count("video_refused")
                if not writer.is_closing():
                    writer.write(rtsp.refusal())
            finally:
                self._players.discard(player)

    async def _converse(self, player: Player, reader: asyncio.StreamReader) -> None:
        """Raises ValueError for what is no RTSP, TimeoutError where nothing comes before it plays."""
        buffer = b""
        while True:
            async with asyncio.timeout(None if player.is_playing else SILENT_S):
                data = await reader.read(CHUNK_BYTES)
            if not data:
                return
            buffer += data
            while True:
                request, taken = rtsp.split_request(buffer)
                buffer = buffer[taken:]
                if request is not None:
                    answer = player.session.answer(request)
                    await player.send(answer.data)
                    player.is_playing = player.is_playing if answer.is_playing is None else answer.is_playing
                    if answer.is_last:
                        return
                if not taken:
                    break
