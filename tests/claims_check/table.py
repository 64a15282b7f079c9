"""The table of statements, `tests/claims.toml`, and everything that can be wrong with it without running a test."""

from __future__ import annotations

import ast
import functools
from pathlib import Path

import msgspec

from paani.errors import UserError

TABLE = "tests/claims.toml"
# A to W: statements; X: the figures; Y: the tables; Z: what the paper leaves unmeasured.
COUNTS = {
    "A": 12, "B": 17, "C": 15, "D": 11, "E": 7, "F": 4, "G": 11, "H": 6, "I": 22, "J": 19, "K": 10, "L": 5, "M": 11,
    "N": 8, "O": 5, "P": 5, "Q": 6, "R": 11, "S": 12, "T": 6, "U": 10, "V": 24, "W": 15,
    "X": 8, "Y": 11, "Z": 4,
}  # fmt: skip
IDS = tuple(f"{letter}{number}" for letter, count in COUNTS.items() for number in range(1, count + 1))


class Mutant(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"before": "from", "after": "to"}):
    """A small change of the product: in `file`, below the checkout, the one occurrence of `before` becomes `after`."""

    file: str
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.file}: `{self.before}` -> `{self.after}`"


class Row(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One statement: what it says; the tests that prove it, and mutants that they must catch; or why it is exempt.

    `improved`: what is better here than in the paper on purpose, with its figure, and how the paper's form is kept.
    """

    says: str
    test: tuple[str, ...] = ()
    mutant: tuple[Mutant, ...] = ()
    improved: str = ""
    exempt: str = ""


def read_table(root: Path) -> dict[str, Row]:
    """Every row by its id. Raises UserError where the file is missing or malformed."""
    try:
        return msgspec.toml.decode((root / TABLE).read_bytes(), type=dict[str, Row])
    except (OSError, msgspec.DecodeError) as error:
        raise UserError(f"{root / TABLE}: {error}") from error


def find_faults(table: dict[str, Row], root: Path) -> list[str]:
    """One line for each fault of the table, each beginning with the row's id; none where every row can be run."""
    functions: dict[str, set[str]] = {}
    faults = [f"{name}: no such statement of the paper" for name in table if name not in IDS]
    for name, row in table.items():
        if bool(row.test) == bool(row.exempt):
            faults.append(f"{name}: needs either `test` or `exempt`")
        if (row.improved or row.mutant) and not row.test:
            faults.append(f"{name}: `improved` and `mutant` need a `test`")
        faults += [f"{name}: {fault}" for test in row.test if (fault := _fault_of_test(test, root, functions))]
        faults += [f"{name}: {fault}" for mutant in row.mutant if (fault := _fault_of_mutant(mutant, root))]
    return faults


def _fault_of_test(test: str, root: Path, functions: dict[str, set[str]]) -> str:
    file, _, function = test.partition("::")
    if file not in functions:
        path = root / file
        tree = ast.parse(path.read_text(encoding="utf-8")) if path.is_file() else ast.Module([], [])
        functions[file] = {n.name for n in tree.body if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)}
    return "" if function in functions[file] else f"no such test: {test}"


def _fault_of_mutant(mutant: Mutant, root: Path) -> str:
    path = root / mutant.file
    if not path.is_file():
        return f"no such file: {mutant.file}"
    source = path.read_text(encoding="utf-8")
    found = source.count(mutant.before) if mutant.before else 0
    if found != 1:
        return f"`from` occurs {found} times in {mutant.file}, not once: {mutant.before!r}"
    if path.suffix != ".py":
        return "" if mutant.before != mutant.after else f"changes nothing: {mutant}"
    statement = _statement_around(source, mutant.before)
    try:
        after = _code(statement.replace(mutant.before, mutant.after))
    except SyntaxError as error:
        return f"is no Python any more: {mutant} ({error.msg})"
    return "" if _code(statement) != after else f"changes no code: {mutant}"


def _statement_around(source: str, text: str) -> str:
    """The statement of the module that the text lies in; the whole module where it lies in none or in several."""
    first = source.count("\n", 0, source.index(text)) + 1
    last = first + text.count("\n")
    for begin, end in _statement_lines(source):
        if begin <= first and last <= end:
            return "\n".join(source.split("\n")[begin - 1 : end])
    return source


@functools.cache
def _statement_lines(source: str) -> tuple[tuple[int, int], ...]:
    """First and last line of each statement of the module, decorators included."""
    return tuple(
        (min([node.lineno, *(each.lineno for each in getattr(node, "decorator_list", ()))]), node.end_lineno or 0)
        for node in ast.parse(source).body
    )


def _code(source: str) -> str:
    """The code without its docstrings and comments. Raises SyntaxError."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [
                each for each in node.body if not (isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant))
            ]
    return ast.dump(tree)
