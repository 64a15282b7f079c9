"""Recordings in a folder: their names, and which of them must go."""

from __future__ import annotations

import datetime
import fcntl
import re
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from paani.errors import UserError

NAME = re.compile(r"\d{8}T\d{6}Z-\d+\.mcap(\.damaged\d*)?")  # with what a repair has set aside
KEEP = ".keep"


class Recording(NamedTuple):
    """A file of the folder; `kept` while a file `NAME.keep` lies beside it."""

    path: Path
    size_bytes: int
    kept: bool


def free_path(folder: Path, now_us: int, part: int) -> Path:
    """`<UTC>-<part>.mcap`; a later part number where the name is taken."""
    moment = datetime.datetime.fromtimestamp(now_us * 1e-6, tz=datetime.UTC).strftime("%Y%m%dT%H%M%SZ")
    while (path := folder / f"{moment}-{part}.mcap").exists():
        part += 1
    return path


def recordings(folder: Path) -> list[Recording]:
    """Every recording of the folder by name, which is by age."""
    found = []
    for path in sorted(folder.glob("*.mcap*"), key=_age):
        if not NAME.fullmatch(path.name):
            continue
        try:
            status = path.stat()
        except FileNotFoundError:  # deleted since the folder was read
            continue
        if stat.S_ISREG(status.st_mode):
            found.append(Recording(path, status.st_size, path.with_name(path.name + KEEP).exists()))
    return found


def too_old(found: Iterable[Recording], budget_bytes: float) -> list[Path]:
    """The oldest that are not kept, as many as must go for all to fit into the budget."""
    found = list(found)
    excess = sum(recording.size_bytes for recording in found) - budget_bytes
    gone = []
    for recording in found:
        if excess <= 0:
            break
        if not recording.kept:
            gone.append(recording.path)
            excess -= recording.size_bytes
    return gone


def require_folder(folder: Path) -> None:
    """Make the folder where it is missing. Raises UserError naming it when nothing can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".writable"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        raise UserError(f"recorder.folder {folder}: {error.strerror}") from error


def is_being_written(path: Path) -> bool:
    """Whether a recorder, or a repair, is writing this file."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def start_us(name: str) -> int:
    """When a recording began, to the second of its name [Unix us]; 0 where its digits are no time."""
    try:
        moment = datetime.datetime.strptime(name.partition("-")[0], "%Y%m%dT%H%M%SZ").replace(tzinfo=datetime.UTC)
    except ValueError:
        return 0
    return round(moment.timestamp() * 1e6)


def _age(path: Path) -> tuple[str, int]:
    moment, _, part = path.name.partition(".")[0].rpartition("-")
    return moment, int(part) if part.isdecimal() else 0
