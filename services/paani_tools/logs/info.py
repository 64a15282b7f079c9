"""What a recording holds, for people and for programs."""

from __future__ import annotations

import bisect
import datetime
from collections.abc import Callable
from pathlib import Path

import msgspec

from paani import keys
from paani import messages as m
from paani.logs.folder import KEEP, recordings
from paani.logs.reader import Log, Record
from paani.logs.repair import is_finished
from paani.undecodable import UNDECODABLE

MIB = 2**20


class TopicInfo(msgspec.Struct, frozen=True, kw_only=True):
    """One channel: its rate while it spoke, its longest silence; dropped by the recorder, missing before it."""

    topic: str
    messages: int
    rate_hz: float
    gap_s: float
    dropped: int = 0
    missing: int = 0


class ModelInfo(msgspec.Struct, frozen=True):
    name: str
    sha256: str


class LogInfo(msgspec.Struct, frozen=True, kw_only=True):
    """A recording. `direction_changes_per_min`: how often the advised direction became another; None without advice."""

    path: str
    files: int
    size_bytes: int
    start_us: int
    duration_s: float
    facts: dict[str, str]
    versions: dict[str, str]
    models: tuple[ModelInfo, ...]
    topics: tuple[TopicInfo, ...]
    advisories: int
    direction_changes_per_min: float | None
    problems: tuple[str, ...]


class Model(msgspec.Struct):
    name: str
    sha256: str


class Manifest(msgspec.Struct):
    models: tuple[Model, ...] = ()


class ChannelTimes:
    """How often one channel spoke, and its longest silence, of the time within recordings and not between them."""

    def __init__(self, at_us: int) -> None:
        self.messages, self.gaps = 1, 0
        self.gap_us = self.spoken_us = 0
        self._last_us = at_us

    def add(self, at_us: int, begun_us: int) -> None:
        """A message of the recording that began at `begun_us`."""
        if self._last_us >= begun_us:
            self.gap_us = max(self.gap_us, at_us - self._last_us)
            self.spoken_us += at_us - self._last_us
            self.gaps += 1
        self._last_us = at_us
        self.messages += 1


def info_of(log: Log, seen: Callable[[Record], None] = lambda record: None) -> LogInfo:
    """Reads all of it. `seen` is told every record, for whoever shows progress."""
    channels: dict[str, ChannelTimes] = {}
    directions = DirectionChanges()
    begins_us = sorted(start_us for start_us, _ in log.recordings)
    for record in log.records():
        seen(record)
        if record.topic in channels:
            begun = bisect.bisect_right(begins_us, record.log_us) - 1
            channels[record.topic].add(record.log_us, begins_us[begun] if begun >= 0 else 0)
        else:
            channels[record.topic] = ChannelTimes(record.log_us)
        if record.topic == keys.ADVISORY.name:
            directions.take(record.data)
    duration_s = sum(end_us - start_us for start_us, end_us in log.recordings) * 1e-6  # not what lies between them
    dropped, missing = log.recorder_counts("dropped"), log.recorder_counts("missing")
    return LogInfo(
        path=str(log.path),
        files=len(log.files),
        size_bytes=sum(file.stat().st_size for file in log.files),
        start_us=log.start_us,
        duration_s=round(duration_s, 3),
        facts={name: text for name, text in log.metadata("paani").items() if name not in {"started_us", "part"}},
        versions=_versions(log.attachment("versions.json")),
        models=_models(log.attachment("models.json")),
        topics=tuple(
            TopicInfo(
                topic=name,
                messages=one.messages,
                rate_hz=round(one.gaps * 1e6 / max(one.spoken_us, 1), 2),
                gap_s=round(one.gap_us * 1e-6, 3),
                dropped=dropped.get(name, 0),
                missing=missing.get(name, 0),
            )
            for name, one in sorted(channels.items())
        ),
        advisories=directions.advisories,
        direction_changes_per_min=_per_min(directions.changes, duration_s) if directions.advisories else None,
        problems=tuple(log.problems),
    )


def _per_min(count: int, duration_s: float) -> float:
    return round(60 * count / duration_s, 2) if duration_s > 0.0 else 0.0


class DirectionChanges:
    """Counts how often the advised direction becomes another."""

    def __init__(self) -> None:
        self._decoder = msgspec.json.Decoder(m.Advisory)
        self._last: m.Direction | None = None
        self.advisories = self.changes = 0

    def take(self, data: bytes) -> None:
        """One advisory; what cannot be decoded does not count."""
        try:
            direction = self._decoder.decode(data).direction
        except UNDECODABLE:
            return
        self.changes += self._last not in {None, direction}
        self._last = direction
        self.advisories += 1


def info_text(info: LogInfo) -> str:
    """A page for a terminal."""
    version = info.versions
    lines = [
        f"{info.path}: {info.files} {'file' if info.files == 1 else 'files'}, {info.size_bytes / MIB:.1f} MiB",
        f"{utc_text(info.start_us)}, {info.duration_s:.1f} s",
        ", ".join(f"{name} {text}" for name, text in info.facts.items()),
        f"paani {version.get('paani', '?')}, commit {version.get('commit') or '?'}",
        f"Python {version.get('python', '?')}, {version.get('platform', '?')}",
        *(f"model {model.name} {model.sha256[:16]}" for model in info.models),
    ]
    if info.direction_changes_per_min is not None:
        lines.append(f"{info.advisories} advisories, {info.direction_changes_per_min:g} changes of direction a minute")
    lines += ["", f"{'topic':<32} {'messages':>9} {'rate [Hz]':>10} {'silent [s]':>11} {'dropped':>8} {'missing':>8}"]
    lines += [
        f"{t.topic:<32} {t.messages:>9} {t.rate_hz:>10.2f} {t.gap_s:>11.2f} {t.dropped:>8} {t.missing:>8}"
        for t in info.topics
    ]
    lines += ["", *(f"problem: {problem}" for problem in info.problems)] if info.problems else []
    return "\n".join(lines) + "\n"


def list_text(folder: Path) -> str:
    """One line for each recording of a folder."""
    lines = []
    for path, size, kept in recordings(folder):
        state = "damaged original" if path.suffix != ".mcap" else "finished" if _whole(path) else "unfinished"
        lines.append(f"{path.name:<32} {size / MIB:>9.1f} MiB  {state}{f', kept ({KEEP})' if kept else ''}")
    return "\n".join(lines) + "\n"


def utc_text(at_us: int) -> str:
    """A stamp in words."""
    return datetime.datetime.fromtimestamp(at_us * 1e-6, tz=datetime.UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def _whole(path: Path) -> bool:
    try:
        return is_finished(path)
    except OSError:
        return False


def _versions(data: bytes | None) -> dict[str, str]:
    try:
        return msgspec.json.decode(data or b"{}", type=dict[str, str])
    except UNDECODABLE:
        return {}


def _models(data: bytes | None) -> tuple[ModelInfo, ...]:
    try:
        manifest = msgspec.json.decode(data or b"{}", type=Manifest)
    except UNDECODABLE:
        return ()
    return tuple(ModelInfo(model.name, model.sha256) for model in manifest.models)
