"""What lies where in one MCAP file: channels, attachments, and the spans that hold messages."""

from __future__ import annotations

import io
import stat
import struct
import zlib
from collections.abc import Container, Iterator
from pathlib import Path

import lz4.frame
import msgspec
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk

from paani.errors import UserError

MAGIC = bytes((137, 77, 67, 65, 80, 48, 13, 10))
PROFILE = "paani"
FORMAT = 1
MAX_CHUNK_BYTES = 64 << 20  # unpacked: the recorder's hold 256 KiB and one message, other writers' a few MiB
DAMAGE = (McapError, zstandard.ZstdError, struct.error, ValueError, ArithmeticError, MemoryError, RuntimeError)

_HEAD = struct.Struct("<BQ")
_HEAD_AND_CHANNEL = struct.Struct("<BQH")
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, two times; then the payload


class Span(msgspec.Struct, frozen=True):
    """Bytes of a file that hold messages: one chunk, or messages outside chunks (`loose`). Times [us] include both."""

    offset: int
    length: int
    start_us: int
    end_us: int
    loose: bool = False


class Layout(msgspec.Struct):
    """One file. `channels` are topics by id; `counts` messages by topic; `schemas` by id, and `schema_ids` by topic."""

    path: Path
    library: str = ""
    spans: list[Span] = []
    channels: dict[int, str] = {}
    schemas: dict[int, bytes] = {}
    schema_ids: dict[str, int] = {}
    counts: dict[str, int] = {}
    attachments: dict[str, bytes] = {}
    metadata: dict[str, dict[str, str]] = {}
    problems: list[str] = []


def messages_in(data: bytes, wanted: Container[int]) -> Iterator[tuple[int, int, int, bytes]]:
    """(channel id, sequence, log time [ns], payload) of every whole message of the wanted channels, as they lie."""
    at, end, message, read = 0, len(data), Opcode.MESSAGE.value, _HEAD_AND_CHANNEL.unpack_from
    while at + _HEAD_AND_CHANNEL.size <= end:
        opcode, length, number = read(data, at)
        start, at = at, at + _HEAD.size + length
        if opcode == message and number in wanted and at <= end and length >= MESSAGE.size:
            _, sequence, log_ns, _ = MESSAGE.unpack_from(data, start + _HEAD.size)
            yield number, sequence, log_ns, data[start + _HEAD.size + MESSAGE.size : at]


def require_file(path: Path) -> None:
    """Raises UserError naming a path that is no file: a pipe waits for who writes into it. Raises OSError."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise UserError(f"{path}: is no file")


def span_bytes(path: Path, span: Span) -> tuple[bytes, str]:
    """The records of a span, unpacked; or nothing, and what is wrong: a chunk that fails its checksum is not used."""
    try:
        with path.open("rb") as file:
            file.seek(span.offset)
            data = file.read(span.length)
    except OSError as error:
        return b"", str(error.strerror)
    if span.loose:
        return data, ""
    return unpacked_chunk(data, span.offset)


def unpacked_chunk(content: bytes, offset: int) -> tuple[bytes, str]:
    """The same of the content of a chunk record at a byte of its file."""
    try:
        return unpacked_records(Chunk.read(ReadDataStream(io.BytesIO(content)))), ""
    except DAMAGE as error:
        return b"", f"chunk at byte {offset} is damaged, left out ({line_of(error)})"


def unpacked_records(chunk: Chunk) -> bytes:
    """The records in a chunk, never more than MAX_CHUNK_BYTES. Raises one of DAMAGE where it is not what it claims."""
    size: int = chunk.uncompressed_size
    if size > MAX_CHUNK_BYTES:
        raise ValueError(f"a chunk of {size} bytes")
    match chunk.compression:
        case "":
            data: bytes = chunk.data
        case "zstd":
            data = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(size + 1)
        case "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, size + 1)
        case other:
            raise ValueError(f"a compression '{other[:40]}'")
    if len(data) != size:
        raise ValueError("a chunk of another size than it claims")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("a chunk fails its checksum")
    return data


def line_of(error: BaseException) -> str:
    """The first line of what went wrong."""
    return (str(error) or type(error).__name__).splitlines()[0][:120]
