"""What devices write: sentences and messages with their checksums."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import reduce

from paani_services.sensors.lidar_packets import HEADER, LAYOUT, checksum


def sentence(body: str) -> str:
    """`$BODY*HH` with its line end."""
    return f"${body}*{reduce(lambda found, byte: found ^ byte, body.encode(), 0):02X}\r\n"


def rmc(clock: str = "123519", latitude: str = "4807.0380,N", knots: float = 0.0, course_deg: float = 0.0) -> bytes:
    return sentence(f"GPRMC,{clock},A,{latitude},01131.0000,E,{knots:.2f},{course_deg:.2f},230394,,").encode()


def imu_line(ms: int, accel: tuple[float, ...] = (0.0, 0.0, 9.81), rates: tuple[float, ...] = (0.0, 0.0, 0.0)) -> bytes:
    """An MPU6050's line: m/s^2 and degrees a second."""
    numbers = ",".join(f"{number:.5f}" for number in (*accel, *rates))
    return sentence(f"PQTMIMU,{ms},{numbers},0,0").encode()


def ubx(message: bytes, payload: bytes) -> bytes:
    """A UBX message by its class and id (u-blox interface description: 8-bit Fletcher over all but the header)."""
    body = message + struct.pack("<H", len(payload)) + payload
    a = b = 0
    for byte in body:
        a = (a + byte) & 0xFF
        b = (b + a) & 0xFF
    return b"\xb5\x62" + body + bytes((a, b))


def nav_pvt(
    itow_ms: int = 1000,
    *,
    latitude_deg: float = 48.1173,
    longitude_deg: float = 11.5166667,
    sog_mmps: int = 1500,
    course_deg: float = 90.0,
    accuracy_mm: int = 1200,
    fix_type: int = 3,
    flags: int = 1,
    flags3: int = 0,
) -> bytes:
    """A NAV-PVT of an M8, written field by field from the u-blox interface description."""
    payload = struct.pack(
        "<IHBBBBBBIiBBBBiiiiIIiiiiiIIHH4sihH",
        itow_ms, 2026, 1, 2, 12, 35, 19, 7, 50, 0, fix_type, flags, 0, 12,
        round(longitude_deg * 1e7), round(latitude_deg * 1e7), 545_400, 498_500, accuracy_mm, 2000,
        0, sog_mmps, 0, sog_mmps, round(course_deg * 1e5), 100, 500_000, 110, flags3, bytes(4), 0, 0, 0,
    )  # fmt: skip
    assert len(payload) == 92
    return ubx(b"\x01\x07", payload)


def lidar_turn(range_m: Callable[[float], float], speed_dps: int = 3600, begins_deg: float = 0.0) -> bytes:
    """One turn of an LD19: packets of 12 points 0.8 degrees apart, whose ranges are those of their clockwise angle."""
    data = b""
    for packet in range(38):
        angles = [begins_deg + 0.8 * (12 * packet + point) for point in range(12)]
        points = [(round(1000.0 * range_m(each % 360.0)), 200) for each in angles if each < begins_deg + 360.0]
        if len(points) == 12:
            ends = [round(100.0 * (each % 360.0)) for each in (angles[0], angles[-1])]
            fields = [value for point in points for value in point]
            body = LAYOUT.pack(HEADER, speed_dps, ends[0], *fields, ends[1], 0, 0)[:-1]
            data += body + bytes([checksum(body)])
    return data
