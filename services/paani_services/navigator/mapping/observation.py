"""What the last pictures showed of the water, and where each was taken. Pure; small enough to be state."""

import itertools
import math
from collections.abc import Iterator, Sequence

import msgspec

from paani import portable
from paani.config import PlannerConfig
from paani.geometry import wrap_rad
from paani.messages import Detection, Evidence, Label, Odometry, TimeBase
from paani_services.navigator.mapping.projection import Station

EDGE_STEPS = 128  # of the picture's height: two for each row of the mask
FOOT_STEPS = 512
POSE_SPACING_US = 90_000
POSES_KEPT = 14  # 1.2 s: longer than a picture is under way
SIGHT_SPACING_US = 100_000
OLD_SPACING_US = 800_000  # between those kept for what is out of sight
SIGHTS_KEPT = 224
BOXES_SPACING_US = 190_000  # between those kept for their boxes alone
BOX_COLUMNS = 9
SMALL = frozenset({Label.PERSON, Label.BUOY})
MOVABLE = frozenset({Label.PERSON, Label.BUOY, Label.VESSEL})
CARRIES = frozenset({Label.VESSEL, Label.PIER})
MASK_ROW = 1.0 / 64.0
ASHORE_ROWS = 3.0  # of the mask, between where the water ends and a person's foot beyond it: metres, not a reflection


class Pose(msgspec.Struct, frozen=True):
    """Where the boat was, reckoned, and how it lay."""

    at_us: int
    x_m: float
    y_m: float
    yaw_rad: float
    roll_rad: float
    pitch_rad: float


class Foot(msgspec.Struct, frozen=True, array_like=True):
    """Left, right and lower end of a thing, in 1/512 of the picture, rounded outwards."""

    left: int
    right: int
    low: int
    person: bool = False


class Box(msgspec.Struct, frozen=True, array_like=True):
    """A detection of something that may move: its sides in 1/512 of the picture, rounded outwards.

    ends: where it meets the water, at `BOX_COLUMNS` places from left to right.
    """

    left: int
    top: int
    right: int
    low: int
    label: Label
    ends: tuple[int, ...]

    @property
    def is_small(self) -> bool:
        """Its lower end is its foot."""
        return self.label in SMALL


class Sight(msgspec.Struct, frozen=True):
    """One picture: where it was taken, its width over height, where the water ends, where things stand in it.

    edge: for each column, left to right, in 1/128 of the height from the top, rounded towards the boat.
    feet: where things stand. boxes: what may move. Of older sights the boxes alone are kept.
    """

    at_us: int
    x_m: float
    y_m: float
    yaw_rad: float
    roll_rad: float
    pitch_rad: float
    aspect: float
    edge: bytes
    feet: tuple[Foot, ...] = ()
    boxes: tuple[Box, ...] = ()

    @property
    def station(self) -> Station:
        """Where the boat was, and how it lay."""
        return Station(self.x_m, self.y_m, self.yaw_rad, self.roll_rad, self.pitch_rad)


class Memory(msgspec.Struct, frozen=True):
    """Poses and sights, oldest first; the newest frame heard of (epoch, sequence); the odometry's epoch.

    here: where the boat is by its way over ground since the memory began, in the map's axes. What was seen lies where
    it was seen from there: a position that follows the wandering of GPS would carry it about (REP-105's `odom` frame).
    """

    here: Pose | None = None
    poses: tuple[Pose, ...] = ()
    sights: tuple[Sight, ...] = ()
    frame: tuple[int, int] = (-1, -1)
    epoch: int = -1


def remember(memory: Memory, odometry: Odometry | None, evidence: Evidence | None, config: PlannerConfig) -> Memory:
    """The memory with what is new. Another odometry epoch, or none for `max_reckon_s`, forgets everything seen."""
    if odometry is not None and odometry.healthy:
        memory = _with_pose(memory, odometry, config)
    if evidence is None or (evidence.frame_epoch, evidence.frame_seq) == memory.frame:
        return memory
    memory = msgspec.structs.replace(memory, frame=(evidence.frame_epoch, evidence.frame_seq))
    last_us = memory.sights[-1].at_us if memory.sights else -SIGHT_SPACING_US
    if not shows_water(evidence) or evidence.source_us - last_us < SIGHT_SPACING_US:
        return memory
    pose = pose_at(memory.poses, evidence.source_us, config.max_pose_gap_s)
    if pose is None:
        return memory
    return msgspec.structs.replace(memory, sights=_kept((*memory.sights, _sight(evidence, pose)), config))


def shows_water(evidence: Evidence) -> bool:
    """Is it free-space evidence: a live, usable picture, segmented by the learned net (F2)?"""
    return (
        evidence.usable
        and evidence.navigation_eligible
        and evidence.time_base is TimeBase.CAPTURE
        and evidence.width_px > 0
        and evidence.height_px > 0
        and len(evidence.water_edge) > 0
    )


def pose_at(poses: tuple[Pose, ...], at_us: int, max_gap_s: float) -> Pose | None:
    """The pose then, between the two around it, or the nearest; None if that one is further off than `max_gap_s`."""
    if not poses:
        return None
    nearest = min(poses, key=lambda pose: abs(pose.at_us - at_us))
    if abs(nearest.at_us - at_us) * 1e-6 > max_gap_s:
        return None
    for before, after in itertools.pairwise(poses):
        if before.at_us <= at_us <= after.at_us and after.at_us > before.at_us:
            part = (at_us - before.at_us) / (after.at_us - before.at_us)
            return Pose(
                at_us,
                before.x_m + part * (after.x_m - before.x_m),
                before.y_m + part * (after.y_m - before.y_m),
                before.yaw_rad + part * wrap_rad(after.yaw_rad - before.yaw_rad),
                before.roll_rad + part * (after.roll_rad - before.roll_rad),
                before.pitch_rad + part * (after.pitch_rad - before.pitch_rad),
            )
    return nearest


def _with_pose(memory: Memory, odometry: Odometry, config: PlannerConfig) -> Memory:
    numbers = (odometry.x_m, odometry.y_m, odometry.yaw_rad, odometry.roll_rad, odometry.pitch_rad)
    if not all(map(math.isfinite, (*numbers, odometry.surge_mps, odometry.sway_mps))):
        return memory
    here = memory.here
    if here is None or odometry.epoch != memory.epoch:
        return _begun(memory, odometry)
    step_s = (odometry.source_us - here.at_us) * 1e-6
    if step_s <= 0.0:
        return memory
    if step_s > config.max_reckon_s:
        return _begun(memory, odometry)
    cos, sin = portable.cos(odometry.yaw_rad), portable.sin(odometry.yaw_rad)
    east_m = (odometry.surge_mps * cos - odometry.sway_mps * sin) * step_s
    north_m = (odometry.surge_mps * sin + odometry.sway_mps * cos) * step_s
    here = Pose(odometry.source_us, here.x_m + east_m, here.y_m + north_m, *numbers[2:])
    memory = msgspec.structs.replace(memory, here=here)
    if here.at_us - memory.poses[-1].at_us < POSE_SPACING_US:
        return memory
    return msgspec.structs.replace(memory, poses=(*memory.poses, here)[-POSES_KEPT:])


def _begun(memory: Memory, odometry: Odometry) -> Memory:
    """Nothing seen, at the odometry's position."""
    here = Pose(odometry.source_us, odometry.x_m, odometry.y_m, odometry.yaw_rad, odometry.roll_rad, odometry.pitch_rad)
    return Memory(here, (here,), frame=memory.frame, epoch=odometry.epoch)


def _sight(evidence: Evidence, pose: Pose) -> Sight:
    carriers = [detection for detection in evidence.detections if detection.label in CARRIES]
    found = [each for each in evidence.detections if not _is_aboard(each, carriers, evidence.water_edge)]
    return Sight(
        evidence.source_us,
        pose.x_m,
        pose.y_m,
        pose.yaw_rad,
        pose.roll_rad,
        pose.pitch_rad,
        evidence.width_px / evidence.height_px,
        bytes(math.ceil(edge * EDGE_STEPS) for edge in evidence.water_edge),
        tuple(foot for detection in found for foot in _feet(detection, evidence.water_edge)),
        tuple(_box(detection, evidence.water_edge) for detection in found if _may_move(detection, evidence.water_edge)),
    )


def _is_aboard(person: Detection, carriers: Sequence[Detection], edge: tuple[float, ...]) -> bool:
    """A person on a vessel or a pier, whose foot is not on the water: what carries it is nearer, and counts instead.

    It stands within the other's box, and most of the water before it ends lower than its foot.
    """
    if person.label is not Label.PERSON or _land_before(person, edge) <= MASK_ROW:
        return False
    x1, _, x2, foot = person.box_xyxy
    return any(
        left <= 0.5 * (x1 + x2) <= right and top <= foot <= low - MASK_ROW
        for left, top, right, low in (carrier.box_xyxy for carrier in carriers)
    )


def _may_move(detection: Detection, edge: tuple[float, ...]) -> bool:
    """Whether it may move on the water: people ashore do not."""
    is_ashore = detection.label is Label.PERSON and _land_before(detection, edge) > ASHORE_ROWS * MASK_ROW
    return detection.label in MOVABLE and not is_ashore


def _land_before(detection: Detection, edge: tuple[float, ...]) -> float:
    """How far below its foot most of the water before it ends, of the picture; 0 or less: it stands in it."""
    ends = sorted(edge[column] for column in _columns(detection, edge))
    return ends[len(ends) // 2] - detection.box_xyxy[3] if ends else 0.0


def _box(detection: Detection, edge: tuple[float, ...]) -> Box:
    """It meets the water at its lower end; a hull where the mask ends the water, if in the box's lower half."""
    x1, y1, x2, y2 = detection.box_xyxy
    left, top, right, low = (FOOT_STEPS * side for side in detection.box_xyxy)
    ends = [math.ceil(low)] * BOX_COLUMNS
    if detection.label not in SMALL:
        for number in range(BOX_COLUMNS):
            u = x1 + (x2 - x1) * (number + 0.5) / BOX_COLUMNS
            seen = edge[min(max(int(u * len(edge)), 0), len(edge) - 1)]
            if 0.5 * (y1 + y2) <= seen <= y2:
                ends[number] = math.ceil(seen * FOOT_STEPS)
    return Box(math.floor(left), math.floor(top), math.ceil(right), math.ceil(low), detection.label, tuple(ends))


def _feet(detection: Detection, edge: tuple[float, ...]) -> Iterator[Foot]:
    """Where a box stands on the water.

    A small thing's lower end is its foot. A long hull or pier that lies aslant reaches that low at one end only: it
    stands where the mask ends the water, and on the box's lower end in columns where the mask looks through it. A
    column that the box covers in part is no such: there the mask looks past it.
    """
    x1, y1, x2, y2 = detection.box_xyxy
    low = math.ceil(y2 * FOOT_STEPS)
    if detection.label in SMALL:
        person = detection.label is Label.PERSON
        yield Foot(math.floor(x1 * FOOT_STEPS), math.ceil(x2 * FOOT_STEPS), low, person)
        return
    count = len(edge)
    columns = range(math.ceil(x1 * count), math.floor(x2 * count)) or _columns(detection, edge)
    for is_missed, run in itertools.groupby(columns, key=lambda column: edge[column] < y1):
        if is_missed:
            missed = tuple(run)
            yield Foot(missed[0] * FOOT_STEPS // count, -(-(missed[-1] + 1) * FOOT_STEPS // count), low)


def _columns(detection: Detection, edge: tuple[float, ...]) -> range:
    """The mask's columns that its box covers."""
    x1, _, x2, _ = detection.box_xyxy
    return range(math.floor(x1 * len(edge)), min(math.ceil(x2 * len(edge)), len(edge)))


def _kept(sights: tuple[Sight, ...], config: PlannerConfig) -> tuple[Sight, ...]:
    """All those within the lifetimes of Q3, a few older ones for what is out of sight, and the boxes of more."""
    newest_us = sights[-1].at_us
    kept: list[Sight] = []
    old_us = last_us = -OLD_SPACING_US
    for sight in sights:
        age_s = (newest_us - sight.at_us) * 1e-6
        is_apart = sight.at_us - last_us >= BOXES_SPACING_US
        if age_s <= config.occupied_s:
            kept.append(sight)
        elif age_s <= config.hidden_s and sight.edge and sight.at_us - old_us >= OLD_SPACING_US:
            kept.append(sight)
            old_us = last_us = sight.at_us
        elif age_s <= config.fit_s + config.unseen_s and sight.boxes and is_apart:
            kept.append(msgspec.structs.replace(sight, edge=b"", feet=()))
            last_us = sight.at_us
    return tuple(kept[-SIGHTS_KEPT:])
