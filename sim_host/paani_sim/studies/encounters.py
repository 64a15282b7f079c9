"""Encounters whose truth is known: what a camera on a boat reports of one thing, as boxes. Pure kinematics.

A pinhole sees an upright thing from a moving, turning boat; a detector's jitter, misses and mistaken reflections are
laid over its box. `python -m tests.bench.box_jitter` measures them on rendered pictures; the constants are from there.
"""

import math
from collections.abc import Iterator
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani.messages import BoxXyxy, Label
from paani_sim.eye.camera import BoatPose, Camera, project

EDGE_JITTER_PX = 0.6  # of one box edge, standard deviation; the larger the box
EDGE_JITTER_FRAC = 0.004  # of the box's size, added
JITTER_TIME_S = 0.12  # after which it is another
SMALL_PX, MIDDLE_PX, LARGE_PX = 12.0, 40.0, 60.0  # size: root of width times height
MISS_FRAC = (0.30, 0.06, 0.015, 0.003)  # of frames: below small, middle and large size, and above
REFLECTION_FRAC = 0.01  # of frames: the box takes in the mirror image below
REFLECTING_FRAC, REFLECTING_TARGETS = 0.20, 0.15  # and of some things' frames
MIN_SIZE_PX = 6.0
SPARE_FRAC = 0.02  # between the edges of picture and thing: no jitter makes it look cut
DROPPED_FRAC = 0.02  # of frames that never come
PERIOD_JITTER_FRAC = 0.05


class EncounterFamily(StrEnum):
    """Kind of encounter. In all but the first three the range stays or the target cannot be measured."""

    APPROACH = "approach"
    APPROACH_TURNING = "approach_turning"
    RECEDE = "recede"
    PASS = "pass"
    STATIONARY = "stationary"
    TURN = "turn"
    CLIPPED = "clipped"
    GAPS = "gaps"


class Target(NamedTuple):
    """An upright block on the water. `reflecting`: the share of frames in which its mirror image counts as part."""

    label: Label
    length_m: float
    width_m: float
    height_m: float
    yaw_rad: float
    reflecting: float


class EncounterCourse(NamedTuple):
    """Boat and thing over time: the boat goes along x from the origin while its heading swings; gaps hide the thing."""

    target: Target
    boat_mps: float
    turn_radps: float
    swing_rad: float
    swing_radps: float
    phase_rad: float
    target_m: tuple[float, float]
    target_mps: tuple[float, float]
    duration_s: float
    gaps_s: tuple[tuple[float, float], ...] = ()


class FrameObservation(NamedTuple):
    """One frame: when, how the boat lay, the true range and size, and what the detector says (None: nothing).

    `whole`: all of the thing is to be seen.
    """

    at_s: float
    pose: BoatPose
    yaw_rate_radps: float
    range_m: float
    size_px: float
    whole: bool
    truth: BoxXyxy | None
    box: BoxXyxy | None
    confidence: float


def draw_course(family: EncounterFamily, rng: np.random.Generator) -> EncounterCourse:
    """A random course of the family, 8 to 40 s long."""
    target = _draw_target(rng)
    swing, swing_rate, phase = rng.uniform(0.0, 0.04), rng.uniform(0.3, 0.8), rng.uniform(0.0, 6.0)
    speed, side, turn = rng.uniform(0.3, 0.9), rng.uniform(-1.2, 1.2), 0.0
    away = 0.5 * math.hypot(target.length_m, target.width_m)
    start, drift = (speed * 16.0 + away + 1.5, side), (0.0, 0.0)
    duration, gaps = 16.0, list[tuple[float, float]]()
    match family:
        case EncounterFamily.APPROACH_TURNING:
            swing, swing_rate = rng.uniform(0.15, 0.35), rng.uniform(0.4, 0.9)
        case EncounterFamily.RECEDE:
            start, drift = (away + rng.uniform(2.0, 4.0), side), (speed + rng.uniform(0.3, 1.2), 0.0)
        case EncounterFamily.PASS:
            across = rng.uniform(0.4, 1.2) * rng.choice([-1.0, 1.0])
            start, drift, speed = (rng.uniform(7.0, 14.0) + away, -8.0 * across), (0.0, across), 0.0
        case EncounterFamily.STATIONARY:
            start, speed = (rng.uniform(3.0, 14.0) + away, side), 0.0
        case EncounterFamily.TURN:
            turn, speed, swing = rng.uniform(0.1, 0.5) * rng.choice([-1.0, 1.0]), 0.0, 0.0
            duration = 1.6 / abs(turn)
            bearing, range_m = 0.5 * turn * duration, rng.uniform(3.0, 14.0) + away
            start = (range_m * math.cos(bearing), range_m * math.sin(bearing))
        case EncounterFamily.CLIPPED:
            start = (start[0], math.copysign(0.55 * start[0] + away, side))
        case EncounterFamily.GAPS:
            gaps = [(at, at + rng.uniform(0.5, 4.0)) for at in np.arange(rng.uniform(2.0, 5.0), duration, 6.0)]
        case _:
            pass
    return EncounterCourse(target, speed, turn, swing, swing_rate, phase, start, drift, duration, tuple(gaps))


def simulate_frames(
    course: EncounterCourse, rate_hz: float, camera: Camera, rng: np.random.Generator
) -> Iterator[FrameObservation]:
    """The frames of a camera that takes about `rate_hz` pictures a second."""
    at_s, before_s = 0.0, -math.inf
    jitter = rng.normal(size=4)
    while at_s < course.duration_s:
        keep = math.exp(-(at_s - before_s) / JITTER_TIME_S)
        jitter = keep * jitter + math.sqrt(1.0 - keep * keep) * rng.normal(size=4)
        before_s = at_s
        if rng.random() >= DROPPED_FRAC:
            yield _observe_frame(course, at_s, camera, jitter, rng)
        at_s += (1.0 + PERIOD_JITTER_FRAC * rng.uniform(-1.0, 1.0)) / rate_hz


def boat_pose_at(course: EncounterCourse, at_s: float) -> tuple[BoatPose, float]:
    """Where the boat is and how fast its heading changes [rad/s]."""
    angle = course.swing_radps * at_s + course.phase_rad
    yaw = course.turn_radps * at_s + course.swing_rad * math.sin(angle)
    rate = course.turn_radps + course.swing_rad * course.swing_radps * math.cos(angle)
    return BoatPose(course.boat_mps * at_s, 0.0, yaw), rate


def range_at_m(course: EncounterCourse, at_s: float) -> float:
    """Distance [m] from the boat to the middle of the thing."""
    x_m, y_m = _target_position(course, at_s)
    return math.hypot(x_m - course.boat_mps * at_s, y_m)


def _target_position(course: EncounterCourse, at_s: float) -> tuple[float, float]:
    return course.target_m[0] + course.target_mps[0] * at_s, course.target_m[1] + course.target_mps[1] * at_s


def _draw_target(rng: np.random.Generator) -> Target:
    label = Label(rng.choice([Label.BUOY, Label.VESSEL, Label.PERSON], p=[0.45, 0.4, 0.15]))
    reflecting = REFLECTING_FRAC if rng.random() < REFLECTING_TARGETS else REFLECTION_FRAC
    yaw = rng.uniform(-math.pi, math.pi)
    match label:
        case Label.BUOY:
            wide = rng.uniform(0.4, 1.1)
            return Target(label, wide, wide, wide * rng.uniform(0.9, 2.7), yaw, reflecting)
        case Label.VESSEL:
            long = rng.uniform(2.8, 6.0)
            return Target(label, long, long * rng.uniform(0.3, 0.45), rng.uniform(0.6, 2.4), yaw, reflecting)
        case _:
            return Target(label, 0.7, 0.5, 0.4, yaw, reflecting)


def _observe_frame(
    course: EncounterCourse, at_s: float, camera: Camera, jitter: F64, rng: np.random.Generator
) -> FrameObservation:
    pose, yaw_rate = boat_pose_at(course, at_s)
    truth, whole = _true_box(course, at_s, pose, camera)
    size_px = 0.0
    if truth is not None:
        size_px = math.sqrt((truth[2] - truth[0]) * camera.width_px * (truth[3] - truth[1]) * camera.height_px)
    hidden = any(start <= at_s < end for start, end in course.gaps_s)
    chance = MISS_FRAC[sum(size_px >= limit for limit in (SMALL_PX, MIDDLE_PX, LARGE_PX))]
    missed = rng.random() < chance
    box, confidence = None, float(np.clip(0.62 + 0.008 * size_px, 0.6, 0.95) + rng.normal(0.0, 0.08))
    if truth is not None and size_px >= MIN_SIZE_PX and not (hidden or missed) and confidence > 0.4:
        box = _jitter_box(truth, size_px, course.target, camera, jitter, rng)
    range_m = range_at_m(course, at_s)
    return FrameObservation(
        at_s, pose, yaw_rate, range_m, size_px, whole and not hidden, truth, box, min(confidence, 0.99)
    )


def _true_box(course: EncounterCourse, at_s: float, pose: BoatPose, camera: Camera) -> tuple[BoxXyxy | None, bool]:
    """The thing's box cut to the picture, None where it is not in it; and whether nothing was cut."""
    target, (x_m, y_m) = course.target, _target_position(course, at_s)
    cos, sin = math.cos(target.yaw_rad), math.sin(target.yaw_rad)
    corners = np.array(
        [
            (x_m + cos * along - sin * across, y_m + sin * along + cos * across, up)
            for along in (-0.5 * target.length_m, 0.5 * target.length_m)
            for across in (-0.5 * target.width_m, 0.5 * target.width_m)
            for up in (0.0, target.height_m)
        ]
    )
    pixels = project(corners, pose, camera)
    if not np.isfinite(pixels).all():
        return None, False
    x1, y1 = pixels.min(axis=0) / (camera.width_px, camera.height_px)
    x2, y2 = pixels.max(axis=0) / (camera.width_px, camera.height_px)
    whole = bool(min(x1, y1) > SPARE_FRAC and max(x2, y2) < 1.0 - SPARE_FRAC)
    cut = (max(x1, 0.0), max(y1, 0.0), min(x2, 1.0), min(y2, 1.0))
    if cut[2] - cut[0] < 1e-3 or cut[3] - cut[1] < 1e-3:
        return None, False
    return (float(cut[0]), float(cut[1]), float(cut[2]), float(cut[3])), whole


def _jitter_box(
    truth: BoxXyxy, size_px: float, target: Target, camera: Camera, jitter: F64, rng: np.random.Generator
) -> BoxXyxy:
    mirrored = (truth[3] - truth[1]) * rng.uniform(0.3, 1.0) if rng.random() < target.reflecting else 0.0
    scale = EDGE_JITTER_PX + EDGE_JITTER_FRAC * size_px
    off_x, off_y = scale / camera.width_px, scale / camera.height_px
    x1, x2 = sorted(float(np.clip(truth[i] + off_x * jitter[i], 0.0, 1.0)) for i in (0, 2))
    y1, y2 = sorted(float(np.clip(truth[i] + off_y * jitter[i], 0.0, 1.0)) for i in (1, 3))
    return (x1, y1, max(x2, x1 + 1e-3), min(max(y2, y1 + 1e-3) + float(mirrored), 1.0))
