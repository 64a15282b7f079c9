"""The three parts of the seeds, and what `--seeds` says. Pure.

Failures are mended on development seeds alone. Validation seeds are measured now and then and never looked into. Fresh
seeds follow from the hash of the commit under test, so that nothing in that commit can have been mended on them.
"""

from __future__ import annotations

import hashlib
from enum import StrEnum

import msgspec

from paani.errors import UserError

VALIDATION_SEEDS = range(10_001, 20_000)
FRESH_SEEDS = range(100_000_000, 1_000_000_000)  # as many digits as `random:WORLD:SEED` takes
COUNT_SEPARATOR, COMMIT_SEPARATOR = ":", "@"
MAX_SEED_DIGITS = 18
MAX_SPAN = 100_000  # seeds of one call: more is a slip of the hand


class SeedPart(StrEnum):
    """What a seed may be used for. MIXED: of drives with seeds of several parts; no seed is in it."""

    DEVELOPMENT = "development"
    VALIDATION = "validation"
    FRESH = "fresh"
    MIXED = "mixed"


class SeedChoice(msgspec.Struct, frozen=True, kw_only=True):
    """What `--seeds` says. `count` 0: as many as the suite has. `span`: first and last, instead of a part's first.

    `commit` is a word that git understands; only FRESH has one.
    """

    part: SeedPart = SeedPart.DEVELOPMENT
    count: int = 0
    span: tuple[int, int] | None = None
    commit: str = ""

    @property
    def is_ledgered(self) -> bool:
        """Whether every drive is entered into the ledger."""
        return self.part is not SeedPart.DEVELOPMENT


def part_of_seed(seed: int) -> SeedPart:
    """The part that a seed belongs to."""
    if seed in VALIDATION_SEEDS:
        return SeedPart.VALIDATION
    return SeedPart.FRESH if seed in FRESH_SEEDS else SeedPart.DEVELOPMENT


def part_of_parts(parts: set[SeedPart]) -> SeedPart:
    """The one part of all drives, or MIXED."""
    return next(iter(parts)) if len(parts) == 1 else SeedPart.MIXED


def draw_fresh_seeds(commit: str, count: int) -> list[int]:
    """The first `count` fresh seeds of a commit, all different; fewer are the beginning of more.

    commit: all its hexadecimal digits.
    """
    found: dict[int, None] = {}
    number = 0
    while len(found) < count:
        digest = hashlib.sha256(f"paani trial fresh {commit} {number}".encode()).digest()
        found.setdefault(FRESH_SEEDS.start + int.from_bytes(digest[:8], "big") % len(FRESH_SEEDS))
        number += 1
    return list(found)


def parse_seeds(text: str) -> SeedChoice:
    """Parse `A..B`, `A`, `development[:N]`, `validation[:N]` or `fresh:N@COMMIT`. Raises UserError."""
    name, _, rest = text.partition(COUNT_SEPARATOR)
    if name not in {SeedPart.DEVELOPMENT, SeedPart.VALIDATION, SeedPart.FRESH}:
        return SeedChoice(span=_parse_span(text))
    part = SeedPart(name)
    number, at, commit = rest.partition(COMMIT_SEPARATOR)
    is_counted = _is_seed(number) and 0 < int(number) < len(VALIDATION_SEEDS)
    if part is SeedPart.FRESH:
        if not is_counted or not commit:
            raise UserError(f"--seeds {text}: is not fresh:N@COMMIT (HEAD is a commit)")
        return SeedChoice(part=part, count=int(number), commit=commit)
    if at or (COUNT_SEPARATOR in text and not is_counted):
        raise UserError(f"--seeds {text}: is not {name} or {name}:N")
    return SeedChoice(part=part, count=int(number) if number else 0)


def list_seeds(choice: SeedChoice, suite_count: int) -> list[int]:
    """The seeds of a choice; `commit` must be all digits of one by now. suite_count: how many where none is said."""
    if choice.span is not None:
        return list(range(choice.span[0], choice.span[1] + 1))
    count = choice.count or suite_count
    if choice.part is SeedPart.FRESH:
        return draw_fresh_seeds(choice.commit, count)
    first = VALIDATION_SEEDS.start if choice.part is SeedPart.VALIDATION else 1
    return list(range(first, first + count))


def _is_seed(text: str) -> bool:
    return text.isdecimal() and len(text) <= MAX_SEED_DIGITS


def _parse_span(text: str) -> tuple[int, int]:
    first, dots, last = text.partition("..")
    if not (_is_seed(first) and (_is_seed(last) if dots else True)):
        raise UserError(f"--seeds {text}: is none of A..B, development[:N], validation[:N], fresh:N@COMMIT")
    span = int(first), int(last or first)
    if span[0] > span[1]:
        raise UserError(f"--seeds {text}: is empty")
    if span[1] - span[0] >= MAX_SPAN:
        raise UserError(f"--seeds {text}: {span[1] - span[0] + 1} seeds (at most {MAX_SPAN})")
    for part in (VALIDATION_SEEDS, FRESH_SEEDS):
        if span[0] < part.stop and span[1] >= part.start:
            raise UserError(f"--seeds {text}: holds {part_of_seed(part.start)} seeds, which are asked for by that name")
    return span
