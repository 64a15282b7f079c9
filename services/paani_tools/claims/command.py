"""`paani claims [ID ...]`: what the paper states, which test proves it, and what is better here."""

from __future__ import annotations

import argparse
import sys
from typing import get_args

import msgspec

from paani_tools.claims.statements import State, chosen_statements, read_statements, statements_text


def main(argv: list[str]) -> int:
    """Print the statements asked for. Raises UserError for an id that does not exist."""
    parser = argparse.ArgumentParser(
        prog="paani claims",
        description="The statements of the paper that PAANI follows, each with the tests that prove it.",
    )
    parser.add_argument("ids", nargs="*", metavar="ID", help="J7, a group such as J, or a range such as J5-J10")
    parser.add_argument("--find", default="", metavar="WORDS", help="only statements with these words")
    parser.add_argument(
        "--state", nargs="+", choices=get_args(State), default=[], help="only statements in one of these states"
    )
    parser.add_argument("--json", action="store_true", help="a JSON list instead of text")
    options = parser.parse_args(argv)
    found = chosen_statements(read_statements(), options.ids, options.find, options.state)
    if options.json:
        sys.stdout.write(msgspec.json.format(msgspec.json.encode(found), indent=1).decode() + "\n")
    else:
        sys.stdout.write(statements_text(found))
    return 0
