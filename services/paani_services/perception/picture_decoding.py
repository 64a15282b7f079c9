"""Encoded pictures to BGR, with work and memory bounded before anything is unpacked. Pure."""

import struct

import cv2
import numpy as np

from paani.arrays import U8

MAX_PIXELS = 2**25  # 100 MB of BGR
PNG_START = b"\x89PNG\r\n\x1a\n"
JPEG_START = b"\xff\xd8"
JPEG_SIZES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # start-of-frame markers
JPEG_BARE = frozenset((0x01, *range(0xD0, 0xDA)))  # markers without a length


def decoded(data: bytes | U8) -> U8 | None:
    """BGR uint8 [H, W, 3] of an encoded picture, of its first frame where it has several; None where it is none.

    Grey, alpha, 16-bit and CMYK pictures become BGR. A picture of more than `MAX_PIXELS` is none.
    """
    if not isinstance(data, bytes):
        return data if data.ndim == 3 and data.shape[2] == 3 and data.size else None
    if stated_pixels(data) > MAX_PIXELS:
        return None
    try:
        bgr = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if bgr is None else np.asarray(bgr, np.uint8)


def stated_pixels(data: bytes) -> int:
    """Pixels that the header of a PNG or JPEG promises; 0 for anything else."""
    if data.startswith(PNG_START) and len(data) >= 24:
        width, height = struct.unpack_from(">II", data, 16)
        return int(width) * int(height)
    if not data.startswith(JPEG_START):
        return 0
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker in JPEG_SIZES:
            height, width = struct.unpack_from(">HH", data, at + 5)
            return int(width) * int(height)
        at += 2 if marker in JPEG_BARE else 2 + int(struct.unpack_from(">H", data, at + 2)[0])
    return 0
