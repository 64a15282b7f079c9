"""Files made to cost their reader memory or time: the cost is bounded by the size of the file."""

from __future__ import annotations

import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import pytest
import zstandard
from mcap.opcode import Opcode

from paani.logs.layout import MAGIC, MAX_CHUNK_BYTES, unpacked_chunk
from paani.logs.locate import layout_of
from paani.logs.scan import HEAD, MAX_TIMES_IN_VAIN, scan

MIB = 1 << 20


class CountedBytes(bytes):
    """Counts what is read of it in slices."""

    read_bytes = 0

    def __getitem__(self, place: object) -> object:  # type: ignore[override]
        found = super().__getitem__(place)  # type: ignore[call-overload]
        self.read_bytes += len(found) if isinstance(found, bytes) else 1
        return found


def text(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def chunk_head(size: int, compression: str, length: int) -> bytes:
    return struct.pack("<QQQI", 1, 2, size, 0) + text(compression.encode()) + struct.pack("<Q", length)


def record(opcode: Opcode, inside: bytes) -> bytes:
    return HEAD.pack(opcode, len(inside)) + inside


def zstd(data: bytes) -> bytes:
    return zstandard.ZstdCompressor().compress(data)


def lz4_frame(data: bytes) -> bytes:
    packed: bytes = lz4.frame.compress(data)
    return packed


@pytest.mark.parametrize(
    ("compression", "compress"), [("zstd", zstd), ("lz4", lz4_frame), ("", bytes)], ids=["zstd", "lz4", "none"]
)
@pytest.mark.parametrize("claims", [10, MAX_CHUNK_BYTES + 1], ids=["claims too little", "claims too much"])
def test_a_chunk_costs_no_more_memory_than_it_may(
    compression: str, compress: Callable[[bytes], bytes], claims: int
) -> None:
    packed = compress(bytes(8 * MIB)) if compression else b"a small one"
    content = chunk_head(claims, compression, len(packed)) + packed
    tracemalloc.start()
    try:
        data, problem = unpacked_chunk(content, 99)
        peak_bytes = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert (data, problem.count("\n")) == (b"", 0)
    assert problem.startswith("chunk at byte 99 is damaged, left out (a chunk of ")
    assert peak_bytes < MIB


@pytest.mark.parametrize(("compression", "compress"), [("zstd", zstd), ("lz4", lz4_frame), ("", bytes)])
def test_a_chunk_of_what_it_claims_is_read(compression: str, compress: Callable[[bytes], bytes]) -> None:
    packed = compress(b"records")
    assert unpacked_chunk(chunk_head(7, compression, len(packed)) + packed, 0) == (b"records", "")


def overlapping_chunks(count: int) -> bytes:
    """Heads of chunks, each of which says that its chunk reaches to the end of the file."""
    each = HEAD.size + len(chunk_head(0, "zstd", 0))
    left = [each * (count - number) - HEAD.size for number in range(count)]
    return b"".join(HEAD.pack(Opcode.CHUNK, size) + chunk_head(10, "zstd", size - each + HEAD.size) for size in left)


def overlapping_attachments(count: int) -> bytes:
    """Attachments that reach to the end of the file, between chunks that can be read."""
    packed = zstd(b"")
    chunk = record(Opcode.CHUNK, chunk_head(0, "zstd", len(packed)) + packed)
    each = len(chunk) + HEAD.size
    return b"".join(chunk + HEAD.pack(Opcode.ATTACHMENT, each * (count - number - 1)) for number in range(count))


@pytest.mark.parametrize("overlapping", [overlapping_chunks, overlapping_attachments])
def test_going_through_records_that_overlap_costs_as_much_as_the_file_is_long(
    overlapping: Callable[[int], bytes],
) -> None:
    data = CountedBytes(MAGIC + overlapping(2000))
    pieces = list(scan(data))
    assert [piece.start for piece in pieces[1:]] == [piece.end for piece in pieces[:-1]]
    assert pieces[-1].end == len(data)
    assert data.read_bytes < (MAX_TIMES_IN_VAIN + 4) * len(data)


@pytest.mark.parametrize("pointer", [Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX])
def test_a_summary_that_points_to_the_same_bytes_again_is_damaged(tmp_path: Path, pointer: Opcode) -> None:
    if pointer is Opcode.CHUNK_INDEX:
        pointed = record(Opcode.CHUNK, chunk_head(900, "", 900) + bytes(900))
        index = struct.pack("<QQQQIQ", 1, 2, len(MAGIC), len(pointed), 0, 0) + text(b"") + struct.pack("<QQ", 900, 900)
    else:
        attachment = struct.pack("<QQ", 1, 1) + text(b"a") + text(b"b") + struct.pack("<Q", 900) + bytes(900 + 4)
        pointed = record(Opcode.ATTACHMENT, attachment)
        index = struct.pack("<QQQQQ", len(MAGIC), len(pointed), 1, 1, 900) + text(b"a") + text(b"b")
    path = tmp_path / "hostile.mcap"
    for times, is_damaged in ((1, False), (20, True)):
        footer = record(Opcode.FOOTER, struct.pack("<QQI", len(MAGIC) + len(pointed), 0, 0))
        path.write_bytes(MAGIC + pointed + record(pointer, index) * times + footer + MAGIC)
        assert any("points to the same bytes" in problem for problem in layout_of(path).problems) == is_damaged
