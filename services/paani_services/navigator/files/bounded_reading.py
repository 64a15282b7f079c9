"""Reading files that anybody may have written: bounded in size, and every fault names the file."""

from __future__ import annotations

import codecs
import tomllib
from pathlib import Path
from typing import TypeVar

import msgspec

from paani.errors import UserError
from paani.undecodable import UNDECODABLE

MAX_BYTES = 32 << 20  # a route of 100,000 points with names and times is smaller

T = TypeVar("T")


def read_bytes(path: Path, where: str) -> bytes:
    """The whole file, without a byte order mark of UTF-8. Raises UserError where it is unreadable or too large."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise UserError(f"{where}: larger than {MAX_BYTES >> 20} MiB")
        return path.read_bytes().removeprefix(codecs.BOM_UTF8)
    except OSError as error:
        raise UserError(f"{where}: {error.strerror}") from error


def read_toml(path: Path, where: str, kind: type[T]) -> T:
    """A TOML file as a value of this type. Raises UserError that names the field."""
    data = read_bytes(path, where)
    try:
        return msgspec.convert(tomllib.loads(data.decode()), kind)
    except UNDECODABLE as error:
        raise UserError(f"{where}: {error}") from error
