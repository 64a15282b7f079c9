"""Tiles of a chart: what is served, and what is refused with its name."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from paani.errors import UserError
from paani_services.dashboard.tiles import MAX_BYTES, TileRefusedError, TileSet, find_tiles, read_tile

PICTURES = {
    "png": b"\x89PNG\r\n\x1a\nrest", "jpg": b"\xff\xd8\xff\xe0rest", "webp": b"RIFF\x10\x00\x00\x00WEBPrest",
}  # fmt: skip


def put(folder: Path, name: str, body: bytes) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(body)
    return path


@pytest.mark.parametrize("suffix", PICTURES)
def test_a_tile_of_each_kind_is_served(tmp_path: Path, suffix: str) -> None:
    put(tmp_path, f"17/5/9.{suffix}", PICTURES[suffix])
    found = read_tile(str(tmp_path), 17, 5, 9)
    assert found == (f"image/{suffix}".replace("jpg", "jpeg"), PICTURES[suffix])
    assert read_tile(str(tmp_path), 17, 9, 5) is None


@pytest.mark.parametrize("suffix", PICTURES)
def test_what_is_no_picture_is_refused_by_its_name(tmp_path: Path, suffix: str) -> None:
    for body in (b"", b"<html>not found</html>", b"RIFF\x10\0\0\0WAVE", PICTURES["jpg" if suffix != "jpg" else "png"]):
        put(tmp_path, f"3/1/2.{suffix}", body)
        with pytest.raises(TileRefusedError, match=rf"3/1/2\.{suffix} is no {suffix} picture") as refused:
            read_tile(str(tmp_path), 3, 1, 2)
        assert refused.value.status == 409


def test_a_tile_that_is_too_large_or_lies_elsewhere_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "tiles"
    put(folder, "3/1/2.png", PICTURES["png"].ljust(MAX_BYTES, b"\0"))
    assert read_tile(str(folder), 3, 1, 2) is not None
    put(folder, "3/1/2.png", PICTURES["png"].ljust(MAX_BYTES + 1, b"\0"))
    with pytest.raises(TileRefusedError, match=r"larger than 2 MiB"):
        read_tile(str(folder), 3, 1, 2)
    os.symlink(put(tmp_path, "secret.png", PICTURES["png"]), folder / "3/1/3.png")  # noqa: PTH211
    with pytest.raises(TileRefusedError, match=r"3/1/3\.png leads out of the folder"):
        read_tile(str(folder), 3, 1, 3)


def test_a_folder_is_described_or_refused(tmp_path: Path) -> None:
    assert find_tiles("") == TileSet()
    with pytest.raises(UserError, match=r"dashboard\.tiles .*absent: No such file"):
        find_tiles(str(tmp_path / "absent"))
    with pytest.raises(UserError, match=r"dashboard\.tiles .*file"):
        find_tiles(str(put(tmp_path, "file", b"")))
    empty = tmp_path / "empty"
    for name in ("x", "25", "-1", "1a"):
        (empty / name).mkdir(parents=True)
    with pytest.raises(UserError, match="no folder of a zoom level"):
        find_tiles(str(empty))
    for zoom in (17, 9):
        (empty / str(zoom)).mkdir()
    (empty / "attribution.txt").write_text("© the\n makers", encoding="utf-8")
    assert find_tiles(str(empty)) == TileSet(zooms=(9, 17), credit="© the makers")
