"""Files and folders that are written are whole or absent: written beside, then renamed."""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import msgspec

from paani.errors import UserError


def write_whole(path: Path, data: bytes, option: str = "") -> None:
    """Raises UserError naming the file, and the option that asked for it."""
    with replacement_file(path, option) as beside:
        beside.write_bytes(data)


def write_json(path: Path, value: object, option: str = "") -> None:
    """Write `indented_json(value)`. Raises UserError as `write_whole`."""
    write_whole(path, indented_json(value), option)


def json_line(value: object) -> bytes:
    """JSON in one line. A name of bytes that are no text is escaped, as Python reads it back."""
    try:
        return msgspec.json.encode(value) + b"\n"
    except UnicodeEncodeError:
        return json.dumps(msgspec.to_builtins(value)).encode() + b"\n"


def indented_json(value: object) -> bytes:
    """JSON that people can read, with a line end; the same for the same value."""
    return msgspec.json.format(json_line(value), indent=1) + b"\n"


@contextlib.contextmanager
def replacement_file(path: Path, option: str = "") -> Iterator[Path]:
    """A path to write to, which takes the place of `path` at the end and is removed where anything goes wrong.

    A link stays one, its target is replaced; a pipe or a device is written to as it is. Raises UserError naming the
    file, and the option that asked for it.
    """
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            yield path
            return
        target = path.resolve() if path.is_symlink() else path
    except (OSError, RuntimeError) as error:
        raise UserError(f"{option} {path}: {getattr(error, 'strerror', None) or error}".strip()) from error
    beside = target.with_name(f".{target.name}.partial")
    try:
        yield beside
        beside.replace(target)
    except OSError as error:
        raise UserError(f"{option} {path}: {error.strerror or error}".strip()) from error
    finally:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)


@contextlib.contextmanager
def new_folder(path: Path, option: str = "") -> Iterator[Path]:
    """A folder to write into, renamed to `path` at the end, removed where anything goes wrong or is interrupted.

    Raises UserError where `path` exists or cannot be made.
    """
    if path.exists():
        raise UserError(f"{option} {path}: already exists".strip())
    beside = path.with_name(f".{path.name}.partial")
    try:
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir(parents=True)
        yield beside
        beside.rename(path)
    except OSError as error:
        raise UserError(f"{option} {path}: {error.strerror or error}".strip()) from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)
