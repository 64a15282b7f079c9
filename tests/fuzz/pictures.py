"""Pictures that are none, or claim to be what nobody could hold: on the bus, through both networks, and in files."""

from __future__ import annotations

import random
import struct
import zlib
from pathlib import Path

import cv2
import msgspec
import numpy as np

from paani import messages as m
from paani.arrays import U8
from paani.clock import stopwatch_ms
from paani.config import load_config
from paani.cores import load_perceiver
from paani.errors import UserError
from paani_services.camera.picture_sources import read_picture
from paani_services.perception.picture_decoding import MAX_PIXELS, decode_picture
from tests.fuzz.damage import damaged_bytes
from tests.fuzz.target import ContractError, Target, refusal_of
from tests.places import ROOT

SCENES = ROOT / "examples" / "pictures"
MAX_FILE_PIXELS = 2**26
SIZES = (0, 1, 2, 16, 320, 65_535)
BUS_SUFFIXES, FILE_SUFFIXES = (".jpg", ".png"), (".jpg", ".png", ".bmp", ".webp", ".tiff")


def encoded(suffixes: tuple[str, ...]) -> tuple[bytes, ...]:
    """Small pictures in colour, grey and 16 bit in each format that holds them."""
    ramp = np.arange(48 * 64 * 3, dtype=np.uint32).reshape(48, 64, 3)
    colour, grey = (ramp % 251).astype(np.uint8), (ramp[:, :, 0] % 251).astype(np.uint8)
    found = [cv2.imencode(suffix, picture)[1].tobytes() for suffix in suffixes for picture in (colour, grey)]
    deep = [cv2.imencode(suffix, (ramp * 5).astype(np.uint16))[1].tobytes() for suffix in suffixes if suffix == ".png"]
    progressive = cv2.imencode(".jpg", colour, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
    return (*found, *deep, progressive)


def claiming(rng: random.Random) -> bytes:
    """A few bytes that state a size of their own: bombs, and headers without a picture."""
    width, height = rng.choice(SIZES), rng.choice(SIZES)
    match rng.randrange(5):
        case 0:
            size = struct.pack(">II", *(rng.choice((1, 70_000, 2**31 - 1, 2**32 - 1)) for _ in "wh"))
            head = b"IHDR" + size + bytes((rng.choice((1, 8, 16)), rng.choice((0, 2, 3, 6)), 0, 0, rng.randrange(2)))
            data = b"IDAT" + zlib.compress(bytes(1000))
            chunks = (head, data, b"IEND")
            parts = (struct.pack(">I", len(c) - 4) + c + struct.pack(">I", zlib.crc32(c)) for c in chunks)
            return b"\x89PNG\r\n\x1a\n" + b"".join(parts)
        case 1:
            frame = b"\xff" * rng.choice((1, 2, 9)) + bytes((rng.choice((0xC0, 0xC1, 0xC2, 0xC4, 0xCF)),))
            frame += struct.pack(">HBHHB", rng.choice((11, 17, 0, 3)), 8, height, width, 3) + b"\x01\x22\x00" * 3
            return b"\xff\xd8" + frame + b"\xff\xda" + rng.randbytes(60) + b"\xff\xd9"
        case 2:
            bits, packing = rng.choice(((8, 1), (4, 2), (24, 0), (1, 0)))
            info = struct.pack(
                "<IiiHHIIiiII",
                40,
                rng.choice((1, 60_000)),
                rng.choice((1, -60_000, 60_000)),
                1,
                bits,
                packing,
                *[0] * 5,
            )
            return b"BM" + struct.pack("<IHHI", 54, 0, 0, 54) + info + rng.randbytes(40)
        case 3:
            return b"GIF89a" + struct.pack("<HH", width, height) + b"\x80\x00\x00" + bytes(6) + b"\x2c" + bytes(12)
    ifd = struct.pack("<HHIHHI", 256, 4, 1, 0, 0, 0)[:12]
    return b"II*\x00\x08\x00\x00\x00" + struct.pack("<H", 1) + ifd + rng.randbytes(20)


def require_picture(bgr: U8 | None, at_most: int = MAX_PIXELS) -> None:
    """Raises ContractError for what is no picture within its bounds."""
    if bgr is not None and (bgr.dtype != np.uint8 or bgr.ndim != 3 or not 0 < bgr.shape[0] * bgr.shape[1] <= at_most):
        raise ContractError(f"a picture {bgr.shape} of {bgr.dtype}")


class BusPictures(Target):
    """A picture as the bus brings it."""

    name, share = "picture on the bus (JPEG, PNG)", 40

    def __init__(self, folder: Path, rng: random.Random) -> None:
        super().__init__(folder, rng)
        self._seeds = encoded(BUS_SUFFIXES)

    def payload(self) -> bytes:
        if self.rng.random() < 0.3:
            return claiming(self.rng)
        return damaged_bytes(self.rng.choice(self._seeds), self.rng, self._seeds)

    def take(self, data: bytes) -> str:
        bgr = decode_picture(data)
        require_picture(bgr)
        return "no picture" if bgr is None else ""


class PicturesThroughNetworks(BusPictures):
    """The same through the image-quality check and both networks: evidence in bounds, whatever comes."""

    name, share = "picture through both networks", 2

    def __init__(self, folder: Path, rng: random.Random) -> None:
        super().__init__(folder, rng)
        self._seeds = (*self._seeds, *(path.read_bytes() for path in sorted(SCENES.glob("*.jpg"))))
        self._perceiver = load_perceiver(load_config().perception, stopwatch_ms)
        self._count = 0

    def take(self, data: bytes) -> str:
        self._count += 1
        bgr = decode_picture(data)
        height, width = (self.rng.choice(SIZES), 1) if bgr is None or self.rng.random() < 0.1 else bgr.shape[:2]
        header = m.PictureHeader(
            source_us=self._count * 200_000, frame_seq=self._count, frame_epoch=1, width_px=width, height_px=height,
            media_type="text/x", seq=self._count,
        )  # fmt: skip
        age_s = 1e6 if self.rng.random() < 0.1 else 0.1
        evidence, mask = self._perceiver.perceive(data, header, age_s, self.rng.choice((0.0, 9.0)))
        msgspec.json.decode(msgspec.json.encode(evidence), type=m.Evidence)  # its bounds hold
        if evidence.usable is (mask is None):
            raise ContractError("a mask without evidence, or evidence without a mask")
        return evidence.cause.value if not evidence.usable else ""

    def close(self) -> None:
        self._perceiver.close()


class PictureFiles(Target):
    """A picture of a folder that stands for a camera."""

    name, share = "picture file of a camera", 20

    def __init__(self, folder: Path, rng: random.Random) -> None:
        super().__init__(folder, rng)
        self._seeds = encoded(FILE_SUFFIXES)

    def payload(self) -> bytes:
        if self.rng.random() < 0.3:
            return claiming(self.rng)
        return damaged_bytes(self.rng.choice(self._seeds), self.rng, self._seeds)

    def take(self, data: bytes) -> str:
        path = self.folder / "hostile.png"
        path.write_bytes(data)
        try:
            bgr = read_picture(path)
        except UserError as error:
            return refusal_of(error, path)
        require_picture(bgr, MAX_FILE_PIXELS)
        return "no picture" if bgr is None else ""


PICTURES: tuple[type[Target], ...] = (BusPictures, PicturesThroughNetworks, PictureFiles)
