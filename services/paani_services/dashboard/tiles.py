"""Tiles of a chart from a folder `{z}/{x}/{y}.png`, `.jpg` or `.webp`, or from one file, to be drawn below the map."""

from __future__ import annotations

import asyncio
from pathlib import Path

import msgspec
from aiohttp import web

from paani.errors import UserError
from paani_services.dashboard.requests import NoQuery, decode_query
from paani_services.dashboard.responses import error_response, json_response
from paani_services.dashboard.tile_archive import SUFFIX, open_archive, read_archived

MAX_ZOOM = 24
MAX_BYTES = 2 << 20
MAX_CREDIT_CHARACTERS = 200
CREDIT = "attribution.txt"
MEDIA_TYPES = {"png": "image/png", "jpg": "image/jpeg", "webp": "image/webp"}


class TileSet(msgspec.Struct, frozen=True, kw_only=True):
    """Zoom levels that there are tiles of, ascending; empty: none. credit: whose chart it is, to be shown on it."""

    zooms: tuple[int, ...] = ()
    credit: str = ""


class TileRefusedError(Exception):
    """A tile cannot be served; `status` is HTTP's."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


def find_tiles(folder: str) -> TileSet:
    """What the folder or file holds; empty: none is set. Raises UserError naming `dashboard.tiles`."""
    if not folder:
        return TileSet()
    path = Path(folder)
    if is_archive(folder):
        archive = open_archive(path)
        within = tuple(zoom for zoom in archive.zooms if zoom <= MAX_ZOOM)
        return TileSet(zooms=within, credit=archive.credit[:MAX_CREDIT_CHARACTERS])
    try:
        names = [each.name for each in path.iterdir() if each.is_dir()]
        credit = (path / CREDIT).read_text(encoding="utf-8", errors="replace") if (path / CREDIT).is_file() else ""
    except OSError as error:
        raise UserError(f"dashboard.tiles {folder}: {error.strerror}") from error
    zooms = sorted(int(name) for name in names if name.isascii() and name.isdecimal() and int(name) <= MAX_ZOOM)
    if not zooms:
        raise UserError(f"dashboard.tiles {folder}: no folder of a zoom level (0 to {MAX_ZOOM}) is in it")
    return TileSet(zooms=tuple(zooms), credit=" ".join(credit.split())[:MAX_CREDIT_CHARACTERS])


def is_archive(place: str) -> bool:
    """Whether it is one file, by its name or because a file is there."""
    return place.endswith(SUFFIX) or Path(place).is_file()


def read_tile(folder: str, zoom: int, column: int, row: int) -> tuple[str, bytes] | None:
    """Media type and bytes of a tile; None where there is none. Raises TileRefusedError for what is no picture."""
    if is_archive(folder):
        return _read_from_archive(Path(folder), zoom, column, row)
    root = Path(folder).resolve()
    for suffix, media_type in MEDIA_TYPES.items():
        path = root / str(zoom) / str(column) / f"{row}.{suffix}"
        if not path.is_file():
            continue
        if not path.resolve().is_relative_to(root):
            raise TileRefusedError(409, f"{path.relative_to(root)} leads out of the folder")
        try:
            with path.open("rb") as file:
                body = file.read(MAX_BYTES + 1)
        except OSError as error:
            raise TileRefusedError(500, f"{path.relative_to(root)}: {error.strerror}") from error
        return media_type, _require_picture(str(path.relative_to(root)), suffix, body)
    return None


def _read_from_archive(path: Path, zoom: int, column: int, row: int) -> tuple[str, bytes] | None:
    try:
        archive = open_archive(path)
        body = read_archived(archive, zoom, column, row, MAX_BYTES)
    except UserError as error:
        raise TileRefusedError(409, str(error)) from error
    if body is None:
        return None
    return MEDIA_TYPES[archive.suffix], _require_picture(f"{zoom}/{column}/{row}", archive.suffix, body)


def _require_picture(name: str, suffix: str, body: bytes) -> bytes:
    if len(body) > MAX_BYTES:
        raise TileRefusedError(409, f"{name} is larger than {MAX_BYTES >> 20} MiB")
    if not _is_picture(MEDIA_TYPES[suffix], body):
        raise TileRefusedError(409, f"{name} is no {suffix} picture")
    return body


def _is_picture(media_type: str, body: bytes) -> bool:
    """Whether it begins as such a picture does."""
    if media_type == "image/png":
        return body.startswith(b"\x89PNG\r\n\x1a\n")
    if media_type == "image/jpeg":
        return body.startswith(b"\xff\xd8\xff")
    return body.startswith(b"RIFF") and body[8:12] == b"WEBP"


class TileRoutes:
    """Answers from the folder or file of `dashboard.tiles`."""

    def __init__(self, folder: str) -> None:
        self._folder = folder

    def routes(self) -> list[web.RouteDef]:
        return [web.get("/api/tiles", self._set), web.get("/tiles/{zoom}/{column}/{row}", self._tile)]

    async def _set(self, request: web.Request) -> web.Response:
        decode_query(dict(request.query), NoQuery)
        try:
            return json_response(await asyncio.to_thread(find_tiles, self._folder))
        except UserError as error:
            return error_response(409, str(error), "dashboard.tiles")

    async def _tile(self, request: web.Request) -> web.Response:
        """The tile; status 204 where there is none."""
        decode_query(dict(request.query), NoQuery)
        words = [request.match_info[name] for name in ("zoom", "column", "row")]
        if not all(word.isascii() and word.isdecimal() and len(word) <= 8 for word in words):
            return error_response(404, "expected /tiles/ZOOM/COLUMN/ROW, whole numbers", "zoom")
        zoom, column, row = map(int, words)
        if zoom > MAX_ZOOM or max(column, row) >= 1 << zoom:
            return error_response(404, f"no tile {zoom}/{column}/{row} lies on Earth", "zoom")
        try:
            found = await asyncio.to_thread(read_tile, self._folder, zoom, column, row) if self._folder else None
        except TileRefusedError as error:
            return error_response(error.status, str(error), "dashboard.tiles")
        return web.Response(status=204) if found is None else web.Response(body=found[1], content_type=found[0])
