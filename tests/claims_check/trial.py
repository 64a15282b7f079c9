"""The trial of a row: its tests pass on the product as it is, and one of them fails on each of its mutants."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import msgspec

from tests.claims_check.table import Mutant, Row
from tests.claims_check.tree import FAILED, Tested, Tree

State = Literal["killed", "survived", "error"]
UNBROKEN_LIMIT_S = 3600.0
START_LIMIT_S = 60.0  # for Python, imports and collection
TIMES_UNBROKEN = 5.0  # a mutant's tests may take so many times what they take unbroken
DID_NOT_RUN = Tested("did not run")


class Verdict(msgspec.Struct, frozen=True):
    """Of one mutant of one row; without a mutant, of the row: its tests do not pass unbroken. `why` is one line."""

    key: str
    row: str
    state: State
    why: str = ""
    mutant: Mutant | None = None


class Record:
    """Verdicts in a file of JSON lines, so that an interrupted check goes on where it was."""

    def __init__(self, path: Path) -> None:
        self._path = path
        lines = path.read_bytes().splitlines(keepends=True) if path.is_file() else []
        whole = [line for line in lines if line.endswith(b"\n")]
        if whole != lines:  # the last line was cut off
            path.write_bytes(b"".join(whole))
        self._known = {each.key: each for each in (msgspec.json.decode(line, type=Verdict) for line in whole)}

    def find(self, key: str) -> Verdict | None:
        return self._known.get(key)

    def add(self, verdict: Verdict) -> Verdict:
        self._known[verdict.key] = verdict
        self._path.parent.mkdir(parents=True, exist_ok=True)
        with self._path.open("ab") as file:
            file.write(msgspec.json.encode(verdict) + b"\n")
        return verdict


def key_of(digest: str, name: str, row: Row, mutant: Mutant) -> str:
    """The same for the same product, tests, row and mutant, and for nothing else."""
    return hashlib.sha256(msgspec.json.encode((digest, name, row.test, mutant))).hexdigest()


def try_rows(rows: dict[str, Row], tree: Tree, digest: str, record: Record) -> Iterator[Verdict]:
    """A verdict for each mutant of these rows, in their order; known ones come from the record.

    The tests of all rows that are not known yet run once on the product as it is; a row of whose tests one fails, skips
    or does not run gives an error for each of its mutants.
    """
    keys = {name: [key_of(digest, name, row, mutant) for mutant in row.mutant] for name, row in rows.items()}
    unknown = [name for name, each in keys.items() if any(record.find(key) is None for key in each)]
    tests = sorted({test for name in unknown for test in rows[name].test})
    unbroken = tree.run_tests(tests, UNBROKEN_LIMIT_S).tests if tests else {}
    for name, row in rows.items():
        tested = {test: unbroken.get(test, DID_NOT_RUN) for test in row.test}
        faults = [f"{test} {each.state} {each.message}" for test, each in tested.items() if each.state != "passed"]
        for key, mutant in zip(keys[name], row.mutant, strict=True):
            if known := record.find(key):
                yield known
            elif faults:
                yield Verdict(key, name, "error", f"unbroken: {faults[0].strip()}", mutant)
            else:
                times_s = {test: each.time_s for test, each in tested.items()}
                yield record.add(_try_mutant(key, name, mutant, times_s, tree))


def _try_mutant(key: str, name: str, mutant: Mutant, times_s: dict[str, float], tree: Tree) -> Verdict:
    quick_first = sorted(times_s, key=times_s.__getitem__)
    with tree.changed_by(mutant):
        outcome = tree.run_tests(quick_first, START_LIMIT_S + TIMES_UNBROKEN * sum(times_s.values()), "-x")
    if outcome.exit_code == 0:
        return Verdict(key, name, "survived", "every cited test passes", mutant)
    if outcome.exit_code is None:
        return Verdict(key, name, "killed", outcome.tail, mutant)
    failed = [test for test, each in outcome.tests.items() if each.state == "failed"]
    if outcome.exit_code == FAILED and failed:
        return Verdict(key, name, "killed", failed[0], mutant)
    return Verdict(key, name, "error", " | ".join(outcome.tail.splitlines()[-3:]), mutant)
