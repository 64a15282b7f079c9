"""Tiles of a chart from one file in the format PMTiles, version 3."""

from __future__ import annotations

import functools
import json
import re
import zlib
from pathlib import Path
from typing import Any, NamedTuple

from paani.errors import UserError
from paani.extras import require_modules

SUFFIX = ".pmtiles"
HEADER_BYTES = 127
MAX_DIRECTORY_BYTES = 1 << 18  # packed; writers keep them far smaller
MAX_DEPTH = 4  # of directories below each other
DIRECTORIES_KEPT = 64
DAMAGED = (ValueError, EOFError, OverflowError, IndexError, TypeError, zlib.error, OSError)


class Archive(NamedTuple):
    """One file, as it was when it was described. `suffix`: what kind of picture its tiles are."""

    path: Path
    header: dict[str, Any]
    suffix: str
    zooms: tuple[int, ...]
    credit: str


def open_archive(path: Path) -> Archive:
    """Describe the file, again only where it has changed. Raises UserError naming `dashboard.tiles` and the file."""
    require_modules(f"dashboard.tiles {path}", "pmtiles")
    try:
        found = path.stat()
    except OSError as error:
        raise UserError(f"dashboard.tiles {path}: {error.strerror}") from error
    return _describe(path, found.st_mtime_ns, found.st_size)


def read_archived(archive: Archive, zoom: int, column: int, row: int, max_bytes: int) -> bytes | None:
    """Bytes of a tile, at most one more than `max_bytes`; None where there is none. Raises UserError."""
    from pmtiles.tile import find_tile, zxy_to_tileid  # noqa: PLC0415  # an extra

    if zoom not in archive.zooms:
        return None
    number = zxy_to_tileid(zoom, column, row)
    offset, length = archive.header["root_offset"], archive.header["root_length"]
    try:
        for _ in range(MAX_DEPTH):
            entry = find_tile(_directory(archive.path, offset, length), number)
            if entry is None:
                return None
            if entry.run_length > 0:
                start = archive.header["tile_data_offset"] + entry.offset
                return _read(archive.path, start, min(entry.length, max_bytes + 1))
            offset, length = archive.header["leaf_directory_offset"] + entry.offset, entry.length
    except DAMAGED as error:
        raise UserError(f"{archive.path.name} is damaged: {error}") from error
    raise UserError(f"{archive.path.name} is damaged: its directories lie more than {MAX_DEPTH} deep")


@functools.lru_cache(maxsize=2)
def _describe(path: Path, _mtime_ns: int, size_bytes: int) -> Archive:
    from pmtiles.tile import (  # noqa: PLC0415  # an extra
        Compression,
        MagicNumberNotFound,
        SpecVersionUnsupported,
        TileType,
        deserialize_header,
    )

    def refuse(why: str) -> UserError:
        return UserError(f"dashboard.tiles {path}: {why}")

    _directory.cache_clear()
    try:
        header = deserialize_header(_read(path, 0, HEADER_BYTES))
        kinds = {TileType.PNG: "png", TileType.JPEG: "jpg", TileType.WEBP: "webp"}
        if header["tile_type"] not in kinds:
            name = header["tile_type"].name.lower()
            raise refuse(f"its tiles are {name}, not pictures that the page draws ({', '.join(kinds.values())})")
        if header["internal_compression"] is not Compression.GZIP:
            raise refuse("its directories are not packed by gzip")
        if header["tile_compression"] not in {Compression.NONE, Compression.UNKNOWN}:
            raise refuse("its pictures are packed once more")
        if header["tile_data_offset"] + header["tile_data_length"] > size_bytes:
            raise refuse("the file is cut short")
        _directory(path, header["root_offset"], header["root_length"])
        credit = _credit(_read(path, header["metadata_offset"], min(header["metadata_length"], MAX_DIRECTORY_BYTES)))
    except (MagicNumberNotFound, SpecVersionUnsupported, UnicodeDecodeError) as error:
        raise refuse("is no PMTiles archive of version 3") from error
    except DAMAGED as error:
        raise refuse(f"is damaged: {getattr(error, 'strerror', None) or error}") from error
    zooms = tuple(range(header["min_zoom"], header["max_zoom"] + 1))
    return Archive(path, dict(header), kinds[header["tile_type"]], zooms, credit)


@functools.lru_cache(maxsize=DIRECTORIES_KEPT)
def _directory(path: Path, offset: int, length: int) -> list[Any]:
    from pmtiles.tile import deserialize_directory  # noqa: PLC0415  # an extra

    if length > MAX_DIRECTORY_BYTES:
        raise ValueError(f"a directory of {length} bytes")
    return list(deserialize_directory(_read(path, offset, length)))


def _read(path: Path, offset: int, length: int) -> bytes:
    """Raises ValueError where the file ends before, but for its first bytes."""
    with path.open("rb") as file:
        file.seek(offset)
        found = file.read(length)
    if offset and len(found) < length:
        raise ValueError("the file is cut short")
    return found


def _credit(packed: bytes) -> str:
    """Whose chart it is, without markup; empty where the file does not say."""
    try:
        metadata = json.loads(zlib.decompress(packed, wbits=31)) if packed else {}
    except (ValueError, zlib.error):
        return ""
    attribution = metadata.get("attribution", "") if isinstance(metadata, dict) else ""
    return " ".join(re.sub(r"<[^>]*>", " ", str(attribution)).split())
