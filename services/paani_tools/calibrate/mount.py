"""Pitch and roll of the camera's mount from waterlines and the boat's attitude, by least squares. Pure."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paani.arrays import F64
from paani.config import CalibrationConfig
from paani.errors import UserError
from paani_tools.calibrate.horizon import Waterline

MIN_PICTURES = 20
MAX_SPREAD_DEG = 1.0  # standard deviation between pictures
MAX_TILT_DEG = 45.0
STEP_RAD = 1e-5
ROUNDS = 12
MIN_MOTION_ROWS = 0.3  # standard deviation of where the line lies in the rows of the mask: less, and a row is the limit
MIN_SHORE_HEIGHTS = 40.0  # a shore nearer than this many camera heights lies 1.4 degrees below the horizon, or more


class WaterlineObservation(NamedTuple):
    """One waterline, and the boat's roll and pitch when it was seen [rad]."""

    line: Waterline
    roll_rad: float
    pitch_rad: float


class Mount(NamedTuple):
    """What was found. spread_deg: standard deviation between pictures; residual_deg: of the columns."""

    pitch_down_deg: float
    roll_deg: float
    spread_deg: float
    residual_deg: float
    pictures: int


def estimate_mount(
    observations: Sequence[WaterlineObservation], calibration: CalibrationConfig, shore_m: float
) -> Mount:
    """The mount that puts every waterline where a shore `shore_m` away lies, `atan(height / shore)` below the horizon.

    calibration: field of view, centre, height and yaw of the mount; its pitch and roll are where the search begins.
    Raises UserError when the pictures are too few or do not agree.
    """
    if len(observations) < MIN_PICTURES:
        raise UserError(
            f"{len(observations)} pictures show a straight far waterline; at least {MIN_PICTURES} are needed"
        )
    if shore_m < MIN_SHORE_HEIGHTS * calibration.height_m:
        raise UserError(
            f"--shore-m {shore_m:g}: too near for a camera at {calibration.height_m:g} m"
            f" (at least {MIN_SHORE_HEIGHTS * calibration.height_m:g} m)"
        )
    dip_rad = math.atan(calibration.height_m / shore_m)
    found = np.radians([calibration.pitch_down_deg, calibration.roll_deg])
    for _ in range(ROUNDS):
        off, slopes = _with_slopes(observations, calibration, found, dip_rad)
        weights = 1.0 / np.maximum(np.abs(off), np.radians(0.5))  # a far-off column counts less
        found = found - np.linalg.lstsq(slopes * weights[:, None], off * weights, rcond=None)[0]
        if np.abs(found).max() > math.radians(MAX_TILT_DEG):
            raise UserError("the waterlines and the IMU do not agree on any mount")
    off = _off(observations, calibration, found, dip_rad)
    ends = np.cumsum([look.line.u.size for look in observations])[:-1]
    between = np.degrees([part.mean() for part in np.split(off, ends)])
    mount = Mount(
        pitch_down_deg=math.degrees(found[0]),
        roll_deg=math.degrees(found[1]),
        spread_deg=float(between.std()),
        residual_deg=float(np.degrees(off.std())),
        pictures=len(observations),
    )
    if mount.spread_deg > MAX_SPREAD_DEG:
        raise UserError(
            f"the pictures do not agree: {mount.spread_deg:.2f} degrees between them, {MAX_SPREAD_DEG:g} are allowed"
        )
    moved = np.concatenate([look.line.v * look.line.rows for look in observations]).std()
    if moved < MIN_MOTION_ROWS:
        raise UserError("the boat lay too still to tell more than a row of the mask: let it rock, or turn it")
    return mount


def _with_slopes(
    observations: Sequence[WaterlineObservation], calibration: CalibrationConfig, tilt: F64, dip_rad: float
) -> tuple[F64, F64]:
    """Residuals [n] and their slopes over pitch and roll [n, 2]."""
    off = _off(observations, calibration, tilt, dip_rad)
    steps = np.eye(2) * STEP_RAD
    return off, np.column_stack(
        [(_off(observations, calibration, tilt + step, dip_rad) - off) / STEP_RAD for step in steps]
    )


def _off(
    observations: Sequence[WaterlineObservation], calibration: CalibrationConfig, tilt: F64, dip_rad: float
) -> F64:
    """How far each end of the water lies above where the shore should, as an angle [rad]."""
    focal = 0.5 / math.tan(0.5 * math.radians(calibration.hfov_deg))
    mount = _rotation(tilt[1], tilt[0], math.radians(calibration.yaw_deg))
    found = []
    for look in observations:
        right = (look.line.u - calibration.centre_frac[0]) / focal
        down = (look.line.v - calibration.centre_frac[1]) / (focal * look.line.aspect)
        ray = np.stack([np.ones_like(right), -right, -down])
        up = (_rotation(look.roll_rad, look.pitch_rad, 0.0) @ mount)[2] @ ray
        found.append(np.arcsin(up / np.sqrt((ray * ray).sum(axis=0))) + dip_rad)
    return np.concatenate(found)


def _rotation(roll_rad: float, pitch_rad: float, yaw_rad: float) -> F64:
    """Yaw about z, then pitch about y (bow down positive), then roll about x (starboard down positive)."""
    cr, sr, cp, sp = math.cos(roll_rad), math.sin(roll_rad), math.cos(pitch_rad), math.sin(pitch_rad)
    cy, sy = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
