"""The recording on disk: one open file at a time, flushed, rotated and kept within its budget. Time is passed in."""

from __future__ import annotations

import collections
import contextlib
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from paani import keys
from paani import messages as m
from paani.clock import has_passed
from paani.config import RecorderConfig
from paani.logs.folder import free_path, is_being_written, recordings, too_old
from paani.logs.writer import About, LogWriter
from paani_services.recorder.backlog import QueuedMessage
from paani_services.recorder.counts import MessageCounts, file_counts

MIB = 2**20
DISK_CHECK_PERIOD_S = 5.0
RETRY_PERIOD_S = 5.0  # between attempts to open a file after a failure


class Recording:
    """Writes messages to the open file. A disk that fails or fills up is a state (`problem`), never an exception."""

    def __init__(self, settings: RecorderConfig, about: About, topics: Sequence[keys.Topic[Any]]) -> None:
        self._settings, self._about, self._topics = settings, about, topics
        self._folder = Path(settings.folder)
        self._log: LogWriter | None = None
        self._part = 0
        self._counts_at_start: tuple[m.RecordedTopic, ...] = ()
        self._unflushed: list[str] = []
        self._finished: collections.deque[Path] = collections.deque()
        self._flushed_us = self._checked_us = self._failed_us = 0
        self.counts = MessageCounts()
        self.since_us = 0
        self.problem = ""
        self.free_bytes = 0

    @property
    def path(self) -> Path | None:
        """The file being written."""
        return self._log.path if self._log is not None else None

    @property
    def size_bytes(self) -> int:
        return self._log.size_bytes if self._log is not None else 0

    def write(self, messages: Sequence[QueuedMessage], now_us: int) -> None:
        """Write messages, and flush or rotate the file where due. What cannot be written is counted as dropped."""
        left = collections.deque(messages)
        try:
            self._maintain_files(now_us)
            while left and self._log is not None:
                topic = left[0].topic
                self._log.write(topic, left[0].log_us, left[0].head, left[0].data, left[0].attachment)
                self._unflushed.append(topic.name)
                left.popleft()
            if self._log is not None and has_passed(self._flushed_us, self._settings.flush_s * 1e6, now_us):
                self._flush(now_us)
        except OSError as error:
            self._fail(f"{self._folder}: {error.strerror}", now_us)
        for message in left:
            self.counts.count_dropped(message.topic.name)

    def close(self, messages: Sequence[QueuedMessage], now_us: int) -> None:
        """Write the last messages and finish the file."""
        self.write(messages, now_us)
        self._end_part(now_us)

    def sync_to_disk(self) -> None:
        """Have the operating system put the files on the disk; it may take long, so call it in a thread of its own."""
        paths = [self.path] if self.path is not None else []
        with contextlib.suppress(IndexError):
            while True:
                paths.append(self._finished.popleft())
        for path in paths:
            with contextlib.suppress(OSError), path.open("rb") as file:
                os.fdatasync(file.fileno())

    def _maintain_files(self, now_us: int) -> None:
        settings = self._settings
        if has_passed(self._checked_us, DISK_CHECK_PERIOD_S * 1e6, now_us) or self._log is None:
            self._checked_us = now_us
            self._check_disk(now_us)
        if self._log is not None:
            full = self._log.size_bytes >= settings.part_mib * MIB
            if full or has_passed(self._log.started_us, settings.part_s * 1e6, now_us):
                self._end_part(now_us)
        if self._log is None and not self.problem:
            self._begin_part(now_us)

    def _check_disk(self, now_us: int) -> None:
        """Delete the oldest recordings beyond the budget; pause recording while the disk has too little space left."""
        found = recordings(self._folder)
        kept = sum(recording.size_bytes for recording in found if recording.kept)
        others = [recording for recording in found if recording.path != self.path]
        for path in too_old(others, self._settings.budget_mib * MIB - self.size_bytes):
            if not is_being_written(path):
                path.unlink(missing_ok=True)
        self.free_bytes = shutil.disk_usage(self._folder).free
        problem = ""
        if self.free_bytes < self._settings.min_free_mib * MIB:
            problem = f"{self.free_bytes // MIB} MiB left on the disk (recorder.min_free_mib)"
        elif kept + self.size_bytes > self._settings.budget_mib * MIB:
            problem = f"recordings to be kept fill {kept // MIB} MiB (recorder.budget_mib)"
        if problem and self._log is not None:
            self._end_part(now_us)
        if problem or has_passed(self._failed_us, RETRY_PERIOD_S * 1e6, now_us):
            self.problem = problem

    def _begin_part(self, now_us: int) -> None:
        self._part += 1
        path = free_path(self._folder, now_us, self._part)
        about = About(
            version=self._about.version,
            attachments=self._about.attachments,
            facts={**self._about.facts, "part": str(self._part)},
        )
        self._log = LogWriter(path, about, self._topics, now_us)
        self.since_us = self.since_us or now_us
        self._counts_at_start = self.counts.topics()
        self._flushed_us = now_us

    def _flush(self, now_us: int) -> None:
        assert self._log is not None
        self._log.flush()
        self.counts.count_written(self._unflushed)
        self._unflushed.clear()
        self._flushed_us = now_us

    def _end_part(self, now_us: int) -> None:
        log = self._log
        if log is None:
            return
        try:
            self._flush(now_us)
            log.finish(file_counts(self.counts.topics(), self._counts_at_start))
            self._log = None
            self._finished.append(log.path)
        except OSError as error:
            self._fail(f"{log.path}: {error.strerror}", now_us)

    def _fail(self, problem: str, now_us: int) -> None:
        """Abandon the file as it is; the next start repairs it."""
        self.problem, self._failed_us = problem, now_us
        if self._log is not None:
            self._log.abandon()
            self._log = None
        for name in self._unflushed:
            self.counts.count_dropped(name)
        self._unflushed.clear()


def remove_empty_files(folder: Path) -> None:
    """Remove empty files, which a recorder leaves that died before its first byte."""
    for recording in recordings(folder):
        if recording.size_bytes == 0:
            with contextlib.suppress(OSError):
                recording.path.unlink()
