"""Vessels by the AIS reports of a receiver, read by pyais and then held to what a vessel can do. Pure.

A report that cannot follow from the one before is believed when the next one bears it out. What lies is counted by
cause.
"""

import math
from collections import Counter
from typing import Any

import msgspec
from pyais.exceptions import AISBaseException
from pyais.queue import NMEAQueue

from paani.geometry import enu_from_geodetic
from paani.messages import AisVessel
from paani.messages.ais import MAX_VESSELS
from paani_services.sensors.fixes import MPS_PER_KNOT
from paani_services.sensors.sentences import course_rad

SENTENCE = "VDM"  # of other vessels; VDO is of our own
POSITION_TYPES, SIZE_TYPES = frozenset({1, 2, 3, 18, 19}), frozenset({5, 19, 24})
NO_SPEED_KNOTS, NO_COURSE_DEG = 102.3, 360.0  # a report that says so has none (ITU-R M.1371-5, table 48)
MAX_SPEED_MPS = 30.0  # 58 knots: faster than what is licensed on inland waters, by far
JUMP_M = 100.0  # by which two reports may disagree: receivers, and a turn between them
MEMORY_S = 60.0  # of a position; a vessel that has not spoken for longer is not told any more
SIZE_MEMORY_S = 1800.0  # sizes are told every 6 minutes
MAX_SIZES, MAX_UNFINISHED = 1000, 16  # of vessels, and of reports in several sentences, that are remembered
LIBRARY_ERRORS = (AISBaseException, ValueError, IndexError, KeyError, TypeError, AttributeError, ArithmeticError)


class Size(msgspec.Struct, frozen=True):
    """How far a hull reaches from its receiver [m], and when that was told."""

    to_bow_m: float
    to_stern_m: float
    to_port_m: float
    to_starboard_m: float
    told_us: int


class AisReports:
    """Sentences in, vessels out. `own_mmsi`: of our own transponder, 0 without one."""

    def __init__(self, drops: Counter[str], own_mmsi: int = 0) -> None:
        self._drops, self._own_mmsi = drops, own_mmsi
        self._queue = NMEAQueue()
        self._vessels: dict[int, AisVessel] = {}
        self._doubted: dict[int, AisVessel] = {}
        self._sizes: dict[int, Size] = {}

    def take_sentence(self, data: bytes, now_us: int) -> bool:
        """Whether a sentence whose checksum fits ended a position report that is believed. Raises ValueError."""
        if len(self._queue.buffer) > MAX_UNFINISHED:
            self._queue = NMEAQueue()
        try:
            self._queue.put_line(data.strip())
            sentence = self._queue.get_or_none()
            report: Any = None if sentence is None else sentence.decode()  # type: ignore[attr-defined]
            return report is not None and self._take_report(report, now_us)  # of a short one, fields are missing
        except LIBRARY_ERRORS as error:
            raise ValueError(f"AIS: {error}") from error

    def vessels(self, now_us: int) -> tuple[AisVessel, ...]:
        """Those whose position was told within `MEMORY_S`, newest first, each with its size where that is known."""
        self._forget(now_us)
        newest = sorted(self._vessels.values(), key=lambda each: (-each.fixed_us, each.mmsi))
        return tuple(self._with_size(each) for each in newest[:MAX_VESSELS])

    def _take_report(self, report: Any, now_us: int) -> bool:
        kind, mmsi = int(report.msg_type), int(report.mmsi)
        if mmsi == self._own_mmsi and mmsi:
            self._drops["ais_own"] += 1
            return False
        if kind in SIZE_TYPES and hasattr(report, "to_bow"):
            self._take_size(mmsi, report, now_us)
        if kind not in POSITION_TYPES:
            return False
        vessel = _vessel(mmsi, report, now_us)
        if vessel is None:
            self._drops["ais_incomplete"] += 1
            return False
        if vessel.sog_mps > MAX_SPEED_MPS:
            self._drops["ais_too_fast"] += 1
            return False
        self._forget(now_us)
        return self._believe(vessel)

    def _believe(self, vessel: AisVessel) -> bool:
        """Whether it can follow from the report before, or from the newest one that could not."""
        mmsi, before = vessel.mmsi, self._vessels.get(vessel.mmsi)
        if before is not None and not _may_follow(before, vessel):
            doubted = self._doubted.get(mmsi)
            self._doubted[mmsi] = vessel
            if doubted is None or not _may_follow(doubted, vessel):
                self._drops["ais_jumped"] += 1
                return False
        self._doubted.pop(mmsi, None)
        self._vessels[mmsi] = vessel
        return True

    def _take_size(self, mmsi: int, report: Any, now_us: int) -> None:
        if len(self._sizes) >= MAX_SIZES and mmsi not in self._sizes:
            self._sizes.pop(min(self._sizes, key=lambda each: self._sizes[each].told_us))
        self._sizes[mmsi] = Size(
            float(report.to_bow), float(report.to_stern), float(report.to_port), float(report.to_starboard), now_us
        )

    def _with_size(self, vessel: AisVessel) -> AisVessel:
        size = self._sizes.get(vessel.mmsi)
        if size is None:
            return vessel
        return msgspec.structs.replace(
            vessel,
            to_bow_m=size.to_bow_m,
            to_stern_m=size.to_stern_m,
            to_port_m=size.to_port_m,
            to_starboard_m=size.to_starboard_m,
        )

    def _forget(self, now_us: int) -> None:
        for known in (self._vessels, self._doubted):
            for mmsi in [mmsi for mmsi, each in known.items() if _is_over(each.fixed_us, MEMORY_S, now_us)]:
                del known[mmsi]
        for mmsi in [mmsi for mmsi, each in self._sizes.items() if _is_over(each.told_us, SIZE_MEMORY_S, now_us)]:
            del self._sizes[mmsi]


def _is_over(told_us: int, memory_s: float, now_us: int) -> bool:
    return (now_us - told_us) * 1e-6 > memory_s


def _vessel(mmsi: int, report: Any, now_us: int) -> AisVessel | None:
    """The vessel of a position report; None where it has no position, speed or course, or none that can be."""
    latitude_deg, longitude_deg = float(report.lat), float(report.lon)
    knots, course_deg = float(report.speed), float(report.course)
    has_speed = 0.0 <= knots < NO_SPEED_KNOTS
    if not has_speed or abs(latitude_deg) > 90.0 or abs(longitude_deg) > 180.0:
        return None
    if not 0.0 <= course_deg < NO_COURSE_DEG:
        if knots > 0.0:
            return None
        course_deg = 0.0
    return AisVessel(
        mmsi=mmsi,
        fixed_us=now_us,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        sog_mps=knots * MPS_PER_KNOT,
        cog_rad=course_rad(course_deg),
    )


def _may_follow(before: AisVessel, vessel: AisVessel) -> bool:
    """Whether a vessel as fast as any can have come from there to here in the time between."""
    east_m, north_m = enu_from_geodetic(
        vessel.latitude_deg, vessel.longitude_deg, before.latitude_deg, before.longitude_deg
    )
    span_s = max((vessel.fixed_us - before.fixed_us) * 1e-6, 0.0)
    return math.hypot(east_m, north_m) <= JUMP_M + max(before.sog_mps, vessel.sog_mps) * span_s
