"""What the boat's own turning does to a picture: where a box goes, and what size it has as an angle. Pure.

Identity and apparent motion alone use it: what a box weighs in a corridor never depends on it (checklist I20).
Body is x forward, y left, z up; positive pitch lowers the bow, positive roll lowers starboard.
"""

import math
from typing import NamedTuple

import msgspec

from paani.config import Config
from paani.geometry import clip
from paani.messages import BoxXyxy, Evidence, Odometry, RotationUse, TimeBase

Vector = tuple[float, float, float]
WIDEST_DEG = 170.0  # beyond it a flat picture is no pinhole's
MIN_FORWARD = 0.05  # of a unit ray: what lies further aside is out of every picture
MIN_SIDE = 1e-6
ATTITUDES_KEPT = 16  # 1.6 s of steps at 10 Hz: longer than a picture is under way


class Lens(msgspec.Struct, frozen=True):
    """A pinhole: focal lengths in picture widths and heights, and how far it looks down."""

    focal_x: float
    focal_y: float
    down_rad: float


class Attitude(msgspec.Struct, frozen=True):
    """How the boat lay at one instant. Only attitudes of one `epoch` compare."""

    at_us: int
    epoch: int
    yaw_rad: float
    yaw_rate_radps: float
    roll_rad: float
    pitch_rad: float


class View(NamedTuple):
    """How one picture was taken, as far as known. `attitude` is known only where `lens` is."""

    use: RotationUse
    lens: Lens | None = None
    attitude: Attitude | None = None


def lens_of(evidence: Evidence, config: Config) -> Lens | None:
    """The camera's lens; None where its field of view is not known. Pixels are taken for square.

    The simulator's camera is the eye; any other is what `camera.hfov_deg` says, a recording included.
    """
    if config.camera.source == "sim" and evidence.time_base is TimeBase.CAPTURE:
        hfov_deg, down_deg = config.eye.hfov_deg, config.eye.pitch_down_deg
    else:
        hfov_deg, down_deg = config.camera.hfov_deg, config.camera.pitch_down_deg
    if not 0.0 < hfov_deg <= WIDEST_DEG or evidence.width_px < 1 or evidence.height_px < 1:
        return None
    focal_x = 0.5 / math.tan(0.5 * math.radians(hfov_deg))
    return Lens(focal_x, focal_x * evidence.width_px / evidence.height_px, math.radians(down_deg))


def heard(attitudes: tuple[Attitude, ...], odometry: Odometry | None) -> tuple[Attitude, ...]:
    """The attitudes, oldest first, with that of new, healthy odometry; another epoch begins again."""
    if odometry is None or not odometry.healthy:
        return attitudes
    numbers = (odometry.yaw_rad, odometry.yaw_rate_radps, odometry.roll_rad, odometry.pitch_rad)
    if not all(map(math.isfinite, numbers)):
        return attitudes
    new = Attitude(odometry.source_us, odometry.epoch, *numbers)
    if attitudes and attitudes[-1].epoch == new.epoch:
        if new.at_us <= attitudes[-1].at_us:
            return attitudes
        return (*attitudes, new)[-ATTITUDES_KEPT:]
    return (new,)


def attitude_at(attitudes: tuple[Attitude, ...], at_us: int, max_gap_s: float) -> Attitude | None:
    """The attitude heard nearest to `at_us`, its yaw carried there at its rate; None if none is within `max_gap_s`."""
    if not attitudes:
        return None
    nearest = min(attitudes, key=lambda a: abs(a.at_us - at_us))
    ahead_s = (at_us - nearest.at_us) * 1e-6
    if abs(ahead_s) > max_gap_s:
        return None
    return msgspec.structs.replace(nearest, at_us=at_us, yaw_rad=nearest.yaw_rad + nearest.yaw_rate_radps * ahead_s)


def view_of(attitudes: tuple[Attitude, ...], evidence: Evidence, config: Config) -> View:
    """Lens and attitude of a picture, as far as they are known and wanted."""
    motion = config.advisor.motion
    if not motion.compensate_rotation:
        return View(RotationUse.OFF)
    lens = lens_of(evidence, config)
    if lens is None:
        return View(RotationUse.UNKNOWN_LENS)
    if evidence.time_base is not TimeBase.CAPTURE:
        return View(RotationUse.RECORDING, lens)
    attitude = attitude_at(attitudes, evidence.source_us, motion.max_odometry_gap_s)
    return View(RotationUse.NO_ODOMETRY if attitude is None else RotationUse.KNOWN, lens, attitude)


def turned(box: BoxXyxy, before: Attitude | None, view: View) -> BoxXyxy | None:
    """Where the boat's rotation since `before` took a box, cut to the picture; None where it left it.

    The box as it is where the rotation is not known.
    """
    lens, now = view.lens, view.attitude
    if before is None or now is None or lens is None or before.epoch != now.epoch:
        return box
    yaw_rad = before.yaw_rad - now.yaw_rad
    corners = [(box[0], box[1]), (box[2], box[1]), (box[0], box[3]), (box[2], box[3])]
    places = []
    for x, y in corners:
        level = _levelled(_ray(x, y, lens), before)
        place = _seen(_tilted(_yawed(level, yaw_rad), now), lens)
        if place is None:
            return None
        places.append(place)
    xs, ys = [place[0] for place in places], [place[1] for place in places]
    x1, x2 = clip(min(xs), 0.0, 1.0), clip(max(xs), 0.0, 1.0)
    y1, y2 = clip(min(ys), 0.0, 1.0), clip(max(ys), 0.0, 1.0)
    if x2 - x1 < MIN_SIDE or y2 - y1 < MIN_SIDE:
        return None
    return (x1, y1, x2, y2)


def log_size(box: BoxXyxy, lens: Lens | None) -> float:
    """y = log sqrt(area) (I1); with a lens, of bearing times elevation [rad^2], which turning does not change."""
    if lens is None:
        return 0.5 * math.log((box[2] - box[0]) * (box[3] - box[1]))
    x, y = 0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])
    left, right = (_ray(at, y, lens) for at in (box[0], box[2]))
    high, low = (_ray(x, at, lens) for at in (box[1], box[3]))
    wide_rad = math.atan2(left[1], left[0]) - math.atan2(right[1], right[0])
    tall_rad = math.atan2(high[2], math.hypot(*high[:2])) - math.atan2(low[2], math.hypot(*low[:2]))
    return 0.5 * math.log(max(wide_rad, MIN_SIDE) * max(tall_rad, MIN_SIDE))


def _ray(x: float, y: float, lens: Lens) -> Vector:
    """Direction of a normalised picture point in the body; its length does not matter."""
    up, cos, sin = (0.5 - y) / lens.focal_y, math.cos(lens.down_rad), math.sin(lens.down_rad)
    return (cos + sin * up, (0.5 - x) / lens.focal_x, cos * up - sin)


def _seen(body: Vector, lens: Lens) -> tuple[float, float] | None:
    """Inverse of `_ray`; None for what is not ahead of the camera."""
    cos, sin = math.cos(lens.down_rad), math.sin(lens.down_rad)
    forward, up = cos * body[0] - sin * body[2], sin * body[0] + cos * body[2]
    if forward < MIN_FORWARD * math.hypot(*body):
        return None
    return (0.5 - lens.focal_x * body[1] / forward, 0.5 - lens.focal_y * up / forward)


def _levelled(body: Vector, attitude: Attitude) -> Vector:
    """From the body to level axes of the same heading: roll, then pitch undone."""
    cos, sin = math.cos(attitude.roll_rad), math.sin(attitude.roll_rad)
    x, y, z = body[0], cos * body[1] - sin * body[2], sin * body[1] + cos * body[2]
    cos, sin = math.cos(attitude.pitch_rad), math.sin(attitude.pitch_rad)
    return (cos * x + sin * z, y, cos * z - sin * x)


def _tilted(level: Vector, attitude: Attitude) -> Vector:
    """Inverse of `_levelled`."""
    cos, sin = math.cos(attitude.pitch_rad), math.sin(attitude.pitch_rad)
    x, y, z = cos * level[0] - sin * level[2], level[1], sin * level[0] + cos * level[2]
    cos, sin = math.cos(attitude.roll_rad), math.sin(attitude.roll_rad)
    return (x, cos * y + sin * z, cos * z - sin * y)


def _yawed(level: Vector, yaw_rad: float) -> Vector:
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return (cos * level[0] - sin * level[1], sin * level[0] + cos * level[1], level[2])
