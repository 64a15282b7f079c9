"""Observation journal: the newest evidence on disk, one line of JSON each, in two files of bounded size (P2, P5).

Perception keeps it whether or not a recorder runs. Its files are named unlike recordings (`*.mcap`), process logs
(`logs/`) and exported tables (`*.csv`).
"""

import os
from pathlib import Path

JOURNAL_FOLDER = "journal"
NEWER_FILE, OLDER_FILE = "observations.jsonl", "observations.older.jsonl"


class Journal:
    """Appends to the newer file; once that holds half of `max_bytes`, it replaces the older file.

    max_bytes: of both files together; 0 writes nothing. A disk that fails loses lines and nothing else.
    """

    def __init__(self, folder: Path, max_bytes: int) -> None:
        self._newer, self._older = folder / NEWER_FILE, folder / OLDER_FILE
        self._max_bytes = max_bytes // 2

    def append(self, line: bytes) -> bool:
        """Append one observation; false where it could not be written. A line that a crash cut short is ended first."""
        if not self._max_bytes:
            return True
        if len(line) + 2 > self._max_bytes:
            return False
        try:
            self._newer.parent.mkdir(mode=0o700, exist_ok=True)
            with self._newer.open("a+b", buffering=0) as file:
                size = file.seek(0, 2)
                if size and os.pread(file.fileno(), 1, size - 1) != b"\n":
                    line = b"\n" + line
                if size + len(line) + 1 <= self._max_bytes:
                    return file.write(line + b"\n") == len(line) + 1
            self._newer.replace(self._older)
            self._newer.write_bytes(line.lstrip(b"\n") + b"\n")
        except OSError:
            return False
        return True
