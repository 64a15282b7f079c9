"""Turns of a planar range scanner from its packets: LDROBOT LD06, LD19 (D300) and STL-27L. Pure.

The scanner writes without being asked. A packet (LD06 development manual, section 3; all numbers low byte first) is
0x54, 0x2C, the speed [degrees/s], the first point's angle [0.01 degrees], 12 points of a distance [mm, 16 bits] and an
intensity [8 bits], the last point's angle, a time [ms], and a checksum. Angles go clockwise from the mark on its case.
"""

import math
import struct
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from paani.config.sensors import LidarConfig
from paani.messages import RangeScan

HEADER, POINTS = b"\x54\x2c", 12
LAYOUT = struct.Struct("<2sHH" + "HB" * POINTS + "HHB")
POLYNOMIAL = 0x4D  # of the checksum, which begins with 0
BEAMS = 360  # of a turn as it is published: the slowest of the three measures every 0.8 degrees
CENTIDEGREES = 36_000  # in a turn
WHOLE_DEG = 300.0  # that packets must cover for a turn; one that is lost leaves a gap of 10
SPEED_DPS = range(1_000, 10_000)  # of a scanner that turns; they make 5 to 13 turns a second


class Turn(NamedTuple):
    """One turn: the nearest range in each degree, counter-clockwise from the boat's stern, and how long it took."""

    ranges_m: tuple[float, ...]
    duration_s: float


def checksum(data: bytes) -> int:
    """The checksum of a packet's bytes before it: CRC-8 with `POLYNOMIAL`."""
    value = 0
    for byte in data:
        value = CHECKSUMS[value ^ byte]
    return value


def _shift_out(value: int) -> int:
    for _ in range(8):
        value = (value << 1 ^ POLYNOMIAL if value & 0x80 else value << 1) & 0xFF
    return value


CHECKSUMS = tuple(_shift_out(value) for value in range(256))


class TurnAssembler:
    """Cuts packets out of the bytes it is fed, and puts whole turns together; keeps at most one unfinished packet."""

    def __init__(self, config: LidarConfig) -> None:
        self._config = config
        self._waiting = bytearray()
        self._nearest_m = np.full(BEAMS, np.inf)
        self._covered_deg, self._angle = 0.0, -1
        self.packets = self.checksum_failures = 0

    def feed(self, data: bytes) -> list[Turn]:
        """The turns that end within `data`."""
        self._waiting += data
        return [turn for fields in self._cut() if (turn := self._take(*fields)) is not None]

    def _cut(self) -> Iterator[tuple[int, int, tuple[int, ...], int]]:
        """Speed, first angle, distances and last angle of each whole packet. A false start hides nothing after it."""
        while (start := self._waiting.find(HEADER)) >= 0 and len(self._waiting) - start >= LAYOUT.size:
            packet = bytes(self._waiting[start : start + LAYOUT.size])
            if checksum(packet[:-1]) != packet[-1]:
                self.checksum_failures += 1
                del self._waiting[: start + 1]
                continue
            del self._waiting[: start + LAYOUT.size]
            self.packets += 1
            _, speed_dps, first, *points, last, _, _ = LAYOUT.unpack(packet)
            if speed_dps in SPEED_DPS and first < CENTIDEGREES and last < CENTIDEGREES:
                yield speed_dps, first, tuple(points[::2]), last
        if start < 0:
            del self._waiting[: max(len(self._waiting) - 1, 0)]

    def _take(self, speed_dps: int, first: int, distances_mm: tuple[int, ...], last: int) -> Turn | None:
        """The turn that this packet's beginning ends."""
        turn = None
        if first < self._angle:
            if self._covered_deg >= WHOLE_DEG:
                nearest_m = np.where(np.isfinite(self._nearest_m), self._nearest_m, 0.0)
                turn = Turn(tuple(nearest_m.tolist()), 360.0 / speed_dps)
            self._nearest_m[:], self._covered_deg = np.inf, 0.0
        self._angle = first
        span = (last - first) % CENTIDEGREES
        self._covered_deg += span / 100.0 * POINTS / (POINTS - 1)
        for number, distance_mm in enumerate(distances_mm):
            range_m = 1e-3 * distance_mm
            if self._config.near_m <= range_m <= self._config.max_range_m:
                clockwise_deg = (first + span * number / (POINTS - 1)) / 100.0 + self._config.offset_deg
                beam = round(180.0 - clockwise_deg) % BEAMS
                self._nearest_m[beam] = min(self._nearest_m[beam], range_m)
        return turn


def scan_message(turn: Turn, config: LidarConfig, now_us: int) -> RangeScan:
    """The scan of a turn whose last bytes have just come: it was measured half a turn ago, in the mean."""
    return RangeScan(
        source_us=max(now_us - round(0.5e6 * turn.duration_s), 0),
        ranges_m=turn.ranges_m,
        first_bearing_rad=-math.pi,
        step_rad=2.0 * math.pi / BEAMS,
        max_range_m=config.max_range_m,
        forward_m=config.forward_m,
    )
