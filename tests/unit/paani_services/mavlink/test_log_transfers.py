"""List and download of recordings: what each request is answered with, and that no station holds up another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from paani_services.mavlink import commands
from paani_services.mavlink.log_transfers import (
    CHUNK_BYTES,
    CHUNKS_PER_TURN,
    GONE,
    MAX_LOGS,
    MAX_UNSENT_BYTES,
    NO_ERASING,
    NO_SUCH_LOG,
    ListRequest,
    LogFile,
)
from tests.mavlink_peer import HEARTBEAT, NOW_US, Peer, Port, in_order, kinds, only

TURN_BYTES = CHUNKS_PER_TURN * CHUNK_BYTES
EVERYTHING = 0xFFFF_FFFF


class Disk:
    """Recordings in memory, from which turns are served."""

    def __init__(self, *contents: bytes, local: bool = True) -> None:
        self.port = Port(in_order())
        self.contents = {Path(f"{number}.mcap"): content for number, content in enumerate(contents)}
        self.peer = self.station(local=local)

    def station(self, *, local: bool = True) -> Peer:
        peer = Peer(self.port.gateway, len(self.port.gateway.stations), local=local)
        peer.send(HEARTBEAT)
        return peer

    def turn(self) -> bool:
        """Serve one turn; False where there is none."""
        logs = self.port.gateway.logs
        if (turn := logs.next_request()) is None:
            return False
        station, request = turn
        if isinstance(request, ListRequest):
            files = [LogFile(path, 1_700_000_000_000_000, len(each)) for path, each in self.contents.items()]
            logs.send_entries(station, request, None if request.is_known else tuple(files))
        else:
            content = self.contents.get(request.file.path, b"")
            logs.send_data(station, request, content[request.offset : request.offset + request.turn_bytes])
        return True

    def serve(self, peer: Peer, *answers: Any) -> list[Any]:
        """What this station is sent until nothing is left to do, after what it was sent at once."""
        while self.turn():
            pass
        return [*answers, *peer.received()]

    def entries(self, first: int = 0, last: int = 0xFFFF) -> list[Any]:
        request = common.MAVLink_log_request_list_message(1, 1, first, last)
        return self.serve(self.peer, *self.peer.send(request))

    def download(self, number: int, offset: int = 0, count: int = EVERYTHING) -> list[Any]:
        return self.serve(self.peer, *self.peer.send(data_request(number, offset, count)))


def data_request(number: int, offset: int = 0, count: int = EVERYTHING) -> Any:
    return common.MAVLink_log_request_data_message(1, 1, number, offset, count)


def content_of(chunks: list[Any]) -> bytes:
    """The bytes of chunks, in the order of their offsets."""
    joined = b""
    for chunk in chunks:
        assert (chunk.get_type(), chunk.ofs) == ("LOG_DATA", chunks[0].ofs + len(joined))
        joined += bytes(chunk.data[: chunk.count])
    return joined


def test_the_list_numbers_recordings_from_one_and_tells_size_and_time() -> None:
    entries = Disk(b"a" * 100, b"b" * 7).entries()
    assert [(each.id, each.num_logs, each.last_log_num, each.size, each.time_utc) for each in entries] == [
        (1, 2, 2, 100, 1_700_000_000),
        (2, 2, 2, 7, 1_700_000_000),
    ]


def test_an_empty_folder_has_one_entry_that_says_so() -> None:
    (entry,) = Disk().entries()
    assert (entry.id, entry.num_logs) == (0, 0)


@pytest.mark.slow
def test_a_long_list_is_whole_and_of_the_newest() -> None:
    entries = Disk(*[b"x"] * (MAX_LOGS + 5)).entries()
    assert [each.id for each in entries] == list(range(1, MAX_LOGS + 1))


@pytest.mark.parametrize(
    "size", [1, CHUNK_BYTES - 1, CHUNK_BYTES, CHUNK_BYTES + 1, TURN_BYTES, TURN_BYTES + 1, 3 * TURN_BYTES - CHUNK_BYTES]
)
def test_a_recording_comes_whole_and_ends_with_a_chunk_that_is_not_full(size: int) -> None:
    content = bytes(number % 251 for number in range(size))
    disk = Disk(content)
    disk.entries()
    chunks = disk.download(1)
    assert content_of(chunks) == content
    assert [chunk.count == CHUNK_BYTES for chunk in chunks] == [True] * (len(chunks) - 1) + [False]


def test_a_part_of_a_recording_is_that_part() -> None:
    content = bytes(range(250)) * 100
    disk = Disk(content)
    disk.entries()
    chunks = disk.download(1, 90, 900)
    assert content_of(chunks) == content[90:990]
    assert [chunk.count for chunk in chunks] == [CHUNK_BYTES] * 10  # it does not say that the file ends here
    (beyond,) = disk.download(1, len(content) + 10)
    assert beyond.count == 0
    assert disk.download(1, 0, 0) == []


def test_numbers_stay_with_their_files_until_a_new_list() -> None:
    """A recording is deleted, and one is added; the part of a list that a station lost is of the list that it has."""
    disk = Disk(b"a", b"b", b"c")
    disk.entries()
    del disk.contents[Path("0.mcap")]
    disk.contents[Path("9.mcap")] = b"longer"
    assert content_of(disk.download(2)) == b"b"
    assert [(each.id, each.size) for each in disk.entries(2, 3)] == [(2, 1), (3, 1)]
    assert [each.size for each in disk.entries()] == [1, 1, 6]
    assert content_of(disk.download(2)) == b"c"


def test_of_what_is_gone_nothing_is_sent_but_why() -> None:
    disk = Disk(b"a" * 500)
    disk.entries()
    disk.contents.clear()
    text, chunk = disk.download(1)
    assert (text.text, chunk.count) == (GONE, 0)


@pytest.mark.parametrize("number", [0, 3, 0xFFFF])
def test_a_number_that_is_not_in_the_list_is_no_log(number: int) -> None:
    disk = Disk(b"a", b"b")
    disk.entries()
    text, chunk = disk.download(number)
    assert (text.text, chunk.id, chunk.count) == (NO_SUCH_LOG, number, 0)
    assert disk.port.counted == ["mavlink_refused"]


def test_stations_elsewhere_get_no_recordings_without_a_signature() -> None:
    disk = Disk(b"a", local=False)
    text, chunk = disk.download(1)
    assert (text.text, chunk.count) == (commands.NOT_TRUSTED, 0)
    (entry,) = disk.entries()
    assert entry.num_logs == 0
    assert not disk.turn()


def test_recordings_are_not_erased() -> None:
    disk = Disk(b"a")
    assert only(disk.peer.send(common.MAVLink_log_erase_message(1, 1)), "STATUSTEXT").text == NO_ERASING
    assert len(disk.entries()) == 1


def test_stations_take_turns_of_bounded_size() -> None:
    disk = Disk(b"a" * 20 * TURN_BYTES)
    other = disk.station()
    disk.entries()
    other.send(common.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF))
    disk.serve(other)
    for peer in (disk.peer, other):
        peer.send(data_request(1))
    for _ in range(10):
        disk.turn()
    for peer in (disk.peer, other):
        assert kinds(peer.received()) == ["LOG_DATA"] * 5 * CHUNKS_PER_TURN


def test_a_request_takes_the_place_of_the_one_before_and_an_end_ends_it() -> None:
    disk = Disk(b"a" * 20 * TURN_BYTES)
    disk.entries()
    disk.peer.send(data_request(1))
    disk.turn()
    disk.peer.send(data_request(1, 900, CHUNK_BYTES))
    assert [chunk.ofs for chunk in disk.serve(disk.peer)] == [900]
    disk.peer.send(data_request(1))
    disk.turn()
    disk.peer.send(common.MAVLink_log_request_end_message(1, 1))
    assert not disk.turn()


def test_what_was_read_for_an_earlier_request_is_not_sent() -> None:
    disk = Disk(b"a" * 20 * TURN_BYTES)
    disk.entries()
    logs = disk.port.gateway.logs
    disk.peer.send(data_request(1))
    turn = logs.next_request()
    assert turn is not None
    station, request = turn
    assert not isinstance(request, ListRequest)
    disk.peer.send(common.MAVLink_log_request_end_message(1, 1))
    logs.send_data(station, request, b"a" * TURN_BYTES)
    assert disk.peer.received() == []


def test_a_link_that_is_behind_waits_and_a_silent_station_gets_no_more() -> None:
    disk = Disk(b"a" * 20 * TURN_BYTES)
    disk.entries()
    disk.peer.send(data_request(1))
    disk.peer.station.unsent_bytes = lambda: MAX_UNSENT_BYTES + 1
    assert not disk.turn()
    disk.peer.station.unsent_bytes = lambda: 0
    assert disk.turn()
    disk.port.gateway.tick(in_order(now_us=NOW_US + 11_000_000))
    assert not disk.turn()


def test_a_station_that_is_gone_leaves_nothing_behind() -> None:
    disk = Disk(b"a" * 20 * TURN_BYTES)
    disk.entries()
    disk.peer.send(data_request(1))
    disk.port.gateway.remove(disk.peer.station)
    assert not disk.turn()
