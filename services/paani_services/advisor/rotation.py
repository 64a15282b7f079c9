"""Ego-rotation compensation: where the boat's rotation moves a box, and its size as an angle. Pure.

Pinhole model: rays through the corners of a box are rotated by the change of attitude between two pictures. Data
association and apparent motion use it; the risk of a box never depends on it (I20).
Body is x forward, y left, z up; positive pitch lowers the bow, positive roll lowers starboard.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from paani import portable
from paani.config import Config
from paani.geometry import clip
from paani.messages import BoxXyxy, Evidence, Odometry, RotationUse, TimeBase

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]  # by rows
MAX_HFOV_DEG = 170.0  # a wider picture is no pinhole projection
MIN_FORWARD = 0.05  # forward component of a unit ray; a ray with less is outside every picture
MIN_SIDE = 1e-6  # of the picture, or radians; keeps logarithms finite
MAX_ATTITUDES = 16  # 1.6 s of odometry at 10 Hz, longer than a picture takes to be processed


class Lens(msgspec.Struct, frozen=True):
    """Pinhole camera: focal lengths in picture widths and heights, cosine and sine of its pitch downwards."""

    focal_x: float
    focal_y: float
    cos_down: float
    sin_down: float


class Attitude(msgspec.Struct, frozen=True):
    """Attitude of the boat at one instant. Only attitudes of the same odometry `epoch` can be compared."""

    at_us: int
    epoch: int
    yaw_rad: float
    yaw_rate_radps: float
    roll_rad: float
    pitch_rad: float


class CameraView(NamedTuple):
    """Lens and attitude that one picture was taken with, as far as known. `attitude` is known only where `lens` is."""

    use: RotationUse
    lens: Lens | None = None
    attitude: Attitude | None = None


def camera_lens(evidence: Evidence, config: Config) -> Lens | None:
    """The lens of the camera that took the picture; None where its field of view is unknown. Pixels are square.

    A live simulated picture has the lens of `eye`; any other picture, recordings included, that of `calibration`.
    """
    if config.camera.source == "sim" and evidence.time_base is TimeBase.CAPTURE:
        hfov_deg, down_deg = config.eye.hfov_deg, config.eye.pitch_down_deg
    else:
        hfov_deg, down_deg = config.calibration.hfov_deg, config.calibration.pitch_down_deg
    if not 0.0 < hfov_deg <= MAX_HFOV_DEG or evidence.width_px < 1 or evidence.height_px < 1:
        return None
    focal_x = 0.5 / portable.tan(0.5 * math.radians(hfov_deg))
    down_rad = math.radians(down_deg)
    focal_y = focal_x * evidence.width_px / evidence.height_px
    return Lens(focal_x, focal_y, portable.cos(down_rad), portable.sin(down_rad))


def append_attitude(attitudes: tuple[Attitude, ...], odometry: Odometry | None) -> tuple[Attitude, ...]:
    """Append the attitude of new, healthy odometry, oldest first.

    Odometry of another epoch, or from before the newest, replaces all: the clock was set back.
    """
    if odometry is None or not odometry.healthy:
        return attitudes
    numbers = (odometry.yaw_rad, odometry.yaw_rate_radps, odometry.roll_rad, odometry.pitch_rad)
    if not all(map(math.isfinite, numbers)):
        return attitudes
    new = Attitude(odometry.source_us, odometry.epoch, *numbers)
    if attitudes and attitudes[-1].epoch == new.epoch:
        if new.at_us == attitudes[-1].at_us:
            return attitudes
        if new.at_us > attitudes[-1].at_us:
            return (*attitudes, new)[-MAX_ATTITUDES:]
    return (new,)


def attitude_at(attitudes: tuple[Attitude, ...], at_us: int, max_gap_s: float) -> Attitude | None:
    """The attitude nearest to `at_us`, its yaw extrapolated at its rate; None where none is within `max_gap_s`."""
    if not attitudes:
        return None
    nearest = min(attitudes, key=lambda a: abs(a.at_us - at_us))
    ahead_s = (at_us - nearest.at_us) * 1e-6
    if abs(ahead_s) > max_gap_s:
        return None
    return msgspec.structs.replace(nearest, at_us=at_us, yaw_rad=nearest.yaw_rad + nearest.yaw_rate_radps * ahead_s)


def camera_view(attitudes: tuple[Attitude, ...], evidence: Evidence, config: Config) -> CameraView:
    """Lens and attitude of a picture, as far as they are known and compensation is switched on."""
    motion = config.advisor.motion
    if not motion.compensate_rotation:
        return CameraView(RotationUse.OFF)
    lens = camera_lens(evidence, config)
    if lens is None:
        return CameraView(RotationUse.UNKNOWN_LENS)
    if evidence.time_base is not TimeBase.CAPTURE:
        return CameraView(RotationUse.RECORDING, lens)
    attitude = attitude_at(attitudes, evidence.source_us, motion.max_odometry_gap_s)
    return CameraView(RotationUse.NO_ODOMETRY if attitude is None else RotationUse.KNOWN, lens, attitude)


def predict_boxes(seen: Sequence[tuple[BoxXyxy, Attitude | None]], view: CameraView) -> list[BoxXyxy | None]:
    """Predict where boxes seen from these attitudes are now, clipped to the picture; None for a box that left it.

    A box stays where it was where the rotation since then is not known.
    """
    lens, now = view.lens, view.attitude
    if lens is None or now is None:
        return [box for box, _ in seen]
    turns: dict[Attitude, Matrix] = {}
    map_from_camera = _map_from_camera(now, lens)
    places: list[BoxXyxy | None] = []
    for box, before in seen:
        if before is None or before.epoch != now.epoch:
            places.append(box)
            continue
        if before not in turns:
            turns[before] = _relative_rotation(map_from_camera, _map_from_camera(before, lens))
        places.append(_rotate_box(box, turns[before], lens))
    return places


def log_angular_size(box: BoxXyxy, lens: Lens | None) -> float:
    """y = log sqrt(area) (I1); with a lens of bearing times elevation [rad^2], which rotation does not change."""
    if lens is None:
        return 0.5 * portable.log((box[2] - box[0]) * (box[3] - box[1]))
    x, y = 0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])
    left, right, high, low = (_ray(*at, lens) for at in ((box[0], y), (box[2], y), (x, box[1]), (x, box[3])))
    wide_rad = _angle(right[:2], left[:2])
    tall_rad = _angle((math.hypot(*low[:2]), low[2]), (math.hypot(*high[:2]), high[2]))
    return 0.5 * portable.log(max(wide_rad, MIN_SIDE) * max(tall_rad, MIN_SIDE))


def _ray(x: float, y: float, lens: Lens) -> Vector:
    """Direction of a normalised picture point in the level body frame, of any length."""
    up = (0.5 - y) / lens.focal_y
    return (
        lens.cos_down + lens.sin_down * up,
        (0.5 - x) / lens.focal_x,
        lens.cos_down * up - lens.sin_down,
    )


def _angle(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Angle from a to b, counter-clockwise [rad]."""
    return portable.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])


def _map_from_camera(attitude: Attitude, lens: Lens) -> Matrix:
    """Rotation from camera axes (forward, left, up) to map axes: camera pitch, then roll, pitch and yaw of the boat."""
    cy, sy = portable.cos(attitude.yaw_rad), portable.sin(attitude.yaw_rad)
    cp, sp = portable.cos(attitude.pitch_rad), portable.sin(attitude.pitch_rad)
    cr, sr = portable.cos(attitude.roll_rad), portable.sin(attitude.roll_rad)
    body = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    cd, sd = lens.cos_down, lens.sin_down
    east, north, up = ((cd * x - sd * z, y, sd * x + cd * z) for x, y, z in body)
    return (east, north, up)


def _relative_rotation(a: Matrix, b: Matrix) -> Matrix:
    """The product of the transpose of a and b: from the camera axes of b to those of a."""
    first, second, third = (
        (
            a[0][i] * b[0][0] + a[1][i] * b[1][0] + a[2][i] * b[2][0],
            a[0][i] * b[0][1] + a[1][i] * b[1][1] + a[2][i] * b[2][1],
            a[0][i] * b[0][2] + a[1][i] * b[1][2] + a[2][i] * b[2][2],
        )
        for i in range(3)
    )
    return (first, second, third)


def _rotate_box(box: BoxXyxy, turn: Matrix, lens: Lens) -> BoxXyxy | None:
    """The box around the rotated corners, clipped to the picture; None where a corner is no longer ahead."""
    (a, b, c), (d, e, f), (g, h, i) = turn
    xs, ys = [], []
    for x in (box[0], box[2]):
        left = (0.5 - x) / lens.focal_x
        for y in (box[1], box[3]):
            up = (0.5 - y) / lens.focal_y
            forward = a + b * left + c * up
            if forward < MIN_FORWARD * math.sqrt(1.0 + left * left + up * up):
                return None
            xs.append(0.5 - lens.focal_x * (d + e * left + f * up) / forward)
            ys.append(0.5 - lens.focal_y * (g + h * left + i * up) / forward)
    x1, x2 = clip(min(xs), 0.0, 1.0), clip(max(xs), 0.0, 1.0)
    y1, y2 = clip(min(ys), 0.0, 1.0), clip(max(ys), 0.0, 1.0)
    return (x1, y1, x2, y2) if x2 - x1 >= MIN_SIDE and y2 - y1 >= MIN_SIDE else None
