"""Options that would be passed over in silence."""

from __future__ import annotations

import argparse
from collections.abc import Container, Iterator

from paani.errors import UserError


def refuse_options(
    parser: argparse.ArgumentParser, options: argparse.Namespace, names: Container[str], why: str
) -> None:
    """Raises UserError naming the first option or positional of these that has another value than its default.

    parser: the one that read `options`. names: such as `--jobs`, of a positional its own.
    """
    for action in _actions(parser, options):
        for name in (*action.option_strings, action.dest):
            if name in names and getattr(options, action.dest) != action.default:
                raise UserError(f"{name}: {why}")


def _actions(parser: argparse.ArgumentParser, options: argparse.Namespace) -> Iterator[argparse.Action]:
    """Those of the parser and of its sub-command that was chosen: argparse has no public way to list them."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from _actions(action.choices[getattr(options, action.dest)], options)
        elif action.default is not argparse.SUPPRESS:
            yield action
