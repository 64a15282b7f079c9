"""The newest observations on disk: one line of JSON each, in two files that together never exceed a size.

It is perception's own: there without a recorder, and no recording (`*.mcap`), process log (`logs/`) or table of an
export (`*.csv`) has its name.
"""

import os
from pathlib import Path

FOLDER, NAME, OLDER = "journal", "observations.jsonl", "observations.older.jsonl"


class Journal:
    """Appends to the newer file; when that is half the size, it takes the place of the older.

    max_bytes: of both together; 0 writes nothing. A disk that fails costs lines, nothing else.
    """

    def __init__(self, folder: Path, max_bytes: int) -> None:
        self._newer, self._older = folder / NAME, folder / OLDER
        self._max_bytes = max_bytes // 2

    def add(self, line: bytes) -> bool:
        """Append one observation; false where it could not be kept. A line cut by a crash is ended first."""
        if not self._max_bytes:
            return True
        if len(line) + 2 > self._max_bytes:
            return False
        try:
            self._newer.parent.mkdir(exist_ok=True)
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
