"""The class mask in colours that people see: the palette of a PNG, put in without decoding a pixel. Pure."""

from __future__ import annotations

import struct
import zlib

SIGNATURE = b"\x89PNG\r\n\x1a\n"
IHDR = struct.Struct(">IIBBBBB")
FIRST_CHUNK = len(SIGNATURE)
GREY, PALETTE, BITS = 0, 3, 8
# As on the page: water, obstacle, sky; the mask has no other class.
CLASS_RGB = ((23, 118, 140), (242, 140, 30), (36, 56, 143))


def tint_mask(png: bytes) -> bytes | None:
    """The same picture with `CLASS_RGB` for its grey levels; None where it is no greyscale PNG of 8 bits.

    A sample of 8 bits is stored the same way whether it is a grey level or the number of a colour, so only the header
    changes, and the palette comes before the data (PNG, third edition, 11.2.1 and 11.2.2).
    """
    body, end = FIRST_CHUNK + 8, FIRST_CHUNK + 8 + IHDR.size
    if png[:FIRST_CHUNK] != SIGNATURE or png[FIRST_CHUNK:body] != struct.pack(">I4s", IHDR.size, b"IHDR"):
        return None
    if len(png) < end + 4:
        return None
    width, height, depth, kind, *rest = IHDR.unpack(png[body:end])
    if (depth, kind) != (BITS, GREY):
        return None
    header = IHDR.pack(width, height, BITS, PALETTE, *rest)
    colours = bytes(level for rgb in CLASS_RGB for level in rgb)
    return SIGNATURE + _chunk(b"IHDR", header) + _chunk(b"PLTE", colours) + png[end + 4 :]


def _chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
