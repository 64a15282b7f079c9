"""`paani completion`: the script by which a shell completes `paani`."""

from __future__ import annotations

import argparse
import re
import sys

from paani.extras import require_modules
from paani_tools.completion.parsers import join_parsers

SHELLS = ("bash", "zsh", "fish")
FILE_WORDS, FOLDER_WORDS = {"FILE", "PATH", "PATHS", "LOG", "DRIVE"}, {"DIR", "FOLDER"}


def main(argv: list[str]) -> int:
    """Print the script. Raises UserError where the extra is missing."""
    parser = argparse.ArgumentParser(
        prog="paani completion",
        description="Print the script by which a shell completes commands, options, choices and files.",
        epilog="bash: paani completion bash > ~/.local/share/bash-completion/completions/paani",
    )
    parser.add_argument("shell", choices=SHELLS)
    shell = parser.parse_args(argv).shell
    require_modules("completion", "shtab")
    sys.stdout.write(completion_script(shell) + "\n")
    return 0


def completion_script(shell: str) -> str:
    """The script for one of `SHELLS`."""
    import shtab  # noqa: PLC0415  # of an extra

    root = join_parsers()
    _name_files(root, shtab.FILE, shtab.DIRECTORY)
    return str(shtab.complete(root, shell))


def _name_files(parser: argparse.ArgumentParser, file: object, folder: object) -> None:
    """Say which options take a file or folder, by the word that their help shows."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for sub in dict.fromkeys(action.choices.values()):
                _name_files(sub, file, folder)
        words = set(re.split(r"[^A-Z]+", str(action.metavar or action.dest).upper()))
        if words & (FILE_WORDS | FOLDER_WORDS):  # shtab looks for the attribute
            action.complete = file if words & FILE_WORDS else folder  # type: ignore[attr-defined]
