"""NMEA 0183 (IEC 61162-1): GPS fixes from the sentences GGA, RMC, GLL and VTG. Pure.

A receiver gives courses clockwise from true north and speeds in knots; a fix has ENU courses and metres a second.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator

import msgspec

from paani.geometry import wrap_rad
from paani.messages import GpsFix

MPS_PER_KNOT = 1852.0 / 3600.0
# Standard deviation of one range of a single-frequency receiver; times HDOP it is that of the position (the GPS SPS
# performance standard has 8 m at 95 %).
RANGE_ERROR_M = 5.0
UNKNOWN_STD_M = 10.0  # of a position without HDOP; above `LocalizationConfig.max_position_std_m`, so never healthy
WORST_HDOP = 99.99  # receivers write this for none
DAY_S = 86_400.0
_PLAIN_NUMBER = re.compile(r"[0-9]{1,9}(\.[0-9]{0,9})?", re.ASCII)
MAX_LENGTH = 120  # characters of a sentence: the standard allows 82, but receivers write more


class Sentence(msgspec.Struct, frozen=True, kw_only=True):
    """One decoded sentence; None where it leaves a field empty. `day_s`: UTC seconds of the day."""

    kind: str
    day_s: float | None = None
    valid: bool | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    sog_mps: float | None = None
    cog_rad: float | None = None
    hdop: float | None = None


def parse_sentence(line: str) -> Sentence | None:
    """Decode one sentence; None for another kind of sentence or none at all. Raises ValueError for a damaged one."""
    line = line.strip()
    if len(line) < 7 or line[0] != "$" or line[3:6] not in _READERS:
        return None
    body, star, checksum = line[1:].partition("*")
    if len(line) > MAX_LENGTH or not star or checksum.upper() != f"{_checksum(body):02X}":
        raise ValueError("length or checksum")
    fields = body.split(",")
    if len(fields) < _MIN_FIELDS[line[3:6]]:
        raise ValueError("too few fields")
    return _READERS[line[3:6]](fields)


def fixes_from_sentences(lines: Iterable[str], drops: Counter[str]) -> Iterator[GpsFix]:
    """A fix for each RMC or, from a receiver without RMC, for each GLL after a VTG; its HDOP is that of the last GGA.

    `source_us` is UTC since the first day began; with a live receiver the caller replaces it by its own time.
    Damaged sentences and those out of order are counted in `drops` and skipped. A position marked invalid gives a
    fix that says so.
    """
    std_m, course, has_rmc, last_s = UNKNOWN_STD_M, Sentence(kind="VTG"), False, -1.0
    for line in lines:
        try:
            found = parse_sentence(line)
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
            at_s = _continuous_day_s(found.day_s or 0.0, last_s)
            if at_s is None:
                drops["nmea_late"] += 1
                continue
            yield _fix(found, found if found.kind == "RMC" else course, std_m, at_s)
            last_s, course = at_s, Sentence(kind="VTG")


def _continuous_day_s(day_s: float, last_s: float) -> float | None:
    """The time of day counted on from the first day; None if it is not after `last_s`."""
    at_s = day_s + max(0.0, last_s) // DAY_S * DAY_S
    if at_s < last_s - 0.5 * DAY_S:
        at_s += DAY_S
    return at_s if at_s > last_s else None


def _fix(position: Sentence, course: Sentence, std_m: float, at_s: float) -> GpsFix:
    has_speed = course.sog_mps is not None and course.cog_rad is not None  # at rest receivers leave the course empty
    return GpsFix(
        source_us=round(at_s * 1e6),
        latitude_deg=position.latitude_deg or 0.0,
        longitude_deg=position.longitude_deg or 0.0,
        sog_mps=course.sog_mps or 0.0 if has_speed else 0.0,
        cog_rad=course.cog_rad or 0.0,
        position_std_m=std_m,
        fix=bool(position.valid) and position.latitude_deg is not None and position.longitude_deg is not None,
    )


def _gga(fields: list[str]) -> Sentence:
    valid = fields[6] not in {"", "0"}
    return Sentence(kind="GGA", day_s=_day_s(fields[1]), valid=valid, hdop=_number(fields[8]) if valid else None)


def _rmc(fields: list[str]) -> Sentence:
    return Sentence(
        kind="RMC",
        day_s=_day_s(fields[1]),
        valid=fields[2] == "A",
        latitude_deg=_degrees(fields[3], fields[4], "NS", 90.0),
        longitude_deg=_degrees(fields[5], fields[6], "EW", 180.0),
        sog_mps=_speed_mps(fields[7]),
        cog_rad=_course_rad(fields[8]),
    )


def _gll(fields: list[str]) -> Sentence:
    return Sentence(
        kind="GLL",
        latitude_deg=_degrees(fields[1], fields[2], "NS", 90.0),
        longitude_deg=_degrees(fields[3], fields[4], "EW", 180.0),
        day_s=_day_s(fields[5]),
        valid=fields[6] == "A",
    )


def _vtg(fields: list[str]) -> Sentence:
    return Sentence(kind="VTG", cog_rad=_course_rad(fields[1]), sog_mps=_speed_mps(fields[5]))


_MIN_FIELDS = {"GGA": 9, "RMC": 9, "GLL": 7, "VTG": 6}
_READERS: dict[str, Callable[[list[str]], Sentence]] = {"GGA": _gga, "RMC": _rmc, "GLL": _gll, "VTG": _vtg}


def _checksum(body: str) -> int:
    found = 0
    for byte in body.encode():
        found ^= byte
    return found


def _number(field: str) -> float | None:
    """The field as a number, None if empty. Raises ValueError for one that is no plain, finite, positive number."""
    if not field:
        return None
    if not _PLAIN_NUMBER.fullmatch(field):
        raise ValueError(field)
    return float(field)


def _day_s(field: str) -> float | None:
    """Seconds of the day of a field hhmmss.sss, None if empty. Raises ValueError."""
    if not field:
        return None
    number = _number(field)
    if number is None or len(field.partition(".")[0]) != 6:
        raise ValueError(field)
    hours, minutes, seconds = int(field[:2]), int(field[2:4]), float(field[4:])
    if hours > 23 or minutes > 59 or seconds >= 61.0:
        raise ValueError(field)
    return hours * 3600.0 + minutes * 60.0 + seconds


def _degrees(field: str, side: str, sides: str, limit_deg: float) -> float | None:
    """Degrees of a field dddmm.mmm (degrees and minutes), positive to the first of the two `sides`; None if empty."""
    number = _number(field)
    if number is None:
        return None
    degrees, minutes = divmod(number, 100.0)
    found = degrees + minutes / 60.0
    if side not in sides or not side or minutes >= 60.0 or found > limit_deg:
        raise ValueError(field)
    return found if side == sides[0] else -found


def _speed_mps(knots: str) -> float | None:
    number = _number(knots)
    return None if number is None else number * MPS_PER_KNOT


def _course_rad(field: str) -> float | None:
    """ENU course of a field in degrees clockwise from true north."""
    number = _number(field)
    return None if number is None else wrap_rad(math.radians(90.0 - number))
