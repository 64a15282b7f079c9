"""Scores for the collision regulations' rules 8 and 13 to 17, by the class of the encounter. Pure.

After Hagen, Vassbotn, Skogvold, Johansen, Brekke: "Safety and COLREG evaluation for marine collision avoidance
algorithms", Ocean Engineering 288 (2023), doi 10.1016/j.oceaneng.2023.115991, with ranges from hull to hull and without
the term that judges aspect as safety.

Angles are in degrees, clockwise, (-180, 180]: `bearing` of the target from our bow, `aspect` is our bearing from the
target's bow. A score is in [0, 1]. They measure courtesy: a boat with one camera does not keep the lookout that the
rules ask for.
"""

from __future__ import annotations

import math

import msgspec

from paani.messages import EncounterClass

CLEAR_M, NEAR_MISS_M = 1.5, 0.5  # hull to hull: twice the hull's width, and `NEAR_MISS_CLEARANCE_M`; contact is 0
APPARENT_TURN_DEG = 30.0  # a turn that a camera or an eye notices at once
TOO_LITTLE = 0.3  # of `course_unchanged` or `speed_unchanged`: an action is apparent with either below it
CROSSED_AHEAD_DEG = (-25.0, 165.0)  # aspect at the closest point


class Manoeuvre(msgspec.Struct, frozen=True, kw_only=True):
    """What the boat did about one target until their closest point of approach.

    detected_m, acted_m, closest_m: between the middles, when the target came into view (None: never), when the boat
    first acted (None: never), and at the closest point. clearance_m: least, between hulls.
    bearing_deg, aspect_deg: at the closest point. turn_deg, starboard_turn_deg: largest change of heading to either
    side, and to starboard. start_mps, least_mps, most_mps: speed at the beginning, and its extremes.
    """

    clearance_m: float
    detected_m: float | None
    acted_m: float | None
    closest_m: float
    bearing_deg: float
    aspect_deg: float
    turn_deg: float
    starboard_turn_deg: float
    start_mps: float
    least_mps: float
    most_mps: float


def safety(clearance_m: float, clear_m: float = CLEAR_M) -> float:
    """1 from `clear_m` on, 0.6 at a near miss, 0 at contact, linear between."""
    if clearance_m >= clear_m:
        return 1.0
    if clearance_m >= NEAR_MISS_M:
        return 1.0 - 0.4 * (clear_m - clearance_m) / (clear_m - NEAR_MISS_M)
    return max(0.0, 0.6 * clearance_m / NEAR_MISS_M)


def delay(each: Manoeuvre) -> float:
    """How much of the approach passed before the boat acted: 0 at first sight, 1 at the closest point or never."""
    if each.detected_m is None or each.acted_m is None:
        return 1.0
    approach_m = each.detected_m - each.closest_m
    return 0.0 if approach_m <= 0.0 else min(1.0, max(0.0, (each.detected_m - each.acted_m) / approach_m))


def course_unchanged(turn_deg: float) -> float:
    """0.5 without a turn, 0 from `APPARENT_TURN_DEG` on."""
    return 0.5 * max(0.0, 1.0 - (turn_deg / APPARENT_TURN_DEG) ** 2)


def speed_unchanged(each: Manoeuvre) -> float:
    """0.5 without slowing down, 0 from half the speed on."""
    return max(0.0, each.least_mps / each.start_mps - 0.5)


def not_apparent(each: Manoeuvre) -> float:
    """0 for an action that is apparent by course or by speed, up to 0.25."""
    course, speed = course_unchanged(each.turn_deg), speed_unchanged(each)
    return 0.0 if min(course, speed) < TOO_LITTLE else course * speed


def rule_8(each: Manoeuvre) -> float:
    """Action in ample time, and large enough to be apparent."""
    return (1.0 - delay(each)) * (1.0 - not_apparent(each))


def rule_16(each: Manoeuvre, clear_m: float = CLEAR_M) -> float:
    """Early and substantial action to keep well clear."""
    return safety(each.clearance_m, clear_m) * rule_8(each)


def rule_15(each: Manoeuvre, clear_m: float = CLEAR_M) -> float:
    """Crossing: as rule 16, and not ahead of a target from starboard."""
    is_ahead = CROSSED_AHEAD_DEG[0] <= each.aspect_deg <= CROSSED_AHEAD_DEG[1]
    return _bounded(rule_16(each, clear_m) - (0.5 if is_ahead else 0.0))


def rule_13(each: Manoeuvre, clear_m: float = CLEAR_M) -> float:
    """Overtaking: as rule 16, and not close ahead of the overtaken."""
    return _bounded(rule_16(each, clear_m) - (0.3 if abs(each.aspect_deg) < 45.0 else 0.0))


def rule_14(each: Manoeuvre) -> float:
    """Head on: both to starboard, passing port to port."""
    port_to_port = _portness(each.aspect_deg) ** 2 * _portness(each.bearing_deg) ** 2
    too_little = max(0.0, 1.0 - (max(0.0, each.starboard_turn_deg) / 20.0) ** 4)
    kept = 1.0 - 0.6 * too_little - 0.2 * delay(each) - (1.0 - port_to_port)
    return _bounded(kept * (1.0 - course_unchanged(each.turn_deg)))


def rule_17(each: Manoeuvre, clear_m: float = CLEAR_M) -> float:
    """Standing on: course and speed kept."""
    turned = min(1.0, max(0.0, (abs(each.turn_deg) - 2.0) / 28.0))
    slowed = max(0.0, each.start_mps - each.least_mps) / each.start_mps
    kept = each.start_mps / max(each.most_mps, each.start_mps)
    return _bounded((safety(each.clearance_m, clear_m) - 0.5 * turned) * kept**2 - 0.5 * slowed)


def score_by_rule(kind: EncounterClass, each: Manoeuvre, clear_m: float = CLEAR_M) -> dict[str, float]:
    """The scores of the rules that bind us in an encounter of this class, by rule; the class's own rule comes first."""
    kept, apart = {"17": rule_17(each, clear_m)}, {"16": rule_16(each, clear_m), "8": rule_8(each)}
    return {
        EncounterClass.OVERTAKING: {"13": rule_13(each, clear_m), **apart},
        EncounterClass.HEAD_ON: {"14": rule_14(each), "8": rule_8(each)},
        EncounterClass.CROSSING_STARBOARD: {"15": rule_15(each, clear_m), **apart},
        EncounterClass.CROSSING_PORT: kept,
        EncounterClass.OVERTAKEN: kept,
        EncounterClass.NONE: {},
    }[kind]


def _portness(angle_deg: float) -> float:
    """1 abeam to port, 0 abeam to starboard."""
    return (1.0 - math.sin(math.radians(angle_deg))) / 2.0


def _bounded(score: float) -> float:
    return min(1.0, max(0.0, score))
