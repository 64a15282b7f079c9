"""Pictures as RTP packets of JPEG (RFC 2435). Pure. The camera's own bytes travel; nothing is encoded again."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import NamedTuple

PAYLOAD_TYPE = 26  # JPEG, by RFC 3551
CLOCK_HZ = 90_000
MAX_PAYLOAD_BYTES = 1400  # a packet fits an Ethernet frame
MAX_SIDE_PX = 2040  # eight times what a byte holds
IN_BAND = 255  # the quantisation tables come with each picture
SOI, SOF0, DHT, EOI, SOS, DQT, DRI = 0xD8, 0xC0, 0xC4, 0xD9, 0xDA, 0xDB, 0xDD
SAMPLINGS = {(0x21, 0x11, 0x11): 0, (0x22, 0x11, 0x11): 1}  # of luminance and colours: RFC 2435's type
TABLE_BYTES = 64

# A receiver is not told the Huffman tables: they are those of ITU-T T.81, annex K.3, by class and destination.
_AC_LUMINANCE = bytes.fromhex(
    "0002010303020403050504040000017d"
    "01020300041105122131410613516107227114328191a1082342b1c11552d1f02433627282090a161718191a25262728292a3435363738393a"
    "434445464748494a535455565758595a636465666768696a737475767778797a838485868788898a92939495969798999aa2a3a4a5a6a7a8a9"
    "aab2b3b4b5b6b7b8b9bac2c3c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae1e2e3e4e5e6e7e8e9eaf1f2f3f4f5f6f7f8f9fa"
)
_AC_COLOUR = bytes.fromhex(
    "00020102040403040705040400010277"
    "000102031104052131061241510761711322328108144291a1b1c109233352f0156272d10a162434e125f11718191a262728292a3536373839"
    "3a434445464748494a535455565758595a636465666768696a737475767778797a82838485868788898a92939495969798999aa2a3a4a5a6a7"
    "a8a9aab2b3b4b5b6b7b8b9bac2c3c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae2e3e4e5e6e7e8e9eaf2f3f4f5f6f7f8f9fa"
)
HUFFMAN_TABLES = {
    0x00: bytes.fromhex("00010501010101010100000000000000000102030405060708090a0b"),
    0x10: _AC_LUMINANCE,
    0x01: bytes.fromhex("00030101010101010101010000000000000102030405060708090a0b"),
    0x11: _AC_COLOUR,
}


class Scan(NamedTuple):
    """What of a JPEG file travels. tables: quantisation of luminance and of colour."""

    kind: int
    width_px: int
    height_px: int
    tables: bytes
    data: bytes


def parse_scan(jpeg: bytes) -> Scan | None:
    """None for what RFC 2435 cannot carry: another file, progressive or grey pictures, other tables, too large ones."""
    found: dict[int, bytes] = {}
    kind = width_px = height_px = None
    for marker, body, end in _segments(jpeg):
        if marker == DQT:
            for at in range(0, len(body), TABLE_BYTES + 1):
                found[body[at]] = body[at + 1 : at + 1 + TABLE_BYTES]
        elif (marker == DHT and not _is_standard(body)) or (marker == DRI and any(body)):
            return None
        elif marker == SOF0 and len(body) == 15 and body[0] == 8:
            height_px, width_px = struct.unpack_from(">HH", body, 1)
            kind = SAMPLINGS.get((body[7], body[10], body[13])) if (body[8], body[11], body[14]) == (0, 1, 1) else None
        elif marker == SOS:
            tables = found.get(0, b"") + found.get(1, b"")
            if kind is None or width_px is None or height_px is None or len(tables) != 2 * TABLE_BYTES:
                return None
            if not (0 < width_px <= MAX_SIDE_PX and 0 < height_px <= MAX_SIDE_PX):
                return None
            data = jpeg[end:].removesuffix(bytes([0xFF, EOI]))
            return Scan(kind, width_px, height_px, tables, data)
    return None


def packets(scan: Scan, *, sequence: int, source_us: int, source_id: int) -> Iterator[bytes]:
    """The RTP packets of one picture, numbered from `sequence`, of the stream `source_id`."""
    stamp = source_us * CLOCK_HZ // 1_000_000
    size = bytes([-(-scan.width_px // 8), -(-scan.height_px // 8)])
    at = 0
    while at < len(scan.data):
        head = struct.pack(">B", 0) + at.to_bytes(3, "big") + bytes([scan.kind, IN_BAND]) + size
        if at == 0:
            head += struct.pack(">BBH", 0, 0, len(scan.tables)) + scan.tables
        chunk = scan.data[at : at + MAX_PAYLOAD_BYTES - len(head)]
        at += len(chunk)
        mark = PAYLOAD_TYPE | (0x80 if at == len(scan.data) else 0)
        yield struct.pack(">BBHII", 0x80, mark, sequence % 65_536, stamp % (1 << 32), source_id) + head + chunk
        sequence += 1


def _segments(jpeg: bytes) -> Iterator[tuple[int, bytes, int]]:
    """Marker, content and end of each segment up to the scan; nothing where the file is damaged."""
    if jpeg[:2] != bytes([0xFF, SOI]):
        return
    at = 2
    while at + 4 <= len(jpeg) and jpeg[at] == 0xFF:
        length = int.from_bytes(jpeg[at + 2 : at + 4], "big")
        end = at + 2 + length
        if length < 2 or end > len(jpeg):
            return
        yield jpeg[at + 1], jpeg[at + 4 : end], end
        at = end


def _is_standard(body: bytes) -> bool:
    """Whether every Huffman table of a segment is one that receivers have."""
    at = 0
    while at < len(body):
        table = HUFFMAN_TABLES.get(body[at], b"")
        if not table or body[at + 1 : at + 1 + len(table)] != table:
            return False
        at += 1 + len(table)
    return True
