"""List and download of the recorder's recordings, as ArduPilot answers LOG_REQUEST_*. No input or output of its own.

Each station has the numbers of its own last list, from 1, so that a recording that is added or deleted meanwhile gives
no number another file. One piece of work at a time, by turns, of whatever size: stations share the rate.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from paani_services.mavlink import commands
from paani_services.mavlink.codec import dialect
from paani_services.mavlink.fields import U16_MAX, U32_MAX
from paani_services.mavlink.snapshot import Snapshot
from paani_services.mavlink.station import Source, Station

CHUNK_BYTES = 90  # of LOG_DATA
CHUNKS_PER_TURN = 40  # 180 kB/s of a recording at 50 turns a second, for all stations together
ENTRIES_PER_TURN = 40
MAX_UNSENT_BYTES = 16_384  # a link that is this far behind waits; at four times as much a station is let go
MAX_LOGS = 1000  # the newest
NO_SUCH_LOG = "log: ask for the list again"
GONE = "log: this recording is no longer there"
NO_ERASING = "log: recordings are deleted on the page alone"


class LogFile(NamedTuple):
    """A recording that is no longer written. start_us: Unix time, 0 where it is not known."""

    path: Path
    start_us: int
    size_bytes: int


class ListRequest(NamedTuple):
    """Entries to be sent, by number. is_known: those of the list that the station has."""

    first: int
    last: int
    is_known: bool = False


class DataRequest(NamedTuple):
    """Bytes to be sent of the recording that the station knows by this number."""

    number: int
    file: LogFile
    offset: int
    end: int

    @property
    def turn_bytes(self) -> int:
        """How much of it is one turn."""
        return min(self.end - self.offset, CHUNKS_PER_TURN * CHUNK_BYTES)


class LogTransfers:
    """What is asked, and what is still to be sent. count: something refused, by its cause."""

    def __init__(self, count: Callable[[str], None], is_trusted: Callable[[Station, Any], bool]) -> None:
        self._count, self._is_trusted = count, is_trusted
        self._now_us = 0
        self._files: dict[Station, tuple[LogFile, ...]] = {}
        self._requests: dict[Station, ListRequest | DataRequest] = {}  # whose turn is next comes first
        self.handlers: dict[str, Callable[[Station, Any, Source], None]] = {
            "LOG_REQUEST_LIST": self._request_list,
            "LOG_REQUEST_DATA": self._request_data,
            "LOG_REQUEST_END": self._end,
            "LOG_ERASE": self._refuse_erasing,
        }

    def follow(self, snapshot: Snapshot) -> None:
        """Whoever has fallen silent gets no more."""
        self._now_us = snapshot.now_us
        for station in tuple(self._requests):
            if not station.is_present(snapshot.now_us):
                del self._requests[station]

    def forget(self, station: Station) -> None:
        """A station whose link has ended."""
        self._requests.pop(station, None)
        self._files.pop(station, None)

    def next_request(self) -> tuple[Station, ListRequest | DataRequest] | None:
        """Whose turn it is, and for what; None while nobody waits, or nobody's link could take more."""
        for station, request in self._requests.items():
            if station.unsent_bytes() <= MAX_UNSENT_BYTES:
                return station, request
        return None

    def send_entries(self, station: Station, request: ListRequest, files: tuple[LogFile, ...] | None) -> None:
        """Send the next entries. files: all that there are now, for a list that is not known yet."""
        if self._requests.get(station) is not request:  # it has asked for something else meanwhile
            return
        if files is not None:
            self._files[station] = files[-MAX_LOGS:]
        known = self._files.get(station, ())
        total = len(known)
        if total == 0:
            station.send(dialect.MAVLink_log_entry_message(0, 0, 0, 0, 0), self._now_us)
        first, last = max(1, request.first), min(request.last, total)
        next_first = min(first + ENTRIES_PER_TURN, last + 1)
        for number in range(first, next_first):
            file = known[number - 1]
            start_s = min(file.start_us // 1_000_000, U32_MAX)
            entry = dialect.MAVLink_log_entry_message(number, total, total, start_s, file.size_bytes)
            station.send(entry, self._now_us)
        rest = ListRequest(next_first, last, is_known=True) if next_first <= last else None
        self._go_on(station, rest)

    def send_data(self, station: Station, request: DataRequest, data: bytes) -> None:
        """Send bytes that were read from `offset`; fewer than its `turn_bytes` end at the end of the file.

        A chunk that is not full ends a download, as that of ArduPilot does: after a full one, at the end of the file,
        there is an empty one.
        """
        if self._requests.get(station) is not request:
            return
        is_at_end = len(data) < request.turn_bytes
        if not data and request.offset < request.file.size_bytes:
            self._refuse(station, GONE)
        for at in range(0, len(data) + is_at_end, CHUNK_BYTES):
            self._send_chunk(station, request.number, request.offset + at, data[at : at + CHUNK_BYTES])
        offset = request.offset + len(data)
        is_done = is_at_end or offset >= request.end
        self._go_on(station, None if is_done else request._replace(offset=offset))

    def _go_on(self, station: Station, rest: ListRequest | DataRequest | None) -> None:
        """What is left of a request waits behind those of the other stations."""
        del self._requests[station]
        if rest is not None:
            self._requests[station] = rest

    def _request_list(self, station: Station, message: Any, _: Source) -> None:
        """A list from its beginning to its end is a new one; a part of it is of the list that the station has."""
        if not self._is_trusted(station, message):
            self._refuse(station, commands.NOT_TRUSTED)
            station.send(dialect.MAVLink_log_entry_message(0, 0, 0, 0, 0), self._now_us)
            return
        known = self._files.get(station, ())
        is_part = message.start > 1 or message.end < len(known)
        self._put(station, ListRequest(message.start, message.end or U16_MAX, is_known=bool(known) and is_part))

    def _request_data(self, station: Station, message: Any, _: Source) -> None:
        """A request takes the place of the one before."""
        files = self._files.get(station, ())
        is_trusted = self._is_trusted(station, message)
        if not is_trusted or not 1 <= message.id <= len(files):
            self._refuse(station, NO_SUCH_LOG if is_trusted else commands.NOT_TRUSTED)
            self._send_chunk(station, message.id, message.ofs, b"")
        elif message.count > 0:
            end = message.ofs + message.count
            self._put(station, DataRequest(message.id, files[message.id - 1], message.ofs, end))

    def _put(self, station: Station, request: ListRequest | DataRequest) -> None:
        """A station keeps its turn, however often it asks."""
        self._requests[station] = request

    def _end(self, station: Station, _: Any, __: Source) -> None:
        self._requests.pop(station, None)

    def _refuse_erasing(self, station: Station, _: Any, __: Source) -> None:
        self._refuse(station, NO_ERASING)

    def _refuse(self, station: Station, text: str) -> None:
        self._count("mavlink_refused")
        station.refuse(text, self._now_us)

    def _send_chunk(self, station: Station, number: int, offset: int, chunk: bytes) -> None:
        data = list(chunk.ljust(CHUNK_BYTES, b"\0"))
        station.send(dialect.MAVLink_log_data_message(number, offset, len(chunk), data), self._now_us)
