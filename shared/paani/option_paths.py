"""Paths that a command is given, checked while its options are parsed: a mistake is told before any work begins.

Each function gives an argparse `type` for the option of that name ("" for a positional), which turns the text into a
`Path` and raises UserError naming the option and the path.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from paani.errors import UserError

PathOf = Callable[[str], Path]
PICTURE_SUFFIXES = (".jpg", ".jpeg", ".png")  # of those written


def input_path(option: str = "") -> PathOf:
    """A file or folder that exists."""
    return _checked(option, _input_problem)


def input_file(option: str = "") -> PathOf:
    """A file that exists and can be read."""
    return _checked(option, lambda path: _input_problem(path) or ("is a folder, not a file" if path.is_dir() else ""))


def input_folder(option: str = "") -> PathOf:
    """A folder that exists."""
    return _checked(
        option, lambda path: "" if path.is_dir() else "is not a folder" if path.exists() else "no such folder"
    )


def output_file(option: str) -> PathOf:
    """A file that can be written: its folder exists and takes files, and it is no folder itself."""
    return _checked(option, _output_file_problem)


def output_picture(option: str) -> PathOf:
    """An `output_file` whose name ends as one of `PICTURE_SUFFIXES`."""
    return _checked(
        option,
        lambda path: (
            f"is not one of {', '.join(PICTURE_SUFFIXES)}"
            if path.suffix.lower() not in PICTURE_SUFFIXES
            else _output_file_problem(path)
        ),
    )


def output_folder(option: str) -> PathOf:
    """A folder that exists and takes files, or that can be made."""
    return _checked(option, _output_folder_problem)


def require_apart(written: Mapping[str, Path | None], read: Iterable[Path | None] = ()) -> None:
    """Raises UserError for an option whose file another one writes as well, or that is read and would be lost.

    written: the files by option. A pipe or a device may be named twice.
    """
    taken = {os.path.realpath(path): "is read, and would be lost" for path in read if path is not None}
    for option, path in written.items():
        if path is None or (path.exists() and not path.is_file()):
            continue
        place = os.path.realpath(path)
        if place in taken:
            raise UserError(f"{option} {path}: {taken[place]}")
        taken[place] = f"is what {option} writes"


def _checked(option: str, problem_of: Callable[[Path], str]) -> PathOf:
    def parse(text: str) -> Path:
        if not text:  # Python takes it for the current folder
            raise UserError(f"{option} '': names no file or folder".strip())
        path = Path(text)
        try:
            problem = problem_of(path)
        except OSError as error:  # a name that is too long, a loop of links
            problem = error.strerror or str(error)
        if problem:
            raise UserError(f"{option} {path}: {problem}".strip())
        return path

    return parse


def _input_problem(path: Path) -> str:
    if not path.exists():
        return "no such file or folder"
    return "" if os.access(path, os.R_OK) else "may not be read"


def _output_file_problem(path: Path) -> str:
    folder = path.absolute().parent
    if path.is_dir():
        return "is a folder, not a file"
    if not folder.is_dir():
        return f"no such folder: {folder}"
    return "" if os.access(folder, os.W_OK) else f"may not write into {folder}"


def _output_folder_problem(path: Path) -> str:
    nearest = path.absolute()
    while not nearest.exists():
        nearest = nearest.parent
    if not nearest.is_dir():
        return f"{nearest} is a file, not a folder"
    return "" if os.access(nearest, os.W_OK) else f"may not write into {nearest}"
