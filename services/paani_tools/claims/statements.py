"""The statements of the paper, each with its proof, what is better here on purpose, or why it does not apply.

The table ships inside the wheel; in a checkout it is `tests/claims.toml`.
"""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path
from typing import Literal

import msgspec

from paani.errors import UserError
from paani.undecodable import UNREADABLE

SHIPPED = "claims.toml"
IN_CHECKOUT = Path(__file__).parents[3] / "tests" / SHIPPED
_ID = re.compile(r"([A-Z])(\d{1,4})")

State = Literal["proved", "improved", "exempt"]


class _Row(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    says: str
    test: tuple[str, ...] = ()
    mutant: tuple[dict[str, str], ...] = ()
    improved: str = ""
    exempt: str = ""


class Statement(msgspec.Struct, frozen=True, kw_only=True):
    """One statement. `proof`: tests as `file::function`, or the one sentence that says why it is exempt.

    improved: what is better here than in the paper on purpose, and how the paper's own form is kept; empty otherwise.
    """

    id: str
    says: str
    state: State
    proof: tuple[str, ...]
    improved: str = ""


def read_statements() -> tuple[Statement, ...]:
    """All statements, in the order of the paper. Raises UserError where the table is missing or malformed."""
    shipped = files("paani_tools.claims") / SHIPPED
    source = shipped if shipped.is_file() else IN_CHECKOUT
    try:
        rows = msgspec.toml.decode(source.read_bytes(), type=dict[str, _Row])
    except UNREADABLE as error:
        raise UserError(f"{source}: {error}") from error
    return tuple(_statement(name, row) for name, row in rows.items())


def chosen_statements(
    statements: tuple[Statement, ...], names: list[str], words: str, states: list[State]
) -> tuple[Statement, ...]:
    """Those of the ids or groups (`J`, `J7`, `j5-j10`), with the words in their text, in one of the states.

    Nothing given: all. Raises UserError for an id that does not exist.
    """
    wanted = {each for name in names for each in _ids(name, statements)}
    return tuple(
        each
        for each in statements
        if (not names or each.id in wanted)
        and words.lower() in each.says.lower()
        and (not states or each.state in states)
    )


def statements_text(statements: tuple[Statement, ...]) -> str:
    """A paragraph for each statement, then how many are in each state."""
    lines = []
    for each in statements:
        lines += [f"{each.id}  {each.says}", *([f"    improved: {each.improved}"] if each.improved else [])]
        lines += [f"    {'exempt' if each.state == 'exempt' else 'proved'}: {proof}" for proof in each.proof]
    counts = ", ".join(f"{sum(each.state == state for each in statements)} {state}" for state in _STATES)
    noun = "statement" if len(statements) == 1 else "statements"
    return "\n".join([*lines, f"{len(statements)} {noun}: {counts}"]) + "\n"


_STATES: tuple[State, ...] = ("proved", "improved", "exempt")


def _statement(name: str, row: _Row) -> Statement:
    if row.exempt:
        return Statement(id=name, says=row.says, state="exempt", proof=(row.exempt,))
    state: State = "improved" if row.improved else "proved"
    return Statement(id=name, says=row.says, state=state, proof=row.test, improved=row.improved)


def _ids(name: str, statements: tuple[Statement, ...]) -> set[str]:
    known = {each.id for each in statements}
    first, dash, last = name.upper().partition("-")
    found = {each for each in known if each == first or (first.isalpha() and each.startswith(first))}
    start, end = _ID.fullmatch(first), _ID.fullmatch(last)
    if dash and start and end and start[1] == end[1]:
        span = range(int(start[2]), int(end[2]) + 1)
        found = {each for each in known if each.startswith(start[1]) and int(each.removeprefix(start[1])) in span}
    elif dash:
        found = set()
    if not found:
        raise UserError(f"{name}: no such statement (`paani claims` lists all; `J` names a group, `J5-J10` a range)")
    return found
