"""What a decoder under fuzzing is: what it is given, how it is damaged, and what counts as refused."""

from __future__ import annotations

import random
import re
from abc import ABC, abstractmethod
from pathlib import Path

from paani.errors import UserError

MAX_LINE = 2000  # characters of an error message; a longer one repeats what was given


class MotionError(AssertionError):
    """Thrust where there may be none, or other thrust than the honest one."""


class ContractError(AssertionError):
    """A refusal that is none: several lines, or let in what nobody may let in."""


class Target(ABC):
    """One decoder, or a chain of them. `share`: of all payloads, relative to the other targets."""

    name: str
    share: int = 10

    def __init__(self, folder: Path, rng: random.Random) -> None:
        """folder: its own, empty."""
        self.folder, self.rng = folder, rng

    @abstractmethod
    def payload(self) -> bytes:
        """The next hostile payload."""

    @abstractmethod
    def take(self, data: bytes) -> str:
        """Give it to the decoder: empty where it was let in, else why it was refused. What it raises is a crash."""

    def close(self) -> None:  # noqa: B027  # most have nothing to close
        """After the last payload."""


def refusal_of(error: UserError, path: Path | None = None) -> str:
    """The kind of a refusal, without what changes from one to the next. Raises ContractError."""
    text = str(error)
    if "\n" in text or "\r" in text or not text or len(text) > MAX_LINE:
        raise ContractError(f"not one line: {text[:300]!r} ({len(text)} characters)")
    if path is not None and path.name not in text:
        raise ContractError(f"does not name {path.name}: {text[:300]}")
    kind = text.rpartition(f"{path.name}: ")[2] if path is not None else text
    kind = re.sub(r"`[^`]*`|'[^']*'|\"[^\"]*\"", "_", kind)
    kind = re.sub(r"[\[(].*?[\])]", "", kind)
    return re.sub(r"[0-9][0-9.e+-]*", "N", kind).strip()[:48] or "refused"
