"""The page of commands, from their own parsers."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from importlib.metadata import entry_points
from typing import NamedTuple
from unittest import mock

from docs.reference.markdown import prose
from paani_tools.completion.parsers import find_parser

WIDTH = "100"
GROUPS = {"paani.commands": "", "paani.bench_commands": "bench "}

INTRODUCTION = """# Commands

`paani COMMAND --help` says the same in a terminal. Exit codes: 0 done, 1 it failed or what was checked is not so, 2 a
mistake in what was asked for, with one line that says which. A process (`paani run SERVICE`) is started the same way;
`paani up` starts them all.

"""


class Command(NamedTuple):
    """One command or sub-command as a user types it (`paani logs info`), and its help."""

    name: str
    help: str


def commands() -> Iterator[Command]:
    """Every installed command with its sub-commands, by name."""
    for group, prefix in GROUPS.items():
        for point in sorted(entry_points(group=group), key=lambda point: point.name):
            yield from _with_sub_commands(f"paani {prefix}{point.name}", find_parser(point.load()))


def commands_page() -> str:
    """The help of every command."""
    parts = [INTRODUCTION]
    for command in commands():
        level = "##" if command.name.count(" ") == 1 else "###"
        parts.append(f"{level} {command.name}\n\n```text\n{command.help.strip()}\n```\n\n")
    return "".join(parts)


def _with_sub_commands(name: str, parser: argparse.ArgumentParser) -> Iterator[Command]:
    yield Command(name, _help(parser))
    for action in parser._actions:  # argparse has no public way to list sub-commands
        if isinstance(action, argparse._SubParsersAction):
            for word, sub in action.choices.items():
                yield from _with_sub_commands(f"{name} {word}", sub)


def _help(parser: argparse.ArgumentParser) -> str:
    parser.description = prose(parser.description)
    with mock.patch.dict(os.environ, {"COLUMNS": WIDTH}):
        return parser.format_help()
