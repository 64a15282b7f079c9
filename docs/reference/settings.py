"""The page of settings: unit, range and default from the types, and why from the comments beside them."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
import tokenize
from collections.abc import Iterator, Mapping
from io import StringIO
from typing import Any, NamedTuple

import msgspec

from docs.reference.markdown import STATEMENT, prose, table, with_statement_links
from docs.reference.statements import what_statements_say
from paani.config import PROFILES, Config
from paani.config.tuning import TUNABLE
from paani.config.value_types import kind_of, range_of, text_of, unit_of

INTRODUCTION = """# Settings

A setting is written in a TOML file (`--config FILE`), as an environment variable (`PAANI_<SECTION>__<FIELD>`), or on
the command line (`--set section.field=value`); the later of these wins over the earlier, and all of them over the
profile (`--profile`) and the defaults below. A setting that does not exist, is out of its range or cannot work
together with another stops the program before it starts, with one line that names it.

*Why* gives the reason for the default, or what the setting does; ids such as J5 are [statements of the
paper](statements.md).

"""
TRIED = "Can be tried on a running boat, by [`paani tune`](../how-to/tune.md)"


class Setting(NamedTuple):
    """One setting: its path (`advisor.policy.tie`), what it may hold, and the reason beside it in the code."""

    path: str
    unit: str
    kind: str
    limits: str
    default: str
    why: str


class SettingsSection(NamedTuple):
    """A part of the tree: its path, what its docstring says, and its settings, without those of the sections in it."""

    path: str
    says: str
    settings: tuple[Setting, ...]


def sections(kind: type[msgspec.Struct] = Config, path: str = "") -> Iterator[SettingsSection]:
    """Every section of the configuration, from the top down."""
    reasons = reasons_of(kind)
    rows: list[Setting] = []
    below: list[tuple[type[msgspec.Struct], str]] = []
    info = msgspec.inspect.type_info(kind)
    assert isinstance(info, msgspec.inspect.StructType)
    for field in info.fields:
        name = f"{path}.{field.name}" if path else field.name
        if isinstance(field.type, msgspec.inspect.StructType):
            below.append((field.type.cls, name))
            continue
        default = text_of(field.default)
        unit = unit_of(field.name)
        rows.append(Setting(name, unit, kind_of(field.type), range_of(field.type), default, reasons[field.name]))
    yield SettingsSection(path, prose(kind.__doc__), tuple(rows))
    for inner, name in below:
        yield from sections(inner, name)


def reasons_of(kind: type[msgspec.Struct]) -> dict[str, str]:
    """For each field: the comment on its line, or above it, and the sentences of the docstring that name it."""
    source = textwrap.dedent(inspect.getsource(kind))
    body = ast.parse(source).body[0]
    assert isinstance(body, ast.ClassDef)
    beside, above = _comments(source)
    reasons = {name: _sentences_naming(name, kind.__doc__) for name in kind.__struct_fields__}
    for field in body.body:
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            last = field.end_lineno or field.lineno
            words = [*_block_above(above, field.lineno), beside.get(last, "")]
            reasons[field.target.id] = " ".join(part for part in (*words, reasons[field.target.id]) if part)
    return reasons


def settings_page() -> str:
    """Every setting, section by section, and what each profile changes."""
    known = what_statements_say()
    parts = [INTRODUCTION]
    header = ("setting", "unit", "kind", "range", "default", "why")
    for section in sections():
        parts.append(
            f"## {section.path or 'profile'}\n\n{with_statement_links(section.says, known)}\n\n{_tuning(section)}"
        )
        rows = (
            (f"`{s.path}`", s.unit, s.kind, s.limits, f"`{s.default}`", _why(s.why, known)) for s in section.settings
        )
        parts.append(table(header, rows) + "\n" if section.settings else "")
    return "".join(parts) + _profiles(known)


def _tuning(section: SettingsSection) -> str:
    """Whether the section's settings can be tried, and which of them cannot."""
    paths = [setting.path for setting in section.settings]
    fixed = [f"`{path}`" for path in paths if path not in TUNABLE]
    if len(fixed) == len(paths):
        return ""
    return TRIED + (f", but for {' and '.join(fixed)}" if fixed else "") + ".\n\n"


def _why(text: str, known: Mapping[str, str]) -> str:
    """The reason; one that is an id alone says that the value is the paper's."""
    words = f"the paper's: {text}" if text and not STATEMENT.sub("", text).strip(" ,") else text
    return with_statement_links(words, known)


def _profiles(known: Mapping[str, str]) -> str:
    parts = ["## Profiles\n\nA profile is the default with these values instead.\n\n"]
    for name, tree in PROFILES.items():
        values = tuple((f"`{path}`", f"`{text_of(value)}`") for path, value in _leaves(tree) if path != "profile")
        parts.append(f"### {name}\n\n" + (table(("setting", "value"), values) if values else "The defaults.\n") + "\n")
    return "".join(parts)


def _leaves(tree: dict[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{path}{name}.")
        else:
            yield f"{path}{name}", value


def _comments(source: str) -> tuple[dict[int, str], dict[int, str]]:
    """Comments by line: those behind code, and those that have the line to themselves."""
    beside: dict[int, str] = {}
    alone: dict[int, str] = {}
    for token in tokenize.generate_tokens(StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            target = beside if token.line[: token.start[1]].strip() else alone
            target[token.start[0]] = token.string.lstrip("# ")
    return beside, alone


def _block_above(alone: dict[int, str], line: int) -> list[str]:
    """The comment lines directly above a line, first one first."""
    first = line
    while first - 1 in alone:
        first -= 1
    return [alone[number] for number in range(first, line)]


def _sentences_naming(name: str, doc: str | None) -> str:
    found = [s for s in re.split(r"(?<=[.;])\s+(?=[A-Z`])", prose(doc).replace("\n\n", " ")) if f"`{name}`" in s]
    return " ".join(found)
