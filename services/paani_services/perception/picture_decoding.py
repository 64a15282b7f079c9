"""JPEG and PNG to BGR, with work and memory bounded before anything is decompressed. Pure."""

import struct

import cv2
import numpy as np

from paani.arrays import U8

MAX_PIXELS = 2**25  # as BGR, 100 MB
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
JPEG_SIGNATURE = b"\xff\xd8"
JPEG_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # start of frame: height and width follow
JPEG_FILL = 0xFF  # any number of these may stand before a marker (ITU-T T.81, B.1.1.2)
JPEG_BARE_MARKERS = frozenset((0x01, *range(0xD0, 0xDA)))  # no length follows


def decode_picture(data: bytes | U8) -> U8 | None:
    """BGR uint8 [H, W, 3] of a JPEG or PNG, what travels on the bus; None where the bytes are neither.

    Grey, alpha, 16-bit and CMYK pictures become BGR. Other formats, pictures whose header states no size, and more than
    `MAX_PIXELS` are refused as no picture: their decoders allocate before anyone can ask them how much.
    """
    if not isinstance(data, bytes):
        return data if data.ndim == 3 and data.shape[2] == 3 and data.size else None
    if not 0 < stated_pixel_count(data) <= MAX_PIXELS:
        return None
    try:
        bgr = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error:
        return None
    return None if bgr is None else np.asarray(bgr, np.uint8)


def stated_pixel_count(data: bytes) -> int:
    """Number of pixels that the header of a PNG or JPEG states; 0 for anything else."""
    if data.startswith(PNG_SIGNATURE) and len(data) >= 24:
        width, height = struct.unpack_from(">II", data, 16)
        return int(width) * int(height)
    if not data.startswith(JPEG_SIGNATURE):
        return 0
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == JPEG_FILL:
            at += 1
            continue
        if marker in JPEG_FRAME_MARKERS:
            height, width = struct.unpack_from(">HH", data, at + 5)
            return int(width) * int(height)
        at += 2 if marker in JPEG_BARE_MARKERS else 2 + int(struct.unpack_from(">H", data, at + 2)[0])
    return 0
