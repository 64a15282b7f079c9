"""Finds out what lies where in an MCAP file: from its summary where that is whole, else by going through the data."""

from __future__ import annotations

import io
import mmap
import struct
import zlib
from pathlib import Path
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, ChunkIndex, Footer, Header, Metadata, Schema, Statistics

from paani.errors import UserError
from paani.logs.layout import DAMAGE, MAGIC, PROFILE, Layout, Span, line_of, messages_in, require_file, unpacked_chunk
from paani.logs.scan import HEAD, Damage, ScannedRecord, content, records_in, scan

FOOTER_BYTES = HEAD.size + 20
MAX_LOOSE_BYTES = 1 << 20
_TIMES = struct.Struct("<QQ")


def layout_of(path: Path) -> Layout:
    """Find out, from the summary where it is whole, else from the data. Raises UserError for what is no MCAP file."""
    try:
        require_file(path)
        with path.open("rb") as file:
            size = file.seek(0, io.SEEK_END)
            if size == 0:
                raise UserError(f"{path}: empty file")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                return _layout(path, data)
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error


def has_damaged_summary(path: Path, data: mmap.mmap) -> bool:
    """Whether there is a summary that does not say what it did when it was written."""
    try:
        _read_summary(Layout(path), data)
    except DAMAGE:
        return True
    return False


def _layout(path: Path, data: mmap.mmap) -> Layout:
    layout = Layout(path)
    begins_right = data[: len(MAGIC)] == MAGIC
    try:
        if begins_right and _read_summary(layout, data):
            return layout
    except DAMAGE as error:
        layout.problems.append(f"summary is damaged ({line_of(error)})")
    problems = layout.problems or ["unfinished (`paani logs repair` mends it)"]
    layout = Layout(path, problems=problems)
    _read_data(layout, data)
    if not begins_right and not layout.spans:
        raise UserError(f"{path}: not an MCAP file")
    return layout


def _read_summary(layout: Layout, data: mmap.mmap) -> bool:
    """Fill the layout from the summary; false where there is none, or messages lie outside chunks."""
    at = len(data) - len(MAGIC) - FOOTER_BYTES
    if at < len(MAGIC) or data[-len(MAGIC) :] != MAGIC:
        return False
    if HEAD.unpack_from(data, at) != (Opcode.FOOTER, FOOTER_BYTES - HEAD.size):
        return False
    footer = Footer.read(_stream(data[at + HEAD.size : at + FOOTER_BYTES]))
    if not 0 < footer.summary_start < at:
        return False
    if footer.summary_crc and zlib.crc32(data[footer.summary_start : at + FOOTER_BYTES - 4]) != footer.summary_crc:
        raise ValueError("it fails its checksum")
    counts: dict[int, int] = {}
    total, place, pointed_bytes = 0, footer.summary_start, 0
    while place < at:
        record = _record_at(data, place)
        place = record.end
        match record.opcode:
            case Opcode.CHANNEL | Opcode.SCHEMA:
                _learn_channel(layout, record, content(data, record))
            case Opcode.STATISTICS:
                statistics = Statistics.read(_stream(content(data, record)))
                counts, total = statistics.channel_message_counts, statistics.message_count
            case Opcode.CHUNK_INDEX:
                index = ChunkIndex.read(_stream(content(data, record)))
                chunk = _record_at(data, index.chunk_start_offset)
                pointed_bytes += chunk.end - chunk.start
                _learn_span(layout, chunk, index.message_start_time, index.message_end_time)
            case Opcode.ATTACHMENT_INDEX | Opcode.METADATA_INDEX:
                offset = int.from_bytes(content(data, record)[:8], "little")
                pointed = _record_at(data, offset)
                pointed_bytes += pointed.end - pointed.start
                _learn(layout, data, pointed)
        if pointed_bytes > len(data):
            raise ValueError("it points to the same bytes more than once")
    if total and not layout.spans:
        return False
    _learn(layout, data, _record_at(data, len(MAGIC)))
    layout.counts = {layout.channels[number]: n for number, n in counts.items() if number in layout.channels}
    return True


def _read_data(layout: Layout, data: mmap.mmap) -> None:
    """Fill the layout by going through the whole file; damage is named and left out."""
    loose: list[ScannedRecord] = []
    for piece in scan(data):
        if isinstance(piece, Damage):
            layout.problems.append(f"bytes {piece.start} to {piece.end} cannot be read ({piece.cause})")
            continue
        if piece.opcode in {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE}:
            if loose and (piece.start != loose[-1].end or piece.end - loose[0].start > MAX_LOOSE_BYTES):
                _learn_loose(layout, data, loose)
                loose = []
            loose.append(piece)
        elif piece.opcode == Opcode.CHUNK:
            inside, problem = unpacked_chunk(content(data, piece), piece.start)
            if problem:
                layout.problems.append(problem)
                continue
            _learn_messages(layout, inside)
            _learn_span(layout, piece, *_TIMES.unpack_from(data, piece.start + HEAD.size))
        elif piece.opcode in {Opcode.DATA_END, Opcode.FOOTER}:
            break
        else:
            _learn(layout, data, piece)
    _learn_loose(layout, data, loose)


def _record_at(data: mmap.mmap, at: int) -> ScannedRecord:
    """The record at a byte of the file. Raises ValueError where there is none."""
    if at + HEAD.size > len(data):
        raise ValueError("a record lies outside the file")
    opcode, length = HEAD.unpack_from(data, at)
    if at + HEAD.size + length > len(data):
        raise ValueError("a record lies outside the file")
    return ScannedRecord(opcode, at, at + HEAD.size + length)


def _learn_span(layout: Layout, chunk: ScannedRecord, start_ns: int, end_ns: int) -> None:
    start = chunk.start + HEAD.size
    layout.spans.append(Span(start, chunk.end - start, start_ns // 1000, end_ns // 1000))


def _learn_loose(layout: Layout, data: mmap.mmap, records: list[ScannedRecord]) -> None:
    """Messages outside chunks, one after the other."""
    if not records:
        return
    start, end = records[0].start, records[-1].end
    times_us = _learn_messages(layout, data[start:end])
    if times_us:
        layout.spans.append(Span(start, end - start, min(times_us), max(times_us), loose=True))


def _learn_messages(layout: Layout, inside: bytes) -> list[int]:
    """Channels and counts; returns the times of the messages [us]."""
    for record in records_in(inside):
        if record.opcode in {Opcode.CHANNEL, Opcode.SCHEMA}:
            _learn_channel(layout, record, content(inside, record))
    times_us = []
    for number, _, log_ns, _ in messages_in(inside, layout.channels):
        topic = layout.channels[number]
        layout.counts[topic] = layout.counts.get(topic, 0) + 1
        times_us.append(log_ns // 1000)
    return times_us


def _learn_channel(layout: Layout, record: ScannedRecord, inside: bytes) -> None:
    """A channel, or the schema of its messages."""
    if record.opcode == Opcode.SCHEMA:
        schema = Schema.read(_stream(inside))
        layout.schemas[schema.id] = schema.data
        return
    channel = Channel.read(_stream(inside))
    layout.channels[channel.id] = channel.topic
    layout.schema_ids[channel.topic] = channel.schema_id


def _learn(layout: Layout, data: mmap.mmap, record: ScannedRecord) -> None:
    """A header, an attachment or a metadata record; the first of a name wins. A damaged one is named and left out."""
    inside = content(data, record)
    try:
        match record.opcode:
            case Opcode.HEADER:
                header = Header.read(_stream(inside))
                layout.library = header.library
                if header.profile != PROFILE:
                    layout.problems.append(f"profile '{header.profile[:40]}': not recorded by PAANI")
            case Opcode.METADATA:
                metadata = Metadata.read(_stream(inside))
                layout.metadata.setdefault(metadata.name, metadata.metadata)
            case Opcode.ATTACHMENT:
                if any(inside[-4:]) and zlib.crc32(inside[:-4]) != int.from_bytes(inside[-4:], "little"):
                    raise ValueError("it fails its checksum")
                attachment = Attachment.read(_stream(inside))
                layout.attachments.setdefault(attachment.name, attachment.data)
    except DAMAGE as error:
        layout.problems.append(f"record at byte {record.start} is damaged, left out ({line_of(error)})")


def _stream(inside: bytes) -> Any:
    return ReadDataStream(io.BytesIO(inside))
