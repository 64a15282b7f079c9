"""A file that a command writes is whole or absent."""

from __future__ import annotations

from pathlib import Path

from paani.errors import UserError


def write_whole(path: Path, data: bytes, option: str = "") -> None:
    """Write beside the file first, then rename. Raises UserError naming the file, and the option that asked for it."""
    beside = path.with_name(f".{path.name}.partial")
    try:
        beside.write_bytes(data)
        beside.replace(path)
    except OSError as error:
        raise UserError(f"{option} {path}: {error.strerror}".strip()) from error
