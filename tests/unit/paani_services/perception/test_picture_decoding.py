"""Whatever bytes a camera or a folder gives: BGR or nothing, and bounded work."""

from __future__ import annotations

import io
import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from paani_services.perception.picture_decoding import MAX_PIXELS, decode_picture, stated_pixel_count
from tests.pictures import river

pytestmark = pytest.mark.slow

RIVER = river()


def saved(picture: Image.Image, form: str, **options: object) -> bytes:
    stream = io.BytesIO()
    picture.save(stream, form, **options)
    return stream.getvalue()


RGB = Image.fromarray(RIVER[:, :, ::-1])
FORMS = {
    "grey": saved(RGB.convert("L"), "PNG"),
    "alpha": saved(RGB.convert("RGBA"), "PNG"),
    "16-bit": cv2.imencode(".png", RIVER.astype(np.uint16) * 257)[1].tobytes(),
    "CMYK": saved(RGB.convert("CMYK"), "JPEG", quality=95),
    "progressive": saved(RGB, "JPEG", quality=95, progressive=True),
    "one pixel": saved(Image.new("RGB", (1, 1)), "PNG"),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_pixel_format_becomes_bgr(form: str) -> None:
    bgr = decode_picture(FORMS[form])
    assert bgr is not None
    assert bgr.dtype == np.uint8
    assert bgr.shape == ((1, 1, 3) if form == "one pixel" else RIVER.shape)
    if form in {"alpha", "16-bit", "progressive"}:
        assert np.abs(bgr.astype(int) - RIVER).mean() < 4.0


def bomb(width: int, height: int) -> bytes:
    """A small PNG that says it is very large."""
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0" * 100)) + chunk(b"IEND", b"")
    )


def test_a_picture_too_large_to_unpack_is_none() -> None:
    assert stated_pixel_count(bomb(30_000, 30_000)) == 900_000_000 > MAX_PIXELS
    assert decode_picture(bomb(30_000, 30_000)) is None
    jpeg = bytearray(cv2.imencode(".jpg", RIVER)[1].tobytes())
    assert stated_pixel_count(bytes(jpeg)) == RIVER.shape[0] * RIVER.shape[1]
    at = jpeg.index(b"\xff\xc0")
    jpeg[at + 5 : at + 9] = struct.pack(">HH", 60_000, 60_000)
    assert decode_picture(bytes(jpeg)) is None


def filled(width: int, height: int, fill: int) -> bytes:
    """A JPEG that states this size after fill bytes."""
    jpeg = cv2.imencode(".jpg", RIVER)[1].tobytes()
    at = jpeg.index(b"\xff\xc0")
    return jpeg[:at] + b"\xff" * fill + jpeg[at : at + 5] + struct.pack(">HH", height, width) + jpeg[at + 9 :]


def test_fill_bytes_hide_no_size() -> None:
    assert stated_pixel_count(filled(60_000, 60_000, 7)) == 3_600_000_000
    assert decode_picture(filled(60_000, 60_000, 7)) is None
    found = decode_picture(filled(RIVER.shape[1], RIVER.shape[0], 7))
    assert found is not None
    assert found.shape == RIVER.shape


OTHERS = {form: saved(RGB, form) for form in ("GIF", "BMP", "TIFF", "WEBP", "PPM")}


@pytest.mark.parametrize("form", OTHERS)
def test_other_formats_are_no_pictures_of_a_camera(form: str) -> None:
    assert decode_picture(OTHERS[form]) is None


@pytest.mark.parametrize("data", [b"", b"\xff\xd8", b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"GIF89a", b"text" * 100])
def test_bytes_that_are_no_picture_give_none(data: bytes) -> None:
    assert decode_picture(data) is None


@settings(deadline=None, max_examples=50)
@given(st.binary(max_size=300), st.integers(0, 10_000), st.sampled_from(sorted(FORMS)))
def test_damage_never_raises(noise: bytes, at: int, form: str) -> None:
    data = bytearray(FORMS[form])
    start = at % len(data)
    data[start : start + len(noise)] = noise
    bgr = decode_picture(bytes(data))
    assert bgr is None or (bgr.ndim == 3 and bgr.shape[2] == 3)
