"""GPS fixes from NMEA 0183 (RMC, GGA, GLL, VTG, GST) and from UBX (NAV-PVT). Pure.

A receiver gives courses clockwise from true north and speeds in knots or mm/s; a fix has ENU courses and metres a
second.
"""

from collections import Counter
from collections.abc import Iterable, Iterator

import msgspec
from pyubx2 import UBXReader
from pyubx2.exceptions import UBXMessageError, UBXParseError, UBXStreamError, UBXTypeError

from paani.messages import GpsFix
from paani_services.sensors.sentences import Sentence, course_rad, read_sentence

MPS_PER_KNOT = 1852.0 / 3600.0
# Standard deviation of one range of a single-frequency receiver; times HDOP it is that of the position (the GPS SPS
# performance standard has 8 m at 95 %).
RANGE_ERROR_M = 5.0
UNKNOWN_STD_M = 10.0  # of a position without HDOP; above `LocalizationConfig.max_position_std_m`, so never healthy
WORST_HDOP = 99.99  # receivers write this for none
WORST_STD_M = 1e6  # u-blox receivers without a fix state 4e9 mm
COURSELESS_MPS = 0.5  # at rest receivers leave the course empty; what moves faster has one
MAX_KNOTS = 1e6  # what can be sent; localization judges what a boat can do
DAY_S, WEEK_S = 86_400.0, 604_800.0
SET_FIXES = 2  # so many in order before the time is reached again from which it was set back
RESYNC_FIXES = 5  # so many in order after a step back in time: the receiver's clock was set, not the line disturbed
# By the mode of a position or a speed, and by the quality of GGA (9: SBAS); others are estimated, simulated, typed in,
# or not valid.
MEASURED_MODES = frozenset({"", "A", "D", "F", "P", "R"})
MEASURED_QUALITIES = frozenset({"1", "2", "3", "4", "5", "9"})
NAV_PVT = b"\x01\x07"
NAV_PVT_BYTES = 84  # of u-blox 7; later ones add 8
FIX_TYPES = frozenset({2, 3, 4})  # 2D, 3D, GNSS with dead reckoning; 1 is dead reckoning alone
_UBX_ERRORS = (
    UBXMessageError, UBXParseError, UBXStreamError, UBXTypeError,
    IndexError, KeyError, AttributeError, TypeError, ValueError, ArithmeticError,
)  # fmt: skip


class FixDecoder:
    """A fix for each NAV-PVT; from a receiver without it for each RMC; without that for each GLL after a VTG.

    `source_us` of a fix is the receiver's time since the first day (UBX: week) began; with a live receiver the caller
    replaces it by its own. Fixes out of order are counted in `drops` and left out, unless the receiver goes on in
    order at an earlier time.
    """

    def __init__(self, drops: Counter[str]) -> None:
        self._drops = drops
        self._std_m: float | None = None  # of the last GST
        self._hdop_std_m, self._is_measured = UNKNOWN_STD_M, True  # by the last GGA
        self._course: Sentence | None = None  # the last VTG, until a GLL takes it
        self._has_rmc = self._has_pvt = False
        self._last_s, self._offset_s = -1.0, 0.0
        self._refused_s = -1.0  # newest time that was refused
        self._refusals_in_order = 0
        self.repeats = 0
        """How often in a row the same time came again."""
        self.was_set = False
        """Whether the receiver's clock was set back before the newest fix."""

    def take_sentence(self, sentence: Sentence) -> GpsFix | None:
        """The fix that this sentence completes. Raises ValueError for one that is damaged."""
        fix: GpsFix | None = None
        match sentence.kind:
            case "GGA":
                hdop = sentence.number("HDOP", 0.0)
                self._hdop_std_m = RANGE_ERROR_M * min(hdop, WORST_HDOP) if hdop else UNKNOWN_STD_M
                self._is_measured = sentence.text("quality") in MEASURED_QUALITIES
            case "GST":
                stds_m = [sentence.number(name, 0.0) for name in ("stdLat", "stdLong")]
                self._std_m = max((std_m for std_m in stds_m if std_m), default=None)
            case "VTG":
                _speed_mps(sentence, "sogn"), _course_of(sentence, "cogt")
                self._course = sentence
            case "RMC":
                self._has_rmc = True
                fix = self._fix(sentence, sentence, "spd", "cog")
            case "GLL" if not self._has_rmc and self._course and self._course.text("sogn"):
                fix = self._fix(sentence, self._course, "sogn", "cogt")
                self._course = None
        if fix is None or self._has_pvt:
            return None
        if not sentence.text("time"):  # a receiver that has heard no satellite yet
            return msgspec.structs.replace(fix, source_us=round(max(self._last_s, 0.0) * 1e6))
        return self._in_order(fix, DAY_S)

    def take_ubx(self, frame: bytes) -> GpsFix | None:
        """The fix of a NAV-PVT message. Raises ValueError for one that pyubx2 cannot read or that is too short."""
        if frame[2:4] != NAV_PVT:
            return None
        if len(frame) - 8 < NAV_PVT_BYTES:
            raise ValueError("NAV-PVT: too short")
        try:
            pvt = UBXReader.parse(frame)
        except _UBX_ERRORS as error:
            raise ValueError(f"NAV-PVT: {error}") from error
        if abs(pvt.lat) > 90.0 or abs(pvt.lon) > 180.0 or pvt.gSpeed < 0 or not 0 <= pvt.iTOW < WEEK_S * 1e3:
            raise ValueError("NAV-PVT: impossible position, speed or time")
        if not self._has_pvt and self._last_s >= 0.0:  # another clock from here on
            self._offset_s = self._last_s + 1e-3 - pvt.iTOW * 1e-3
        self._has_pvt = True
        is_fixed = pvt.gnssFixOk == 1 and pvt.fixType in FIX_TYPES and pvt.invalidLlh == 0
        fix = GpsFix(
            source_us=pvt.iTOW * 1000,
            latitude_deg=pvt.lat,
            longitude_deg=pvt.lon,
            sog_mps=pvt.gSpeed * 1e-3,
            cog_rad=course_rad(pvt.headMot),
            # Of both axes together, so no less than that of each. No receiver knows its position exactly.
            position_std_m=min(pvt.hAcc * 1e-3, WORST_STD_M) if pvt.hAcc else UNKNOWN_STD_M,
            fix=is_fixed,
        )
        return self._in_order(fix, WEEK_S)

    def _fix(self, position: Sentence, course: Sentence, speed_name: str, course_name: str) -> GpsFix:
        day_s = position.day_s()
        latitude_deg = position.angle_deg("lat", "NS", 90.0)
        longitude_deg = position.angle_deg("lon", "EW", 180.0)
        sog_mps, cog_rad = _speed_mps(course, speed_name), _course_of(course, course_name)
        has_speed = sog_mps is not None and cog_rad is not None
        is_speed_known = sog_mps is not None and (has_speed or sog_mps <= COURSELESS_MPS)
        modes = {position.text("posMode"), course.text("posMode")}
        is_valid = position.text("status") == "A" and self._is_measured and modes <= MEASURED_MODES
        return GpsFix(
            source_us=round((day_s or 0.0) * 1e6),
            latitude_deg=latitude_deg or 0.0,
            longitude_deg=longitude_deg or 0.0,
            sog_mps=sog_mps or 0.0 if has_speed else 0.0,
            cog_rad=cog_rad or 0.0,
            position_std_m=self._hdop_std_m if self._std_m is None else self._std_m,
            fix=is_valid and is_speed_known and None not in {day_s, latitude_deg, longitude_deg},
        )

    def _in_order(self, fix: GpsFix, span_s: float) -> GpsFix | None:
        """The fix with its time counted on from the first day or week; None if it is not after the last one."""
        time_s = fix.source_us * 1e-6
        at_s = time_s + self._offset_s
        if at_s < self._last_s - 0.5 * span_s:  # midnight, or the end of the week
            at_s += span_s
        self.was_set = at_s <= self._last_s
        if self.was_set:
            self.repeats = self.repeats + 1 if at_s == self._last_s else 0
            self._refusals_in_order = self._refusals_in_order + 1 if time_s > self._refused_s else 1
            self._refused_s = time_s
            if self._refusals_in_order < RESYNC_FIXES or self.repeats:
                self._drops["gps_late"] += 1
                return None
            at_s = self._last_s + 1e-3
        self.was_set = self.was_set or self._refusals_in_order >= SET_FIXES
        self._offset_s, self._last_s = at_s - time_s, at_s
        self.repeats = self._refusals_in_order = 0
        self._refused_s = -1.0
        return msgspec.structs.replace(fix, source_us=round(at_s * 1e6))


def fixes_from_sentences(lines: Iterable[str], drops: Counter[str]) -> Iterator[GpsFix]:
    """The fixes of a recorded log; damaged sentences are counted in `drops` and left out."""
    decoder = FixDecoder(drops)
    for line in lines:
        if not line.startswith("$"):
            continue
        try:
            _, sentence = read_sentence(line.encode())
            fix = decoder.take_sentence(sentence) if sentence is not None else None
        except ValueError:
            drops["nmea_damaged"] += 1
            continue
        if fix is not None:
            yield fix


def _speed_mps(sentence: Sentence, name: str) -> float | None:
    knots = sentence.number(name, 0.0, MAX_KNOTS)
    return None if knots is None else knots * MPS_PER_KNOT


def _course_of(sentence: Sentence, name: str) -> float | None:
    degrees = sentence.number(name, 0.0, 360.0)
    return None if degrees is None else course_rad(degrees)
