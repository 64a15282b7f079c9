"""A recorded log as a device: its bytes, and how long to wait before each piece. Pure but for the file it is given."""

import re
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from pyubx2 import UBX_HDR

MAX_LINE_BYTES = 4096  # a log without line ends comes in pieces of this size
MAX_WAIT_S = 10.0  # a longer pause in a log is cut short
UNTIMED_BYTES_PER_S = 11_520.0  # a log without any time comes as on a line of 115200 baud
DAY_S, WEEK_S = 86_400.0, 604_800.0
_NMEA_TIME = re.compile(rb"\$(?:..(?:GGA|RMC|GNS|ZDA|GST)|..GLL,[^,]*,[^,]*,[^,]*,[^,]*),(\d\d)(\d\d)(\d\d(?:\.\d*)?),")
_IMU_TIME = re.compile(rb"\$PQTMIMU,(\d{1,12}),")
_UBX_NAV_PVT = UBX_HDR + b"\x01\x07\x5c\x00"


class Piece(NamedTuple):
    """Bytes of one moment of a log, and how long after the piece before they came."""

    wait_s: float
    data: bytes


def play(log: BinaryIO) -> Iterator[Piece]:
    """The log in pieces, by the first kind of time that it carries: UTC, UBX time of week, or a unit's own clock."""
    clock, last_s, waiting, wait_s = "", 0.0, bytearray(), 0.0
    while line := log.readline(MAX_LINE_BYTES):
        found, at_s, span_s = _time_of(line)
        clock = clock or found
        if not clock:
            yield Piece(len(line) / UNTIMED_BYTES_PER_S, line)
            continue
        if found == clock and at_s != last_s:
            if waiting:
                yield Piece(wait_s, bytes(waiting))
                passed_s = (at_s - last_s) % span_s if span_s else at_s - last_s
                wait_s = min(passed_s, MAX_WAIT_S) if 0.0 < passed_s < 0.5 * (span_s or 1e12) else 0.0
            waiting.clear()
            last_s = at_s
        waiting += line
    if waiting:
        yield Piece(wait_s, bytes(waiting))


def _time_of(line: bytes) -> tuple[str, float, float]:
    """Kind of clock ("" for none), time [s], and after how many seconds that clock begins again (0: never)."""
    if match := _NMEA_TIME.search(line):
        hours, minutes, seconds = (float(text) for text in match.groups())
        return "utc", hours * 3600.0 + minutes * 60.0 + seconds, DAY_S
    start = line.find(_UBX_NAV_PVT)
    if 0 <= start <= len(line) - 10:
        return "ubx", int.from_bytes(line[start + 6 : start + 10], "little") * 1e-3, WEEK_S
    if match := _IMU_TIME.search(line):
        return "imu", int(match[1]) * 1e-3, 0.0
    return "", 0.0, 0.0
