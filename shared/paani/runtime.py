"""The runtime folder: credentials, the stop latch, what one start hands to its processes."""

from __future__ import annotations

import contextlib
import fcntl
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from paani.config import BusConfig
from paani.errors import UserError

LOGS = "logs"  # the folder in it that has one file for each process that `paani up` starts


def runtime_path(config: BusConfig) -> Path:
    """Where the folder is to be: `bus.runtime_dir`, else `PAANI_RUNTIME_DIR`, else the user's state folder."""
    chosen = config.runtime_dir or os.environ.get("PAANI_RUNTIME_DIR", "")
    if chosen:
        return Path(chosen)
    return Path(os.environ.get("XDG_STATE_HOME", "") or Path.home() / ".local" / "state") / "paani"


def runtime_dir(config: BusConfig) -> Path:
    """The folder at `runtime_path`, made for its owner alone.

    Raises UserError for one that cannot be made, that belongs to somebody else, or that is no folder: what lies in it
    opens the bus.
    """
    folder = runtime_path(config)
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"bus.runtime_dir {folder}: {error.strerror}") from error
    found = folder.lstat()
    if stat.S_ISLNK(found.st_mode):
        raise UserError(f"bus.runtime_dir {folder}: is a link; name the folder itself")
    if found.st_uid != os.geteuid():
        raise UserError(f"bus.runtime_dir {folder}: belongs to another user; choose a folder of your own")
    if found.st_mode & 0o077:
        folder.chmod(0o700)
    return folder


@contextlib.contextmanager
def own_runtime_dir(config: BusConfig) -> Iterator[Path]:
    """The runtime folder, with its STOP latch, as one boat's for as long as the context lasts.

    The lock ends with the process that holds it, however it ends. Raises UserError while another process holds it:
    with one latch for two boats, whoever releases one would release both.
    """
    folder = runtime_dir(config)
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise UserError(
                f"bus.runtime_dir {folder}: in use by another boat, whose STOP latch lies there: stop that, or choose "
                "another folder (--set bus.runtime_dir=...)"
            ) from error
        yield folder
    finally:
        os.close(descriptor)


def require_unowned_runtime_dir(config: BusConfig) -> None:
    """Raises UserError where `own_runtime_dir` would."""
    with own_runtime_dir(config):
        pass


def write_private(path: Path, text: str) -> None:
    """Write a file only its owner can read, beside it first; on disk when this returns. Raises OSError."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.unlink(missing_ok=True)
    try:
        with os.fdopen(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as stream:
            stream.write(text)
            stream.flush()
            os.fsync(stream.fileno())
        beside.replace(path)
    finally:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
