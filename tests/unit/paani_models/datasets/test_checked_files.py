"""Pictures, masks and boxes as other people leave them: read, or refused by name (R8, R10)."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import event, given
from hypothesis import strategies as st

from paani.errors import UserError
from paani_models.datasets.checked_files import (
    decode_mask,
    decode_picture,
    raise_first_mistake,
    read_whole_file,
    read_yolo,
)
from tests.unit.paani_models.datasets.public_sets import scene

NAMED = Path("river.png")


def png(picture: np.ndarray) -> bytes:
    return bytes(cv2.imencode(".png", picture)[1].tobytes())


def huge_png() -> bytes:
    """A header that announces 60,000 x 60,000 pixels."""
    header = struct.pack(">IIBBBBB", 60_000, 60_000, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(b"\0" * 100)), (b"IEND", b"")]
    body = b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + body


KINDS = {
    "grey": scene(1)[..., 0],
    "alpha": np.dstack([scene(1), np.full((64, 96), 200, np.uint8)]),
    "sixteen bits": scene(1).astype(np.uint16) * 257,
}


@pytest.mark.parametrize("kind", KINDS)
def test_any_kind_of_picture_becomes_rgb_bytes(kind: str) -> None:
    picture = decode_picture(png(KINDS[kind]), NAMED)
    assert picture.dtype == np.uint8
    assert picture.shape == (64, 96, 3)


@pytest.mark.parametrize("data", [b"hello", b"\x89PNG\r\n\x1a\nIEND", huge_png()], ids=["text", "head", "huge"])
def test_what_is_no_picture_is_named(data: bytes) -> None:
    with pytest.raises(UserError, match=r"river\.png: not a readable picture"):
        decode_picture(data, NAMED)
    with pytest.raises(UserError, match=r"river\.png: not a readable mask"):
        decode_mask(data, NAMED, frozenset({0}), (1, 1))


@given(st.integers(1, 400))
def test_a_truncated_file_is_never_read(cut: int) -> None:
    with pytest.MonkeyPatch.context() as patch:
        for suffix in (".jpg", ".png"):
            data = bytes(cv2.imencode(suffix, scene(2))[1].tobytes())
            patch.setattr(Path, "read_bytes", lambda _, data=data: data[:-cut])
            with pytest.raises(UserError, match="cut short"):
                read_whole_file(NAMED)


def test_missing_and_empty_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"nothing\.jpg: No such file"):
        read_whole_file(tmp_path / "nothing.jpg")
    (tmp_path / "empty.jpg").touch()
    with pytest.raises(UserError, match=r"empty\.jpg: empty"):
        read_whole_file(tmp_path / "empty.jpg")


@given(
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(allow_nan=True, allow_infinity=True),
    st.floats(-0.5, 1.5),
    st.floats(-0.5, 1.5),
)
def test_a_box_that_is_read_is_finite_and_inside_r8(cx: float, cy: float, width: float, height: float) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "read_text", lambda *_, **__: f"1 {cx} {cy} {width} {height}")
        try:
            (box,) = read_yolo(Path("a.txt"), 4)
        except UserError as error:
            event(str(error))
            return
    assert np.isfinite((box.cx, box.cy, box.width, box.height)).all()
    for centre, side in ((box.cx, box.width), (box.cy, box.height)):
        assert -1e-9 <= centre - side / 2 < centre + side / 2 <= 1 + 1e-9
        assert 1e-4 <= side <= 1


def test_a_box_that_passes_the_edge_a_little_is_clipped(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("1 0.05 0.5 0.104 0.2\n")
    (box,) = read_yolo(tmp_path / "a.txt", 4)
    assert (box.cx - box.width / 2, box.cx + box.width / 2) == pytest.approx((0.0, 0.102))


def test_labels_that_are_no_text_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_bytes(b"\xff\xfe1 .5 .5 .1 .1")
    with pytest.raises(UserError, match=r"a\.txt: "):
        read_yolo(tmp_path / "a.txt", 4)


def test_the_first_mistake_is_named_and_the_rest_counted() -> None:
    raise_first_mistake([])
    for mistakes, message in ((["a"], "a"), (["a", "b", "c"], r"a \(and 2 more\)")):
        with pytest.raises(UserError, match=f"^{message}$"):
            raise_first_mistake(mistakes)


@pytest.mark.parametrize("row", ["0 .01 .5 .1 .1", "0 .5 .01 .1 .1", "0 .5 .99 .1 .1", "0 .97 .5 .1 .1"])
def test_r8_a_box_beyond_any_edge_is_refused(tmp_path: Path, row: str) -> None:
    label = tmp_path / "a.txt"
    label.write_text(row)
    with pytest.raises(UserError, match="a box outside"):
        read_yolo(label, 7)
