"""Sessions of clients that others wrote, as they went: `pytest --transcripts FOLDER` leaves a text of each."""

from __future__ import annotations

from pathlib import Path

from paani.clock import stopwatch_ms


class Transcript:
    """Lines with the seconds since it began: who, and what it said or what came of it."""

    def __init__(self) -> None:
        self._begun_ms = stopwatch_ms()
        self._lines: list[str] = []

    def note(self, who: str, text: str) -> None:
        """One line for each line of the text."""
        at_s = (stopwatch_ms() - self._begun_ms) * 1e-3
        self._lines += [f"{at_s:7.2f}  {who:8}  {line.rstrip()}" for line in text.splitlines() if line.strip()]

    def write(self, file: Path) -> None:
        """Its folder is made."""
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("\n".join((*self._lines, "")), encoding="utf-8")
