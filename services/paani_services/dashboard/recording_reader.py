"""Reads a recording for the page: `python -m paani_services.dashboard.recording_reader NICE series|frames FILE ...`.

A process of its own, lower in priority by NICE: reading a recording takes the processor for seconds, and neither the
server nor a boat may wait for it. What it writes to standard output is the body of the answer; a recording that cannot
be read is one line on standard error and exit code 2.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

import msgspec
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.errors import UserError
from paani.logs.pictures import RecordedPicture, paired_pictures
from paani.logs.reader import Log, Record, open_log
from paani.undecodable import UNDECODABLE
from paani_services.dashboard.frames import FrameHeader, encode_frame, pack_frames
from paani_services.dashboard.hub import Event
from paani_services.dashboard.operator_events import describe_operator_change
from paani_services.dashboard.page_state import page_settings
from paani_services.dashboard.time_series import SAMPLE_PERIOD_US, SAMPLED, Sample, Series, columns_of, sample_of

THIN_US = 90_000  # people read numbers no faster than ten times a second
MAX_SAMPLES, MAX_EVENTS = 7200, 1000  # two hours: a part of a recording has ten minutes
MAX_BYTES = 32 << 20
SETTINGS_KEY = "dashboard/settings"

T = TypeVar("T", bound=m.Message)


class NewestRecorded:
    """The newest message of each topic at one moment of a recording [Unix us]."""

    def __init__(self) -> None:
        self._newest: dict[str, tuple[m.Message, int]] = {}
        self.now_us = 0

    def put(self, name: str, message: m.Message, at_us: int) -> None:
        self._newest[name] = (message, at_us)

    def __call__(self, topic: keys.Topic[T]) -> T | None:
        message, at_us = self._newest.get(topic.name, (None, 0))
        is_fresh = (self.now_us - at_us) * 1e-6 <= topic.fresh_s
        return message if is_fresh and isinstance(message, topic.type) else None


def read_series(log: Log) -> Series:
    """Samples of every second and the events of a recording. Raises UserError."""
    services = log.config().services
    topics: dict[str, keys.Topic[Any]] = {topic.name: topic for topic in SAMPLED}
    topics |= {topic.name: topic for topic in map(keys.health, services)}
    newest, samples, events = NewestRecorded(), list[Sample](), list[Event]()
    decoders = {name: msgspec.json.Decoder(topic.type) for name, topic in topics.items()}
    before: dict[str, m.Message] = {}
    due_us = log.start_us
    for record in log.records(topics):
        while record.log_us > due_us and len(samples) < MAX_SAMPLES:
            newest.now_us = due_us
            samples.append(sample_of(newest, services, due_us))
            due_us += SAMPLE_PERIOD_US
        try:
            message = decoders[record.topic].decode(record.data)
        except UNDECODABLE:  # of another version, or damaged
            continue
        newest.put(record.topic, message, record.log_us)
        events += _events(before.get(record.topic), message, record.log_us)
        before[record.topic] = message
    newest.now_us = due_us = log.end_us
    samples.append(sample_of(newest, services, due_us))
    return Series(samples=columns_of(samples), events=tuple(events[-MAX_EVENTS:]))


def read_frames(log: Log, from_us: int, to_us: int) -> bytes:
    """The frames that a page is given of this time, after those of the settings. Raises UserError."""
    settings = replace(page_settings(log.config()), mode="replay")
    head = encode_frame(SETTINGS_KEY, FrameHeader(age_ms=0, at_us=from_us), msgspec.json.encode(settings))
    frames, total_bytes = [head], len(head)
    for frame in _frames(log, from_us, to_us):
        total_bytes += len(frame)
        if total_bytes > MAX_BYTES:
            raise UserError(f"{log.path.name}: more than {MAX_BYTES >> 20} MiB in this time")
        frames.append(frame)
    return pack_frames(frames)


def _frames(log: Log, from_us: int, to_us: int) -> Iterator[bytes]:
    graph = log.config().bus.graph
    topics: dict[str, keys.Topic[Any]] = {
        topic.name: topic for topic in keys.topics_in(graph) if topic.type is not m.Step
    } | {topic.name: topic for topic in map(keys.health, keys.services_in(graph))}
    pictures = [name for name, topic in topics.items() if topic.stance is keys.Stance.PICTURE]
    names = [*topics, *(f"{name}/header" for name in pictures)]
    sent_us: dict[str, int] = {}
    for item in paired_pictures(log.records(names, from_us, to_us), pictures):
        if item.log_us - sent_us.get(item.topic, -THIN_US) < THIN_US:
            continue
        with contextlib.suppress(*UNDECODABLE):  # of another version, or damaged
            frame = _frame(item, topics[item.topic])
            sent_us[item.topic] = item.log_us
            yield frame


def _frame(item: Record | RecordedPicture, topic: keys.Topic[Any]) -> bytes:
    """Raises what decoding does for what the page could not read."""
    if isinstance(item, RecordedPicture):
        msgspec.json.decode(item.header, type=topic.type)
        header = FrameHeader(age_ms=0, picture=msgspec.Raw(item.header), at_us=item.log_us)
        return encode_frame(item.topic, header, item.data)
    msgspec.json.decode(item.data, type=topic.type)
    return encode_frame(item.topic, FrameHeader(age_ms=0, at_us=item.log_us), item.data)


def _events(before: m.Message | None, now: m.Message, at_us: int) -> tuple[Event, ...]:
    """Lines of the log, as the page of that drive had them."""
    if isinstance(now, m.OperatorState):
        return describe_operator_change(before if isinstance(before, m.OperatorState) else None, now, at_us)
    if not isinstance(now, m.Advisory):
        return ()
    if isinstance(before, m.Advisory) and (before.direction, before.reason) == (now.direction, now.reason):
        return ()
    level = "stop" if now.direction in {m.Direction.STOP, m.Direction.NO_DATA} else "info"
    return (Event(at_us, level, f"{now.direction.value.replace('_', ' ')}: {now.reason.value}"),)


def main(arguments: list[str]) -> int:
    """`NICE series FILE`, or `NICE frames FILE FROM_US TO_US`."""
    os.nice(int(arguments[0]))
    try:
        log = open_log(Path(arguments[2]))
        is_series = arguments[1] == "series"
        body = msgspec.json.encode(read_series(log)) if is_series else read_frames(log, *map(int, arguments[3:5]))
    except UserError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    sys.stdout.buffer.write(body)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
