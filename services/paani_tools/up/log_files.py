"""The log file of one child process, bounded in size: the newest lines, and those before them in a second file."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import BinaryIO

MAX_BYTES = 4 << 20  # of each of the two files: some 40,000 lines


def open_log(path: Path, *, afresh: bool) -> BinaryIO:
    """For a child to append to. afresh: what earlier runs wrote is dropped."""
    if afresh:
        path.unlink(missing_ok=True)
        _older(path).unlink(missing_ok=True)
    return path.open("ab")


def keep_bounded(path: Path, max_bytes: int = MAX_BYTES) -> None:
    """Move what is in the file to `<name>.1` once it exceeds `max_bytes`; the child goes on appending to the file.

    Lines that the child writes during the copy may be lost.
    """
    try:
        if path.stat().st_size > max_bytes:
            shutil.copyfile(path, _older(path))
            os.truncate(path, 0)
    except OSError:  # a full or read-only disk must not stop the boat's processes
        return


def _older(path: Path) -> Path:
    return path.with_name(f"{path.name}.1")
