"""NMEA 0183, the sentences by which a GPS tells where it is: GGA, RMC, GLL, VTG (IEC 61162-1). Pure.

A receiver's speed and course are clockwise from true north and in knots; ours are ENU and metres a second.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator

import msgspec

from paani.geometry import wrap_rad
from paani.messages import GpsFix

MPS_PER_KNOT = 1852.0 / 3600.0
RANGE_ERROR_M = (
    5.0  # of one range of a single-frequency receiver, times HDOP (GPS SPS performance standard: 8 m at 95 %)
)
UNKNOWN_STD_M = 10.0  # without HDOP; more than `LocalizationConfig.max_position_std_m`, so no boat sails by it
WORST_HDOP = 99.99  # how receivers write that they have none
DAY_S = 86_400.0
_PLAIN = re.compile(r"[0-9]{1,9}(\.[0-9]{0,9})?", re.ASCII)
MAX_LENGTH = 120  # the standard allows 82; receivers write more


class Fields(msgspec.Struct, frozen=True, kw_only=True):
    """What one sentence says; None where it says nothing. `day_s`: UTC seconds of the day."""

    kind: str
    day_s: float | None = None
    valid: bool | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    sog_mps: float | None = None
    cog_rad: float | None = None
    hdop: float | None = None


def parse(line: str) -> Fields | None:
    """One sentence. None: none of ours, or not a sentence. Raises ValueError for a damaged one."""
    line = line.strip()
    if len(line) < 7 or line[0] != "$" or line[3:6] not in _READERS:
        return None
    body, star, checksum = line[1:].partition("*")
    if len(line) > MAX_LENGTH or not star or checksum.upper() != f"{_checksum(body):02X}":
        raise ValueError("length or checksum")
    words = body.split(",")
    if len(words) < _WORDS[line[3:6]]:
        raise ValueError("too few words")
    return _READERS[line[3:6]](words)


def fixes(lines: Iterable[str], drops: Counter[str]) -> Iterator[GpsFix]:
    """A fix for each RMC, or, of a receiver without, for each GLL that follows a VTG; its spread from the last GGA.

    `source_us` is UTC since the first day began: who hears a receiver live puts its own time there. Sentences damaged
    or out of order are counted in `drops` and passed over. A position marked invalid gives a fix that says so.
    """
    std_m, course, has_rmc, last_s = UNKNOWN_STD_M, Fields(kind="VTG"), False, -1.0
    for line in lines:
        try:
            found = parse(line)
        except ValueError:
            drops["nmea_damaged"] += 1
            continue
        if found is None:
            continue
        if found.kind == "GGA":
            std_m = UNKNOWN_STD_M if found.hdop is None else RANGE_ERROR_M * min(found.hdop, WORST_HDOP)
        elif found.kind == "VTG":
            course = found
        elif found.kind == "RMC" or (not has_rmc and course.sog_mps is not None):
            has_rmc = has_rmc or found.kind == "RMC"
            at_s = _after(found.day_s or 0.0, last_s)
            if at_s is None:
                drops["nmea_late"] += 1
                continue
            yield _fix(found, found if found.kind == "RMC" else course, std_m, at_s)
            last_s, course = at_s, Fields(kind="VTG")


def _after(day_s: float, last_s: float) -> float | None:
    """The time of day counted from the first day; None if it is not after `last_s`."""
    at_s = day_s + max(0.0, last_s) // DAY_S * DAY_S
    if at_s < last_s - 0.5 * DAY_S:
        at_s += DAY_S
    return at_s if at_s > last_s else None


def _fix(place: Fields, course: Fields, std_m: float, at_s: float) -> GpsFix:
    known = course.sog_mps is not None and course.cog_rad is not None  # a receiver at rest leaves the course empty
    return GpsFix(
        source_us=round(at_s * 1e6),
        latitude_deg=place.latitude_deg or 0.0,
        longitude_deg=place.longitude_deg or 0.0,
        sog_mps=course.sog_mps or 0.0 if known else 0.0,
        cog_rad=course.cog_rad or 0.0,
        position_std_m=std_m,
        fix=bool(place.valid) and place.latitude_deg is not None and place.longitude_deg is not None,
    )


def _gga(words: list[str]) -> Fields:
    valid = words[6] not in {"", "0"}
    return Fields(kind="GGA", day_s=_day_s(words[1]), valid=valid, hdop=_number(words[8]) if valid else None)


def _rmc(words: list[str]) -> Fields:
    return Fields(
        kind="RMC",
        day_s=_day_s(words[1]),
        valid=words[2] == "A",
        latitude_deg=_degrees(words[3], words[4], "NS", 90.0),
        longitude_deg=_degrees(words[5], words[6], "EW", 180.0),
        sog_mps=_speed_mps(words[7]),
        cog_rad=_course_rad(words[8]),
    )


def _gll(words: list[str]) -> Fields:
    return Fields(
        kind="GLL",
        latitude_deg=_degrees(words[1], words[2], "NS", 90.0),
        longitude_deg=_degrees(words[3], words[4], "EW", 180.0),
        day_s=_day_s(words[5]),
        valid=words[6] == "A",
    )


def _vtg(words: list[str]) -> Fields:
    return Fields(kind="VTG", cog_rad=_course_rad(words[1]), sog_mps=_speed_mps(words[5]))


_WORDS = {"GGA": 9, "RMC": 9, "GLL": 7, "VTG": 6}
_READERS: dict[str, Callable[[list[str]], Fields]] = {"GGA": _gga, "RMC": _rmc, "GLL": _gll, "VTG": _vtg}


def _checksum(body: str) -> int:
    found = 0
    for byte in body.encode():
        found ^= byte
    return found


def _number(word: str) -> float | None:
    """None for an empty word. Raises ValueError for one that is no plain, finite, positive number."""
    if not word:
        return None
    if not _PLAIN.fullmatch(word):
        raise ValueError(word)
    return float(word)


def _day_s(word: str) -> float | None:
    """hhmmss.sss."""
    if not word:
        return None
    number = _number(word)
    if number is None or len(word.partition(".")[0]) != 6:
        raise ValueError(word)
    hours, minutes, seconds = int(word[:2]), int(word[2:4]), float(word[4:])
    if hours > 23 or minutes > 59 or seconds >= 61.0:
        raise ValueError(word)
    return hours * 3600.0 + minutes * 60.0 + seconds


def _degrees(word: str, side: str, sides: str, limit_deg: float) -> float | None:
    """Degrees and minutes, dddmm.mmm, positive to the north and east."""
    number = _number(word)
    if number is None:
        return None
    degrees, minutes = divmod(number, 100.0)
    found = degrees + minutes / 60.0
    if side not in sides or not side or minutes >= 60.0 or found > limit_deg:
        raise ValueError(word)
    return found if side == sides[0] else -found


def _speed_mps(knots: str) -> float | None:
    number = _number(knots)
    return None if number is None else number * MPS_PER_KNOT


def _course_rad(word: str) -> float | None:
    """ENU, of a course clockwise from true north."""
    number = _number(word)
    return None if number is None else wrap_rad(math.radians(90.0 - number))
