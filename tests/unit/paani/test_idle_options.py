"""An option that would be passed over in silence is refused by name."""

from __future__ import annotations

import argparse

import pytest

from paani.errors import UserError
from paani.idle_options import refuse_options


def parser() -> argparse.ArgumentParser:
    root = argparse.ArgumentParser()
    root.add_argument("--loud", action="store_true")
    commands = root.add_subparsers(dest="command", required=True)
    for name in ("drive", "look"):
        command = commands.add_parser(name)
        command.add_argument("nets", nargs="*", default=[])
        command.add_argument("--from", type=float, default=0.0, dest="from_s")
        command.add_argument("--set", action="append", default=[], dest="sets")
    return root


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["drive", "--from", "2"], "--from"),
        (["look", "one"], "nets"),
        (["drive", "--set", "a"], "--set"),
        (["--loud", "look"], "--loud"),
    ],
)
def test_an_option_that_was_given_is_refused(words: list[str], name: str) -> None:
    options = parser().parse_args(words)
    with pytest.raises(UserError, match=f"^{name}: is idle$"):
        refuse_options(parser(), options, ("--loud", "nets", "--from", "--set"), "is idle")


def test_what_was_not_given_or_is_not_meant_is_let_pass() -> None:
    for words in (["drive"], ["drive", "--from", "0"], ["look", "one", "--set", "a"]):
        refuse_options(parser(), parser().parse_args(words), ("--loud", "--from"), "is idle")
