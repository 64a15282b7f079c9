"""What became of the mutants: which were noticed, which were not, and which nobody could notice."""

from __future__ import annotations

import ast
import difflib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec

from paani_sim.trials.intervals import wilson_interval

BAR_FRAC = 0.9  # of each file's mutants that were tried and change something
EQUIVALENT = Path(__file__).with_name("equivalent.toml")
NOTICED = {1, 3, 24, 36, 152, 255, -9, -24}  # exit codes of pytest and of what ends a run without end
OUT_OF_TIME = {24, 36, 152, -24}  # of these; a busy machine makes some that are none
UNTRIED = None


class Equivalent(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A change of one line after which the function does what it did before. `to`: each way to change it so."""

    file: str
    function: str
    line: str
    to: tuple[str, ...]
    why: str


class Change(NamedTuple):
    """A mutant, by its lines that differ, without their indentation."""

    name: str
    function: str
    before: str
    after: str


class Verdict(NamedTuple):
    """Of one file's mutants: how many there are, how many were noticed, and those that were not."""

    file: str
    total: int
    untried: int
    noticed: int
    out_of_time: int
    survivors: tuple[Change, ...]
    equivalent: tuple[Change, ...]
    stale: tuple[Equivalent, ...]  # rows that name no survivor, though all mutants were tried

    @property
    def counted(self) -> int:
        """Those that were tried, and change something."""
        return self.noticed + len(self.survivors)


def load_equivalents() -> tuple[Equivalent, ...]:
    """The rows of `equivalent.toml`. Raises msgspec.ValidationError."""
    return tuple(msgspec.toml.decode(EQUIVALENT.read_bytes(), type=dict[str, list[Equivalent]])["mutant"])


def judge_file(mutants: Path, file: str, equivalents: tuple[Equivalent, ...]) -> Verdict:
    """Read mutmut's record of one file. mutants: its folder of changed files."""
    codes: dict[str, int | None] = json.loads((mutants / f"{file}.meta").read_text())["exit_code_by_key"]
    left = [name for name, code in codes.items() if code is not UNTRIED and code not in NOTICED]
    rows = [row for row in equivalents if row.file == file]
    changes = {change: _row_of(change, rows) for change in _changes(mutants / file, left)}
    untried = sum(code is UNTRIED for code in codes.values())
    used = {id(row): {change.after for change, of in changes.items() if of is row} for row in rows}
    return Verdict(
        file=file,
        total=len(codes),
        untried=untried,
        noticed=len(codes) - len(left) - untried,
        out_of_time=sum(code in OUT_OF_TIME for code in codes.values()),
        survivors=tuple(change for change, row in changes.items() if row is None),
        equivalent=tuple(change for change, row in changes.items() if row is not None),
        stale=() if untried else tuple(row for row in rows if used[id(row)] != set(row.to)),
    )


def summary(verdicts: list[Verdict]) -> tuple[str, bool]:
    """Survivors, a line for each file and one for all; and whether that is enough."""
    lines = []
    for verdict in verdicts:
        lines += [f"not noticed: {c.name}\n    - {c.before}\n    + {c.after}" for c in verdict.survivors]
    lines += [f"{EQUIVALENT.name}: no such survivor: {row.function}: {row.line}" for v in verdicts for row in v.stale]
    for verdict in verdicts:
        apart = [f"{len(verdict.equivalent)} equivalent"] * bool(verdict.equivalent)
        apart += [f"{verdict.out_of_time} noticed by running out of time"] * bool(verdict.out_of_time)
        apart += [f"{verdict.untried} not tried"] * bool(verdict.untried)
        lines.append(f"{verdict.file}: {_share(verdict.noticed, verdict.counted)}" + "".join(f", {x}" for x in apart))
    noticed, counted = sum(v.noticed for v in verdicts), sum(v.counted for v in verdicts)
    low, high = wilson_interval(noticed, counted)
    lines.append(f"noticed: {_share(noticed, counted)} [{low:.1%}, {high:.1%}], bar {BAR_FRAC:.0%} of each file")
    is_enough = all(v.noticed >= BAR_FRAC * v.counted and not v.stale for v in verdicts)
    return "\n".join(lines), is_enough and counted > 0


def _share(noticed: int, counted: int) -> str:
    return f"{noticed} of {counted}" + (f", {noticed / counted:.1%}" if counted else "")


def _row_of(change: Change, rows: list[Equivalent]) -> Equivalent | None:
    found = (r for r in rows if (r.function, r.line) == (change.function, change.before) and change.after in r.to)
    return next(found, None)


def _changes(path: Path, names: list[str]) -> Iterator[Change]:
    """The mutants of these names, out of the file in which mutmut keeps each function with all its mutants."""
    source = path.read_text(encoding="utf-8")
    lines = source.splitlines()
    functions = {
        node.name: lines[node.lineno - 1 : node.end_lineno]
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    }
    for name in names:
        mangled = name.rpartition(".")[2]
        stem = mangled.rpartition("__mutmut_")[0]
        before, after = functions[f"{stem}__mutmut_orig"], functions[mangled]
        after = [line.replace(mangled, f"{stem}__mutmut_orig") for line in after]
        pieces = [line for line in difflib.ndiff(before, after) if line[:2] in {"- ", "+ "}]
        old, new = (" ".join(line[2:].strip() for line in pieces if line[0] == sign) for sign in "-+")
        yield Change(name, re.sub("^x_|^xǁ", "", stem).replace("ǁ", "."), old, new)
