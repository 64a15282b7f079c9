"""Writes one recording: an MCAP file with a channel for every topic."""

from __future__ import annotations

import contextlib
import fcntl
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import msgspec
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Schema
from mcap.writer import CompressionType, Writer

from paani import keys
from paani import messages as m
from paani.logs import protobuf, viewer
from paani.logs.layout import FORMAT, PROFILE
from paani.logs.schema import json_schema
from paani.messages.header import Count, Stamp
from paani.undecodable import UNDECODABLE

CHUNK_BYTES = 256 * 1024
HEADER, UNREADABLE = "/header", "/unreadable"
JSON, PROTOBUF = "json", "protobuf"


class Head(msgspec.Struct, frozen=True):
    """What of a message's header the recorder needs."""

    source_us: Stamp
    seq: Count = 0
    epoch: Count = 0
    sent_us: Stamp = 0


class About(msgspec.Struct, frozen=True, kw_only=True):
    """What a recording was made of: attachments by name (JSON), and the facts of its metadata record."""

    version: str
    attachments: Mapping[str, bytes]
    facts: Mapping[str, str]


class LogWriter:
    """One file, made when constructed. Every method may raise OSError; `abandon` closes what is then left."""

    def __init__(self, path: Path, about: About, topics: Iterable[keys.Topic[Any]], now_us: int) -> None:
        self.path, self.started_us = path, now_us
        self._file = path.open("xb")
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._viewer = viewer.Viewer()
        self._header = msgspec.json.Decoder(m.PictureHeader)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # until this process ends: nobody repairs it
            self._begin(about, topics)
        except OSError:
            self.abandon()
            raise

    @property
    def size_bytes(self) -> int:
        """Bytes on disk, without the chunk in progress."""
        return self._file.tell()

    def write(self, topic: keys.Topic[Any], log_us: int, head: Head | None, data: bytes, attachment: bytes) -> None:
        """One message as it was on the bus; `head` is None where its header cannot be read.

        attachment: the header that travelled with picture bytes, else empty.
        """
        if head is None:
            self._add(self._unreadable(topic), log_us, log_us, 0, attachment + data)
            return
        sent_us, seq = head.sent_us, head.seq % 2**32
        if topic.stance is not keys.Stance.PICTURE:
            self._add(self._channels[topic.name], log_us, sent_us, seq, data)
            for channel, source_us, derived in self._viewer.derive(topic.name, data):
                self._add(self._channels[channel], log_us, source_us, 0, derived)
            return
        try:
            picture = viewer.picture(self._header.decode(attachment), data)
        except UNDECODABLE:
            self._add(self._unreadable(topic), log_us, sent_us, seq, attachment + data)
            return
        self._add(self._channels[topic.name], log_us, sent_us, seq, picture)
        self._add(self._channels[topic.name + HEADER], log_us, sent_us, seq, attachment)

    def flush(self) -> None:
        """Close the chunk and hand everything to the system: a crash of this process costs nothing before it."""
        self._writer.flush()

    def finish(self, counts: Mapping[str, str]) -> None:
        """Write counts and summary, and close."""
        self._writer.add_metadata("recorder", dict(counts))
        self._writer.finish()
        self._file.close()

    def abandon(self) -> None:
        """Close without a summary; `repair` adds it later."""
        with contextlib.suppress(OSError):
            self._file.close()

    def _begin(self, about: About, topics: Iterable[keys.Topic[Any]]) -> None:
        self._writer.start(profile=PROFILE, library=f"paani {about.version}")
        self._writer.add_metadata("paani", {"format": str(FORMAT), "started_us": str(self.started_us), **about.facts})
        started_ns = self.started_us * 1000
        for name, data in about.attachments.items():
            self._writer.add_attachment(started_ns, started_ns, name, "application/json", data)
        for topic in topics:
            self._add_topic(topic)
        for name, kind in viewer.CHANNELS.items():
            self._add_channel(name, PROTOBUF, kind, "viewer", 0.0)
        self._file.flush()

    def _add(self, channel: int, log_us: int, publish_us: int, sequence: int, data: bytes) -> None:
        self._writer.add_message(channel, log_us * 1000, data, publish_us * 1000, sequence)

    def _add_topic(self, topic: keys.Topic[Any]) -> None:
        kind = f"paani.{topic.type.__name__}"
        if topic.stance is keys.Stance.PICTURE:
            self._add_channel(topic.name, PROTOBUF, protobuf.COMPRESSED_IMAGE, topic.producer, topic.rate_hz)
            self._add_channel(topic.name + HEADER, JSON, kind, topic.producer, topic.rate_hz, topic.type)
        else:
            self._add_channel(topic.name, JSON, kind, topic.producer, topic.rate_hz, topic.type)

    def _add_channel(
        self, name: str, encoding: str, kind: str, producer: str, rate_hz: float, of: type[m.Message] | None = None
    ) -> None:
        """Schema and channel, once as the library does and once bare, so that a damaged chunk costs only itself."""
        if kind not in self._schemas:
            data, language = (protobuf.descriptors(kind), PROTOBUF) if of is None else (json_schema(of), "jsonschema")
            self._schemas[kind] = self._writer.register_schema(kind, language, data)
            self._bare(Schema(id=self._schemas[kind], data=data, encoding=language, name=kind))
        metadata = {"producer": producer, "rate_hz": f"{rate_hz:g}"}
        self._channels[name] = self._writer.register_channel(name, encoding, self._schemas[kind], metadata)
        self._bare(
            Channel(
                id=self._channels[name], schema_id=self._schemas[kind], topic=name, message_encoding=encoding,
                metadata=metadata,
            )
        )  # fmt: skip

    def _bare(self, record: Schema | Channel) -> None:
        builder = RecordBuilder()
        record.write(builder)
        self._file.write(builder.end())

    def _unreadable(self, topic: keys.Topic[Any]) -> int:
        name = topic.name + UNREADABLE
        if name not in self._channels:
            self._channels[name] = self._writer.register_channel(name, "", 0, {"producer": topic.producer})
        return self._channels[name]


def read_head(data: bytes) -> Head | None:
    """The header of a message, or None where it cannot be read."""
    try:
        return _HEAD.decode(data)
    except UNDECODABLE:
        return None


_HEAD = msgspec.json.Decoder(Head)
