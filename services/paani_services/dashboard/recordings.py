"""The recordings of the recorder's folder: which there are, and what may be done to each.

A recording is named by its file name alone, as the recorder names them: what else lies in the folder, or elsewhere, is
none. Whoever writes one holds a lock on it while it is being written.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from paani.errors import UserError
from paani.logs.folder import KEEP, NAME, Recording, is_being_written, recordings, start_us
from paani.logs.locate import layout_of

MAX_ROWS = 1000


class RecordingRow(msgspec.Struct, frozen=True, kw_only=True):
    """One recording. start_us: from its name [Unix us]. duration_s: None while it is written, and where it is damaged.

    protected: it is kept whatever the budget, and cannot be deleted. running: it is being written.
    """

    name: str
    size_bytes: int
    start_us: int
    duration_s: float | None
    protected: bool
    running: bool


class RecordingList(msgspec.Struct, frozen=True, kw_only=True):
    """The newest recordings, newest first. left_out: how many older ones there are."""

    folder: str
    recordings: tuple[RecordingRow, ...]
    left_out: int


class RecordingRefusedError(Exception):
    """What was asked of a recording cannot be done; `status` is HTTP's."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


class RecordingFolder:
    """Methods read and write the disk: call them off the event loop."""

    def __init__(self, folder: str) -> None:
        """folder: of the settings; empty: nothing is recorded."""
        self._folder = folder
        self._durations_s: dict[tuple[str, int], float | None] = {}  # by name and size, so a grown file is read anew

    def list(self) -> RecordingList:
        """Empty, and without a folder, where nothing is recorded."""
        if not self._folder:
            return RecordingList(folder="", recordings=(), left_out=0)
        folder = self._require_folder()
        found = recordings(folder)
        rows = tuple(self._row(each) for each in reversed(found[-MAX_ROWS:]))
        return RecordingList(folder=str(folder), recordings=rows, left_out=len(found) - len(rows))

    def _row(self, recording: Recording) -> RecordingRow:
        path, size_bytes = recording.path, recording.size_bytes
        is_running = is_being_written(path)
        return RecordingRow(
            name=path.name,
            size_bytes=size_bytes,
            start_us=start_us(path.name),
            duration_s=None if is_running else self._duration_s(path, size_bytes),
            protected=recording.kept,
            running=is_running,
        )

    def find(self, name: str) -> Path:
        """The file of a recording. Raises RecordingRefusedError for what is none."""
        folder = self._require_folder()
        if not NAME.fullmatch(name) or not (folder / name).is_file() or (folder / name).is_symlink():
            raise RecordingRefusedError(404, "name: no recording of this name")
        return folder / name

    def protect(self, name: str, *, protected: bool) -> None:
        """Keep a recording whatever the budget, or no longer. Raises RecordingRefusedError."""
        path = self.find(name)
        mark = path.with_name(path.name + KEEP)
        try:
            if protected:
                mark.touch()
            else:
                mark.unlink(missing_ok=True)
        except OSError as error:
            raise RecordingRefusedError(500, f"{mark.name}: {error.strerror}") from error

    def delete(self, name: str) -> None:
        """Delete a recording. Raises RecordingRefusedError for one that is protected or being written."""
        path = self.find(name)
        if path.with_name(path.name + KEEP).exists():
            raise RecordingRefusedError(409, f"{name} is protected: take its protection off first")
        if is_being_written(path):
            raise RecordingRefusedError(409, f"{name} is being written")
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise RecordingRefusedError(500, f"{name}: {error.strerror}") from error

    def _require_folder(self) -> Path:
        if not self._folder:
            raise RecordingRefusedError(
                404, "recorder.folder: not set, so nothing is recorded (`paani up --record DIR`)"
            )
        return Path(self._folder)

    def _duration_s(self, path: Path, size_bytes: int) -> float | None:
        key = (path.name, size_bytes)
        if key not in self._durations_s:
            self._durations_s[key] = _read_duration_s(path)
        return self._durations_s[key]


def _read_duration_s(path: Path) -> float | None:
    """From the first message to the last; None where that cannot be told."""
    try:
        spans = layout_of(path).spans
    except UserError:
        return None
    return (max(span.end_us for span in spans) - min(span.start_us for span in spans)) * 1e-6 if spans else None
