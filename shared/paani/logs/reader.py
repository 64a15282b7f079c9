"""Reads logs: one MCAP file, or a folder of consecutive parts.

What can be read is read; the rest is named in `Log.problems`. Chunks are read one at a time, so memory is bounded.
"""

from __future__ import annotations

import functools
import heapq
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from paani.config import Config, decode_config
from paani.errors import UserError
from paani.logs.layout import FORMAT, PROFILE, Layout, Span, messages_in, span_bytes
from paani.logs.locate import layout_of
from paani.topic_names import present_name

SUFFIX = ".mcap"
CONFIG_FILE = "config.json"
MAX_DIGITS = 9  # of a number that a recording states
RECORDER = "recorder"  # the metadata record of what the recorder counted by topic


class Record(NamedTuple):
    """One recorded message: the exact payload, and when the recorder got it [us, wall]."""

    topic: str
    log_us: int
    seq: int
    data: bytes


class Log:
    """One recording. Made by `open_log`; `problems` grows when reading meets damage.

    start_us, end_us: when the first and the last message came [us, wall]; 0 where there is none.
    """

    def __init__(self, path: Path, parts: tuple[Layout, ...], problems: list[str]) -> None:
        self.path, self._parts, self.problems = path, parts, problems
        self.start_us = min((span.start_us for part in parts for span in part.spans), default=0)
        self.end_us = max((span.end_us for part in parts for span in part.spans), default=0)

    @property
    def topics(self) -> dict[str, int]:
        """Messages by channel, in all parts together."""
        counts: dict[str, int] = {}
        for part in self._parts:
            for topic, count in part.counts.items():
                counts[topic] = counts.get(topic, 0) + count
        return dict(sorted(counts.items()))

    @property
    def recordings(self) -> tuple[tuple[int, int], ...]:
        """First and last moment of each recording in this log: a folder has several where the recorder began again."""
        found: list[tuple[int, int]] = []
        for part in self._parts:
            if part.spans:
                start_us, end_us = min(s.start_us for s in part.spans), max(s.end_us for s in part.spans)
                if found and part.metadata.get("paani", {}).get("part") != "1":
                    start_us = found.pop()[0]
                found.append((start_us, end_us))
        return tuple(found)

    @property
    def files(self) -> tuple[Path, ...]:
        return tuple(part.path for part in self._parts)

    def config(self) -> Config:
        """The settings of the recorded system. Raises UserError."""
        data = self.attachment(CONFIG_FILE)
        if data is None:
            raise UserError(f"{self.path}: no {CONFIG_FILE} attached, so not recorded by PAANI")
        try:
            return decode_config(data)
        except UserError as error:
            raise UserError(f"{self.path}: {CONFIG_FILE}: {error}") from error

    def attachment(self, name: str) -> bytes | None:
        """The first attachment of that name."""
        return next((part.attachments[name] for part in self._parts if name in part.attachments), None)

    def schema(self, topic: str) -> bytes | None:
        """The schema that the first part with such a channel has for the messages of a topic."""
        for part in self._parts:
            if (number := part.schema_ids.get(topic, 0)) in part.schemas:
                return part.schemas[number]
        return None

    def metadata(self, name: str) -> dict[str, str]:
        """The metadata records of that name; a later part wins where a key repeats. Empty where there is none."""
        return {key: value for part in self._parts for key, value in part.metadata.get(name, {}).items()}

    def recorder_counts(self, word: str) -> dict[str, int]:
        """What the recorder counted as `word` (`dropped`, `missing`) of each topic, in all parts together."""
        counts: dict[str, int] = {}
        for part in self._parts:
            for topic, text in part.metadata.get(RECORDER, {}).items():
                for name, _, number in (each.partition("=") for each in text.split()):
                    if name == word and number.isdecimal() and len(number) <= MAX_DIGITS:
                        counts[topic] = counts.get(topic, 0) + int(number)
        return counts

    def records(
        self, topics: Iterable[str] | None = None, start_us: int | None = None, end_us: int | None = None
    ) -> Iterator[Record]:
        """Messages of these channels (None: all) with `start_us <= log_us <= end_us`, in log-time order."""
        wanted = None if topics is None else frozenset(topics)
        spans = [
            (span, part)
            for part in self._parts
            for span in part.spans
            if (end_us is None or span.start_us <= end_us) and (start_us is None or span.end_us >= start_us)
        ]
        records = _in_order(spans, functools.partial(self._span, wanted=wanted))
        if start_us is None and end_us is None:
            yield from records
        for record in records:
            if (start_us is None or record.log_us >= start_us) and (end_us is None or record.log_us <= end_us):
                yield record

    def _span(self, part: Layout, span: Span, wanted: frozenset[str] | None) -> list[Record]:
        data, problem = span_bytes(part.path, span)
        if problem:
            self._note(f"{part.path.name}: {problem}")
        ids = {number: topic for number, topic in part.channels.items() if wanted is None or topic in wanted}
        found = [Record(ids[number], ns // 1000, seq, raw) for number, seq, ns, raw in messages_in(data, ids)]
        found.sort(key=_log_us)
        return found

    def _note(self, problem: str) -> None:
        if problem not in self.problems:
            self.problems.append(problem)


def open_log(path: Path) -> Log:
    """One file, or a folder of consecutive parts. Raises UserError naming file and cause."""
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix == SUFFIX and not file.name.startswith("."))
        if not files:
            raise UserError(f"{path}: no {SUFFIX} file in this folder")
    else:
        files = [path]
    parts: list[Layout] = []
    problems: list[str] = []
    for file in files:
        try:
            layout = layout_of(file)
            _require_known_format(layout)
        except UserError as error:
            if len(files) == 1:
                raise
            problems.append(str(error))
            continue
        _take_present_names(layout)
        parts.append(layout)
        problems += [f"{file.name}: {problem}" for problem in layout.problems]
    if not parts:
        raise UserError(f"{path}: none of its {len(files)} files can be read; {problems[0]}")
    parts.sort(key=lambda part: min((span.start_us for span in part.spans), default=0))
    _require_one_drive(path, parts)
    return Log(path, tuple(parts), problems)


def _take_present_names(layout: Layout) -> None:
    """Channels, and what the recorder counted of them, under the present names of their topics."""
    counts, layout.counts = layout.counts, {}
    for topic, count in counts.items():
        name = present_name(topic)
        layout.counts[name] = layout.counts.get(name, 0) + count
    layout.channels = {number: present_name(topic) for number, topic in layout.channels.items()}
    layout.schema_ids = {present_name(topic): number for topic, number in layout.schema_ids.items()}
    if RECORDER in layout.metadata:
        layout.metadata[RECORDER] = {present_name(key): text for key, text in layout.metadata[RECORDER].items()}


def _require_known_format(layout: Layout) -> None:
    """Later formats may say other things in the same words."""
    version = layout.metadata.get(PROFILE, {}).get("format", "")
    if version.isdecimal() and (len(version) > MAX_DIGITS or int(version) > FORMAT):
        raise UserError(f"{layout.path}: recorded in format {version[:MAX_DIGITS]}; this program reads up to {FORMAT}")


def _require_one_drive(path: Path, parts: list[Layout]) -> None:
    configs = {part.attachments[CONFIG_FILE]: part.path for part in parts if CONFIG_FILE in part.attachments}
    if len(configs) > 1:
        names = ", ".join(file.name for file in configs.values())
        raise UserError(f"{path}: recordings with different settings ({names}); name one file")


def _in_order(spans: list[tuple[Span, Layout]], read: functools.partial[list[Record]]) -> Iterator[Record]:
    """Merge spans whose times may overlap, holding no more of them than do."""
    spans.sort(key=lambda pair: pair[0].start_us)
    held: list[Record] = []
    for span, part in spans:
        cut = 0
        while cut < len(held) and held[cut].log_us < span.start_us:
            cut += 1
        yield from held[:cut]
        new = read(part, span)
        held = new if cut == len(held) else list(heapq.merge(held[cut:], new, key=_log_us))
    yield from held


def _log_us(record: Record) -> int:
    return record.log_us
