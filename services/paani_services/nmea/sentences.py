"""Position, heading and moving targets as NMEA 0183 (IEC 61162-1) sentences. Pure.

A field that is not known is empty, as the standard has it; nothing is said of what is not fresh or not healthy.
"""

from __future__ import annotations

import functools
import itertools
import math
import operator
from datetime import UTC, datetime

from paani import messages as m
from paani.geometry import heading_true_deg

TALKER = "II"  # integrated instrumentation
KNOTS_PER_MPS = 3600.0 / 1852.0
METRES_PER_NAUTICAL_MILE = 1852.0
ESTIMATED_FIX = 6  # GGA's quality of a position that is more than a receiver's: dead reckoning between fixes
MAX_TARGETS = 99  # of TTM, whose target number has two digits


def position_sentences(odometry: m.Odometry | None) -> list[str]:
    """RMC, GGA and HDT of a healthy estimate; without one, RMC and GGA that say there is no position."""
    if odometry is None or not odometry.healthy:
        return [sentence("RMC", "", "V", *[""] * 9, "N"), sentence("GGA", *[""] * 5, "0", *[""] * 8)]
    utc = datetime.fromtimestamp(odometry.source_us * 1e-6, UTC)
    time = f"{utc:%H%M%S}.{utc.microsecond // 10_000:02d}"
    place = [
        *degrees_text(odometry.latitude_deg, "NS", 2),
        *degrees_text(math.remainder(odometry.longitude_deg, 360.0), "EW", 3),
    ]
    speed_mps = math.hypot(odometry.surge_mps, odometry.sway_mps)
    course_rad = odometry.yaw_rad + math.atan2(odometry.sway_mps, odometry.surge_mps)
    course = "" if odometry.stopped else _bearing_text(course_rad)
    moving = [f"{speed_mps * KNOTS_PER_MPS:.2f}", course, f"{utc:%d%m%y}", "", "", "E"]
    return [
        sentence("RMC", time, "A", *place, *moving),
        sentence("GGA", time, *place, str(ESTIMATED_FIX), *[""] * 8),
        sentence("HDT", _bearing_text(odometry.yaw_rad), "T"),
    ]


def target_sentences(odometry: m.Odometry | None, prediction: m.Prediction | None) -> list[str]:
    """A TTM for each moving obstacle: true bearing, distance [nautical miles], course and speed [knots] over ground.

    Its number has the last two digits of its track, or the next that no other of them has.
    """
    if odometry is None or not odometry.healthy or prediction is None:
        return []
    lines, numbers = [], set[int]()
    for obstacle in prediction.obstacles[:MAX_TARGETS]:
        number = next(each % 100 for each in itertools.count(obstacle.track_id) if each % 100 not in numbers)
        numbers.add(number)
        east_m, north_m = obstacle.x_m - odometry.x_m, obstacle.y_m - odometry.y_m
        distance = f"{math.hypot(east_m, north_m) / METRES_PER_NAUTICAL_MILE:.4f}"
        bearing = _bearing_text(math.atan2(north_m, east_m))
        speed = f"{math.hypot(obstacle.east_mps, obstacle.north_mps) * KNOTS_PER_MPS:.2f}"
        course = _bearing_text(math.atan2(obstacle.north_mps, obstacle.east_mps))
        status = "T" if obstacle.age_s < 1.0 else "Q"  # tracked, or doubtful
        motion = (speed, course, "T", "", "", "N", "", status, "", "", "A")
        lines.append(sentence("TTM", f"{number:02d}", distance, bearing, "T", *motion))
    return lines


def sentence(kind: str, *fields: str) -> str:
    """A sentence with its checksum and line end."""
    body = ",".join((f"{TALKER}{kind}", *fields))
    return f"${body}*{functools.reduce(operator.xor, body.encode('ascii')):02X}\r\n"


def _bearing_text(yaw_rad: float) -> str:
    """Degrees true of an ENU yaw, with one decimal: what rounds to 360.0 is 0.0."""
    return f"{round(heading_true_deg(yaw_rad), 1) % 360.0:.1f}"


def degrees_text(angle_deg: float, sides: str, digits: int) -> tuple[str, str]:
    """Degrees and minutes with five decimals, and the side: `5206.44120`, `N`. digits: of the degrees."""
    hundred_thousandths = round(abs(angle_deg) * 60.0 * 1e5)  # rounded as a whole, so that no minute is written as 60
    degrees, rest = divmod(hundred_thousandths, 60 * 100_000)
    return f"{degrees:0{digits}d}{rest // 100_000:02d}.{rest % 100_000:05d}", sides[0] if angle_deg >= 0.0 else sides[1]
