"""Pictures as RTP packets: what travels is what a receiver makes the same picture of."""

from __future__ import annotations

import struct

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_services.mavlink.rtp_jpeg import CLOCK_HZ, MAX_PAYLOAD_BYTES, packets, parse_scan


def encoded(width_px: int, height_px: int, *options: int, is_grey: bool = False) -> bytes:
    noise = np.random.default_rng(7).integers(0, 255, (height_px, width_px, 3), dtype=np.uint8)
    return cv2.imencode(".jpg", noise[..., 0] if is_grey else noise, list(options))[1].tobytes()


@pytest.mark.parametrize(
    ("sampling", "kind"),
    [(cv2.IMWRITE_JPEG_SAMPLING_FACTOR_422, 0), (cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420, 1)],
)
def test_packets_carry_the_scan_and_its_tables(sampling: int, kind: int) -> None:
    jpeg = encoded(324, 240, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, sampling)
    scan = parse_scan(jpeg)
    assert scan is not None
    sent = list(packets(scan, sequence=65_535, source_us=2_000_000, source_id=0xCAFE))
    data = b""
    for number, packet in enumerate(sent):
        version, mark, sequence, stamp, source_id = struct.unpack_from(">BBHII", packet)
        assert (version, mark) == (0x80, 26 + 128 * (number == len(sent) - 1))
        assert (sequence, stamp, source_id) == ((65_535 + number) % 65_536, 2 * CLOCK_HZ, 0xCAFE)
        assert len(packet) <= 12 + MAX_PAYLOAD_BYTES
        assert int.from_bytes(packet[13:16], "big") == len(data)
        assert tuple(packet[16:20]) == (kind, 255, 41, 30)  # sides in blocks of eight, the last one cut
        head = 20
        if number == 0:
            assert packet[20:24] == b"\0\0\0\x80"
            assert all(table in jpeg for table in (packet[24:88], packet[88:152]))
            head = 152
        data += packet[head:]
    assert len(sent) > 10
    assert jpeg.endswith(data + b"\xff\xd9")


@pytest.mark.parametrize(
    "jpeg",
    [
        b"",
        b"no picture",
        encoded(64, 64, is_grey=True),
        encoded(64, 64, cv2.IMWRITE_JPEG_PROGRESSIVE, 1),
        encoded(64, 64, cv2.IMWRITE_JPEG_OPTIMIZE, 1),
        encoded(64, 64, cv2.IMWRITE_JPEG_RST_INTERVAL, 2),
        encoded(64, 64, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444),
        encoded(2048, 16),
        encoded(64, 64).replace(b"\xff\xdb\0\x43\1", b"\xff\xdb\0\x43\2"),  # no table for the colours
        cv2.imencode(".png", np.zeros((8, 8, 3), np.uint8))[1].tobytes(),
    ],
)
def test_what_a_receiver_could_not_read_does_not_travel(jpeg: bytes) -> None:
    assert parse_scan(jpeg) is None


@given(at=st.integers(0, 700), value=st.integers(0, 255), length=st.integers(0, 700))
def test_a_damaged_picture_is_a_scan_or_none(at: int, value: int, length: int) -> None:
    jpeg = bytearray(encoded(32, 32))
    jpeg[at % len(jpeg)] = value
    parse_scan(bytes(jpeg))
    assert parse_scan(bytes(jpeg[:length])) is None or length > 600
