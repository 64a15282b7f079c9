"""The ledger of drives whose seeds nobody may mend on: a JSON line when a seed is drawn, one when its drive ends.

Lines are only ever appended, whole, and none twice, whoever else enters drives at the same time. A drawn seed without a
result therefore stays visible, and so does every commit that seeds were drawn for. The file belongs into the
repository, whose history shows a line that was taken away.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec

from paani.errors import UserError
from paani.undecodable import UNDECODABLE
from paani_sim.trials.drive_states import DriveOutcome
from paani_sim.trials.policies import Policy
from paani_sim.trials.result import TrialResult
from paani_sim.trials.seed_parts import SeedPart, part_of_seed
from paani_sim.trials.trial_cases import TrialCase


class LedgerKey(msgspec.Struct, frozen=True, kw_only=True):
    """Which drive: of this commit with these settings."""

    part: SeedPart
    commit: str
    condition: str
    seed: int
    policy: Policy
    sets: tuple[str, ...] = ()


class LedgerDraw(LedgerKey, frozen=True, kw_only=True, tag="drawn", tag_field="entry"):
    """A drive that was asked for: written before it begins."""


class LedgerResult(LedgerKey, frozen=True, kw_only=True, tag="driven", tag_field="entry"):
    """What came of it. `result_sha256`: of the result's JSON, which an equal drive of the same code repeats."""

    why: DriveOutcome
    collisions: int
    collisions_visible: int
    near_misses: int
    encounters: int
    distance_m: float
    result_sha256: str


class LedgerCounts(msgspec.Struct, frozen=True, kw_only=True):
    """Of one commit and these settings: drives drawn, with a result, and that went otherwise when driven again.

    `commits`: how many commits the ledger has draws of this part for.
    """

    drawn: int
    with_result: int
    differing: int
    commits: int


LedgerEntry = LedgerDraw | LedgerResult
_Key = tuple[str, str, int, Policy, tuple[str, ...]]


class Ledger:
    """One ledger file, for one commit and one set of settings."""

    def __init__(self, path: Path, commit: str, sets: Sequence[str]) -> None:
        """Raises UserError where the file cannot be read or holds a line that is no entry."""
        self._path, self._commit, self._sets = path, commit, tuple(sets)
        entries = read_ledger(path)
        self._drawn = {_key(each) for each in entries if isinstance(each, LedgerDraw)}
        self._results: dict[_Key, set[str]] = {}
        self._commits = {(each.part, each.commit) for each in entries}
        for entry in entries:
            if isinstance(entry, LedgerResult):
                self._results.setdefault(_key(entry), set()).add(entry.result_sha256)

    def enter_draws(self, cases: Iterable[TrialCase]) -> None:
        """Append a line for each drive that is not in it. Raises UserError where that fails."""
        fresh = [draw for case in cases if _key(draw := self._draw(case)) not in self._drawn]
        _append(self._path, fresh)
        self._drawn.update(map(_key, fresh))
        self._commits.update((each.part, each.commit) for each in fresh)

    def enter_result(self, case: TrialCase, result: TrialResult) -> None:
        """Append a drive's result unless the very same one is there. Raises UserError where that fails."""
        draw, data = self._draw(case), msgspec.json.encode(result)
        checksum = hashlib.sha256(data).hexdigest()
        known = self._results.setdefault(_key(draw), set())
        if checksum in known:
            return
        entry = LedgerResult(
            **msgspec.structs.asdict(draw),
            why=result.why,
            collisions=result.collisions,
            collisions_visible=result.collisions_visible,
            near_misses=result.near_misses,
            encounters=sum(each.what != "bank" for each in result.encounters),
            distance_m=result.distance_m,
            result_sha256=checksum,
        )
        _append(self._path, [entry])
        known.add(checksum)

    def count(self, part: SeedPart) -> LedgerCounts:
        """Counts of this commit's and settings' drives."""
        own = [key for key in self._drawn if key[0] == self._commit and key[4] == self._sets]
        own = [key for key in own if part_of_seed(key[2]) is part]
        return LedgerCounts(
            drawn=len(own),
            with_result=sum(key in self._results for key in own),
            differing=sum(len(self._results.get(key, ())) > 1 for key in own),
            commits=len({commit for of, commit in self._commits if of is part}),
        )

    def _draw(self, case: TrialCase) -> LedgerDraw:
        return LedgerDraw(
            part=part_of_seed(case.seed),
            commit=self._commit,
            condition=case.condition,
            seed=case.seed,
            policy=case.policy,
            sets=self._sets,
        )


def read_ledger(path: Path) -> list[LedgerEntry]:
    """Read all entries; none where there is no file. Raises UserError naming the line that is no entry."""
    try:
        lines = path.read_bytes().splitlines()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise UserError(f"--ledger {path}: {error.strerror}") from error
    found: list[LedgerEntry] = []
    for number, line in enumerate(lines, 1):
        try:
            found.append(msgspec.json.decode(line, type=LedgerEntry))
        except UNDECODABLE as error:
            raise UserError(f"--ledger {path}: line {number} is no entry: {error}") from error
    return found


def _append(path: Path, entries: Sequence[LedgerEntry]) -> None:
    """Append the lines that are not there by now, on the disk when it returns; all of them or none."""
    if not entries:
        return
    try:
        with path.open("a+b", buffering=0) as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            file.seek(0)
            before = file.read()
            held = set(before.splitlines())
            lines = [line for line in map(msgspec.json.encode, entries) if line not in held]
            start = b"" if before.endswith(b"\n") or not before else b"\n"
            data = start + b"".join(line + b"\n" for line in lines)
            if file.write(data) < len(data):
                file.truncate(len(before))
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(file.fileno())
    except OSError as error:
        raise UserError(f"--ledger {path}: {error.strerror}") from error


def _key(entry: LedgerEntry) -> _Key:
    return entry.commit, entry.condition, entry.seed, entry.policy, entry.sets
