"""The parsers of all commands, joined into the one of `paani`."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
from importlib.metadata import EntryPoint, entry_points
from typing import NoReturn
from unittest import mock

from paani.cli import add_config_arguments
from paani.process import services


class _ParserFoundError(Exception):
    """Carries a command's parser out of the command."""

    def __init__(self, parser: argparse.ArgumentParser) -> None:
        super().__init__(parser.prog)
        self.parser = parser


def find_parser(main: Callable[[list[str]], int]) -> argparse.ArgumentParser:
    """The parser that a command makes, caught when it is about to read its arguments.

    Raises ValueError for a command that reads its arguments without one.
    """

    def caught(parser: argparse.ArgumentParser, *_: object, **__: object) -> NoReturn:
        raise _ParserFoundError(parser)

    with mock.patch.object(argparse.ArgumentParser, "parse_args", caught):
        try:
            main([])
        except _ParserFoundError as found:
            return found.parser
    raise ValueError(f"{main.__module__}: reads its arguments without a parser")


def join_parsers() -> argparse.ArgumentParser:
    """The parser of `paani` with every command, sub-command and service.

    A command whose extra is missing has no options.
    """
    root = argparse.ArgumentParser(prog="paani")
    root.add_argument("--version", action="store_true", help="release and commit")
    words = root.add_subparsers()
    _add_commands(words, entry_points(group="paani.commands"))
    run = words.add_parser("run", help="one service")
    run.add_argument("service", choices=sorted(services()))
    add_config_arguments(run)
    return root


def _add_commands(words: argparse._SubParsersAction[argparse.ArgumentParser], points: Iterable[EntryPoint]) -> None:
    for point in sorted(points, key=lambda point: point.name):
        parser = _parser_of(point)
        added = words.add_parser(
            point.name,
            parents=[] if parser is None else [parser],
            add_help=parser is None,
            help=_first_sentence(parser),
        )
        if point.name == "bench":
            _add_commands(_sub_commands(added), entry_points(group="paani.bench_commands"))


def _parser_of(point: EntryPoint) -> argparse.ArgumentParser | None:
    try:
        return find_parser(point.load())
    except ModuleNotFoundError:
        return None


def _sub_commands(parser: argparse.ArgumentParser) -> argparse._SubParsersAction[argparse.ArgumentParser]:
    for action in parser._actions:  # argparse has no public way to list sub-commands
        if isinstance(action, argparse._SubParsersAction):
            return action
    return parser.add_subparsers()


def _first_sentence(parser: argparse.ArgumentParser | None) -> str:
    text = " ".join(((parser.description if parser else "") or "").split())
    return text.partition(". ")[0].rstrip(".")
