"""A chart in one file: its tiles are those of the file, and a bad file is told by name."""

from __future__ import annotations

import gzip
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from paani.errors import UserError
from paani_services.dashboard.tiles import MAX_BYTES, TileRefusedError, TileSet, find_tiles, read_tile
from tests.unit.paani_services.dashboard.test_tiles import PICTURES

writing: Any = pytest.importorskip("pmtiles.writer", reason="the extra charts is not installed")
tile: Any = pytest.importorskip("pmtiles.tile")

MANY = 30_000  # tiles of one archive, which need directories below the first
DIRECTORY_OFFSET, DATA_LENGTH = slice(8, 16), slice(64, 72)
INTERNAL, PACKED, KIND = 97, 98, 99  # places of the header's bytes (PMTiles 3, section 3)


def written(path: Path, tiles: Mapping[tuple[int, int, int], bytes], kind: str = "PNG", **metadata: str) -> Path:
    header = {
        "tile_type": tile.TileType[kind], "tile_compression": tile.Compression.NONE,
        "min_lon_e7": 0, "min_lat_e7": 0, "max_lon_e7": 0, "max_lat_e7": 0,
        "center_zoom": 0, "center_lon_e7": 0, "center_lat_e7": 0,
    }  # fmt: skip
    with path.open("wb") as file:
        writer = writing.Writer(file)
        for number, body in sorted((tile.zxy_to_tileid(*place), body) for place, body in tiles.items()):
            writer.write_tile(number, body)
        writer.finalize(header, dict(metadata))
    return path


@pytest.mark.parametrize(("kind", "suffix"), [("PNG", "png"), ("JPEG", "jpg"), ("WEBP", "webp")])
def test_a_tile_of_each_kind_is_served(tmp_path: Path, kind: str, suffix: str) -> None:
    picture = PICTURES[suffix]
    tiles = {(3, 1, 2): picture, (5, 7, 30): picture + b"other"}
    path = str(written(tmp_path / "chart.pmtiles", tiles, kind, attribution="<a href='x'>© the</a>\n makers"))
    assert find_tiles(path) == TileSet(zooms=(3, 4, 5), credit="© the makers")
    media_type = f"image/{suffix}".replace("jpg", "jpeg")
    assert read_tile(path, 3, 1, 2) == (media_type, picture)
    assert read_tile(path, 5, 7, 30) == (media_type, picture + b"other")
    for zoom, column, row in ((3, 2, 1), (4, 1, 2), (9, 1, 2)):
        assert read_tile(path, zoom, column, row) is None


@pytest.mark.slow
def test_directories_below_the_first_are_followed_and_a_new_file_is_read_anew(tmp_path: Path) -> None:
    tiles = {(9, number // 512, number % 512): PICTURES["png"] + b"%d" % number for number in range(MANY)}
    path = written(tmp_path / "chart.pmtiles", tiles)
    for number in (0, 1, 511, 17_000, MANY - 1):
        assert read_tile(str(path), 9, number // 512, number % 512) == ("image/png", PICTURES["png"] + b"%d" % number)
    assert read_tile(str(path), 9, 511, 511) is None
    written(path, {(9, 511, 511): PICTURES["png"]})
    assert read_tile(str(path), 9, 511, 511) == ("image/png", PICTURES["png"])
    assert read_tile(str(path), 9, 0, 1) is None
    sizes = set()
    for row in (100, 101):  # files whose directories have the same place and size
        sizes.add(written(path, {(9, 100, row): PICTURES["png"]}).stat().st_size)
        assert read_tile(str(path), 9, 100, row) == ("image/png", PICTURES["png"])
    assert len(sizes) == 1


def test_what_is_no_picture_or_too_large_is_refused(tmp_path: Path) -> None:
    tiles = {(3, 1, 2): b"<html>", (3, 1, 3): PICTURES["png"].ljust(MAX_BYTES + 1, b"\0")}
    path = str(written(tmp_path / "chart.pmtiles", tiles))
    for row, says in ((2, "3/1/2 is no png picture"), (3, "3/1/3 is larger than 2 MiB")):
        with pytest.raises(TileRefusedError, match=says):
            read_tile(path, 3, 1, row)


def test_a_bad_file_is_told_by_name(tmp_path: Path) -> None:
    good = written(tmp_path / "good.pmtiles", {(3, 1, 2): PICTURES["png"]}).read_bytes()
    path = tmp_path / "bad.pmtiles"

    def with_byte(place: int, value: int) -> bytes:
        return good[:place] + bytes([value]) + good[place + 1 :]

    def with_number(place: slice, value: int) -> bytes:
        return good[: place.start] + value.to_bytes(8, "little") + good[place.stop :]

    cases = (
        (b"", "is no PMTiles archive of version 3"),
        (b"<html>" * 40, "is no PMTiles archive of version 3"),
        (with_byte(7, 2), "is no PMTiles archive of version 3"),
        (good[:40], "is damaged"),
        (good[:-1], "the file is cut short"),
        (with_number(DATA_LENGTH, 1 << 40), "the file is cut short"),
        (with_number(DIRECTORY_OFFSET, 1 << 63), "is damaged"),
        (with_number(DIRECTORY_OFFSET, 126), "is damaged"),
        (with_byte(INTERNAL, 4), "not packed by gzip"),
        (with_byte(PACKED, 2), "packed once more"),
        (with_byte(KIND, 1), r"its tiles are mvt, not pictures that the page draws \(png, jpg, webp\)"),
        (with_byte(KIND, 77), "is damaged: 77 is not a valid TileType"),
    )
    for body, says in cases:
        path.write_bytes(body)
        with pytest.raises(UserError, match=rf"dashboard\.tiles .*bad\.pmtiles: {says}|.*{says}") as refused:
            find_tiles(str(path))
        assert str(path) in str(refused.value)
    path.unlink()
    with pytest.raises(UserError, match=r"dashboard\.tiles .*bad\.pmtiles: No such file"):
        find_tiles(str(path))


def test_a_damaged_directory_below_the_first_is_told_with_the_tile_that_needs_it(tmp_path: Path) -> None:
    """A first directory that names itself as the one below, without end."""
    path = written(tmp_path / "chart.pmtiles", {(3, 1, 2): PICTURES["png"]})
    entry = tile.Entry(0, 0, 0, 0)
    loop = tile.serialize_directory([entry])
    entry.length = len(loop)
    loop = tile.serialize_directory([entry])
    header = bytearray(path.read_bytes()[:127])
    header[8:16] = header[40:48] = (127).to_bytes(8, "little")
    header[16:24] = len(loop).to_bytes(8, "little")
    header[24:40] = header[56:72] = bytes(16)
    path.write_bytes(bytes(header) + loop + gzip.compress(b"{}"))
    assert find_tiles(str(path)).zooms == (3,)
    with pytest.raises(TileRefusedError, match=r"chart\.pmtiles is damaged"):
        read_tile(str(path), 3, 1, 2)
