"""Mends a recording that was cut short or damaged: everything that can be read, with a new summary."""

from __future__ import annotations

import collections
import contextlib
import fcntl
import itertools
import mmap
import os
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import msgspec
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from paani.errors import UserError
from paani.logs.layout import MAGIC, MESSAGE, PROFILE, require_file
from paani.logs.locate import has_damaged_summary
from paani.logs.scan import (
    HEAD,
    Damage,
    Data,
    ScannedRecord,
    content,
    records_in,
    scan,
    stream_of,
    unpacked,
)
from paani.whole_file import replacement_file

FOOTER_BYTES = HEAD.size + 20


class Repaired(msgspec.Struct, frozen=True, kw_only=True):
    """What a repair found. `changed` is false for a file that was whole; `lost` names what could not be read.

    original: where the file as it was is kept, when more than its end could not be read.
    """

    path: Path
    changed: bool
    messages: int = 0
    lost: tuple[str, ...] = ()
    original: Path | None = None


class Interrupted(Exception):
    """Told to stop; the file is as it was."""


class InUse(UserError):
    """A recorder, or another repair, has the file open."""


def is_finished(path: Path) -> bool:
    """Does the file end as a finished recording does? Raises OSError."""
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        if size < 2 * len(MAGIC) + FOOTER_BYTES:
            return False
        file.seek(size - len(MAGIC) - FOOTER_BYTES)
        tail = file.read()
    return tail.endswith(MAGIC) and HEAD.unpack_from(tail) == (Opcode.FOOTER, FOOTER_BYTES - HEAD.size)


def repair(path: Path, told_to_stop: Callable[[], bool] = lambda: False) -> Repaired:
    """Write what can be read beside the file, then put it in the file's place.

    Raises UserError naming the file for what is no recording of ours or cannot be read or written, InUse, Interrupted.
    """
    try:
        require_file(path)
        with path.open("rb") as file:
            if not file.seek(0, os.SEEK_END):
                raise UserError(f"{path}: empty file")
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if not os.path.samestat(os.fstat(file.fileno()), path.stat()):
                raise InUse(f"{path}: has just been repaired")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                return _repair(path, data, told_to_stop)
    except BlockingIOError as error:
        raise InUse(f"{path}: is being written") from error
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error


def _repair(path: Path, data: mmap.mmap, told_to_stop: Callable[[], bool]) -> Repaired:
    pieces: list[ScannedRecord | Damage] = []
    for piece in scan(data):
        pieces.append(piece)
        if told_to_stop():
            raise Interrupted
    damage = [piece for piece in pieces if isinstance(piece, Damage)]
    if not damage and is_finished(path) and not has_damaged_summary(path, data):
        return Repaired(path=path, changed=False)
    _require_ours(path, data, pieces)
    loose = sum(isinstance(piece, ScannedRecord) and piece.opcode == Opcode.MESSAGE for piece in pieces)
    lost = tuple(f"bytes {d.start} to {d.end}: {d.cause}" for d in damage)
    lost += (f"{loose} messages outside chunks, which no recorder writes",) if loose else ()
    original = None
    with replacement_file(path) as beside:
        with beside.open("wb") as file:
            found = [piece for piece in pieces if isinstance(piece, ScannedRecord)]
            mended = Mended(file, data, found)
            for piece in found:
                mended.take(piece)
                if told_to_stop():
                    raise Interrupted
            mended.finish(lost)
            file.flush()
            os.fsync(file.fileno())
        if loose or any(d.end < len(data) for d in damage):
            original = _keep(path)
    return Repaired(path=path, changed=True, messages=mended.messages, lost=lost, original=original)


class Mended:
    """The repaired file, record by record; chunks and attachments are copied as they are."""

    def __init__(self, file: BinaryIO, data: Data, pieces: list[ScannedRecord]) -> None:
        self._file, self._data = file, data
        self._schemas, self._channels = definitions(data, pieces)
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: collections.Counter[int] = collections.Counter()
        self._attached: set[str] = set()
        self._counted = False
        headers = [Header.read(stream_of(content(data, p))) for p in pieces if p.opcode == Opcode.HEADER]
        file.write(MAGIC)
        for record in ((headers or [Header(PROFILE, PROFILE)])[0], *self._schemas.values(), *self._channels.values()):
            self._put(record)

    @property
    def messages(self) -> int:
        return self._counts.total()

    def take(self, piece: ScannedRecord) -> None:
        """Copy a chunk, an attachment or a metadata record; the rest is written anew."""
        inside = content(self._data, piece)
        match piece.opcode:
            case Opcode.CHUNK:
                self._take_chunk(piece, Chunk.read(stream_of(inside)))
            case Opcode.ATTACHMENT:
                self._take_attachment(piece, Attachment.read(stream_of(inside)))
            case Opcode.METADATA:
                self._take_metadata(Metadata.read(stream_of(inside)))

    def finish(self, lost: tuple[str, ...]) -> None:
        """Counts where there are none, what was lost, the summary."""
        if not self._counted:
            written = {self._channels[number].topic: f"written={n}" for number, n in self._counts.items()}
            self._take_metadata(Metadata("recorder", written))
        self._take_metadata(Metadata("repair", {str(number): text for number, text in enumerate(lost, 1)}))
        self._put(DataEnd(0))
        self._summary()

    def _take_chunk(self, piece: ScannedRecord, chunk: Chunk) -> None:
        indexes = self._indexes(unpacked(self._data, piece))
        if not indexes:
            return
        start = self._copy(piece)
        offsets: dict[int, int] = {}
        after = self._file.tell()
        for number, index in indexes.items():
            offsets[number] = self._file.tell()
            self._put(index)
        self._chunks.append(
            ChunkIndex(
                chunk_length=piece.end - piece.start,
                chunk_start_offset=start,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                message_end_time=chunk.message_end_time,
                message_index_length=self._file.tell() - after,
                message_index_offsets=offsets,
                message_start_time=chunk.message_start_time,
                uncompressed_size=chunk.uncompressed_size,
            )
        )

    def _indexes(self, inside: bytes) -> dict[int, MessageIndex]:
        """Where the messages of each channel lie in a chunk; counts them."""
        indexes: dict[int, MessageIndex] = {}
        for opcode, at, _ in records_in(inside):
            if opcode == Opcode.MESSAGE:
                number, _, log_ns, _ = MESSAGE.unpack_from(inside, at + HEAD.size)
                indexes.setdefault(number, MessageIndex(number, [])).records.append((log_ns, at))
                self._counts[number] += 1
        return indexes

    def _take_attachment(self, piece: ScannedRecord, attachment: Attachment) -> None:
        if attachment.name in self._attached:
            return
        self._attached.add(attachment.name)
        self._attachments.append(
            AttachmentIndex(
                create_time=attachment.create_time,
                data_size=len(attachment.data),
                length=piece.end - piece.start,
                log_time=attachment.log_time,
                media_type=attachment.media_type,
                name=attachment.name,
                offset=self._copy(piece),
            )
        )

    def _take_metadata(self, metadata: Metadata) -> None:
        self._counted |= metadata.name == "recorder"
        start = self._file.tell()
        self._put(metadata)
        self._metadata.append(MetadataIndex(length=self._file.tell() - start, name=metadata.name, offset=start))

    def _summary(self) -> None:
        """The summary section, as the format's own writer lays it out."""
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self.messages,
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        groups: list[tuple[Opcode, list[McapRecord]]] = [
            (Opcode.SCHEMA, [*self._schemas.values()]),
            (Opcode.CHANNEL, [*self._channels.values()]),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, [*self._chunks]),
            (Opcode.ATTACHMENT_INDEX, [*self._attachments]),
            (Opcode.METADATA_INDEX, [*self._metadata]),
        ]
        start = self._file.tell()
        builder, offsets = RecordBuilder(), []
        for opcode, records in groups:
            before = builder.count
            for record in records:
                record.write(builder)
            offsets.append(SummaryOffset(opcode, start + before, builder.count - before))
        offset_start = start + builder.count
        for offset in offsets:
            offset.write(builder)
        summary: bytes = builder.end()
        head = struct.pack("<BQQQ", Opcode.FOOTER, FOOTER_BYTES - HEAD.size, start, offset_start)
        self._file.write(summary)
        self._put(Footer(start, offset_start, zlib.crc32(head, zlib.crc32(summary))))
        self._file.write(MAGIC)

    def _put(self, record: McapRecord) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self._file.write(builder.end())

    def _copy(self, piece: ScannedRecord) -> int:
        start = self._file.tell()
        self._file.write(self._data[piece.start : piece.end])
        return start


def definitions(data: Data, pieces: list[ScannedRecord]) -> tuple[dict[int, Schema], dict[int, Channel]]:
    """Schemas and channels by number. Those in chunks, which have a checksum, go before those that stand bare."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    used: set[int] = set()

    def learn(opcode: int, inside: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream_of(inside))
            schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream_of(inside))
            channels.setdefault(channel.id, channel)

    for piece in pieces:
        if piece.opcode == Opcode.CHUNK:
            inside = unpacked(data, piece)
            for opcode, start, end in records_in(inside):
                if opcode == Opcode.MESSAGE:
                    used.add(int.from_bytes(inside[start + HEAD.size : start + HEAD.size + 2], "little"))
                else:
                    learn(opcode, inside[start + HEAD.size : end])
    for piece in pieces:
        if piece.opcode in {Opcode.SCHEMA, Opcode.CHANNEL}:
            learn(piece.opcode, content(data, piece))
    for number in used - channels.keys():
        channels[number] = Channel(id=number, topic=f"unknown/{number}", message_encoding="", metadata={}, schema_id=0)
    for channel in channels.values():
        if channel.schema_id not in schemas:
            channel.schema_id = 0
    return schemas, channels


def _require_ours(path: Path, data: Data, pieces: list[ScannedRecord | Damage]) -> None:
    found = [piece for piece in pieces if isinstance(piece, ScannedRecord)]
    profiles = [Header.read(stream_of(content(data, p))).profile for p in found if p.opcode == Opcode.HEADER]
    marked = any(
        Metadata.read(stream_of(content(data, piece))).name == PROFILE
        for piece in found
        if piece.opcode == Opcode.METADATA
    )
    if marked or PROFILE in profiles:
        return
    if profiles:
        raise UserError(f"{path}: profile '{profiles[0][:40]}': not recorded by PAANI")
    if data[: len(MAGIC)] != MAGIC and not any(piece.opcode == Opcode.CHUNK for piece in found):
        raise UserError(f"{path}: not an MCAP file")


def _keep(path: Path) -> Path:
    """A second name for the file, or where the disk has none to give, its only one for a moment. No other is lost."""
    names = (path.with_name(f"{path.name}.damaged{number or ''}") for number in itertools.count())
    original = next(name for name in names if not name.exists() or name.samefile(path))
    if original.exists():
        return original
    try:
        os.link(path, original)
    except OSError:
        path.rename(original)
    return original


def repair_all(folder: Path, told_to_stop: Callable[[], bool]) -> list[str]:
    """Repair every unfinished recording that nobody writes; a line for each that was mended or cannot be."""
    reports = []
    for path in sorted(folder.glob("*.mcap")):
        with contextlib.suppress(OSError):
            if is_finished(path):
                continue
        try:
            repaired = repair(path, told_to_stop)
            reports.append(f"{path.name}: repaired, {repaired.messages} messages")
        except InUse:
            continue
        except UserError as error:
            reports.append(str(error))
        except Interrupted:
            break
    return reports
