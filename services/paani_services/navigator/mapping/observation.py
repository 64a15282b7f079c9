"""Observations of the water from the last pictures, and the poses from which they were taken. Pure.

An observation is what a picture shows, still in the picture: it is small enough to be part of the recorded state, and
is projected to the map only when it is used.
"""

import itertools
import math
from collections.abc import Iterator, Sequence

import msgspec

from paani import portable
from paani.config import PlannerConfig
from paani.messages import Detection, Evidence, Label, Odometry, RangeScan, TimeBase, Tracks
from paani_services.navigator.mapping.projection import Pose
from paani_services.navigator.mapping.range_scans import Scan, add_scan
from paani_services.navigator.mapping.stamped_pose import StampedPose, interpolate_pose

EDGE_STEPS = 128  # of the picture's height, in which the water edge is stored: two for each row of the mask
BOX_STEPS = 512  # of the picture's width and height, in which boxes are stored
POSE_SPACING_US = 90_000  # between two remembered poses, at least
MAX_POSES = 14  # they span 1.2 s, which is longer than a picture takes to become evidence
OBSERVATION_SPACING_US = 100_000  # between two remembered observations, at least
OLD_OBSERVATIONS = 25  # kept for what is out of sight; more cost time in every plan
# Pictures from within such a square, to sides within such an angle, show the same but for a seventh of their width.
VIEW_SIZE_M, VIEW_SIZE_RAD = 1.0, math.radians(10.0)
BOX_SPACING_US = 190_000  # between those kept for their boxes alone
MAX_OBSERVATIONS = 224
OUTLINE_POINTS = 9  # of a box's waterline
MIN_HULL_COLUMNS = 6  # of the mask, in which it shows a waterline that no single column decides
SMALL_LABELS = frozenset({Label.PERSON, Label.BUOY})  # the lower end of the box is where these stand
MOVABLE_LABELS = frozenset({Label.PERSON, Label.BUOY, Label.VESSEL})
CARRIER_LABELS = frozenset({Label.VESSEL, Label.PIER})  # a person may stand on these
MASK_ROW_FRAC = 1.0 / 64.0  # a row of the mask, of the picture's height
# Rows of the mask between the end of the water and the foot of a person ashore: less may be a reflection.
MIN_ASHORE_ROWS = 3.0


class FootLine(msgspec.Struct, frozen=True, array_like=True):
    """Where an obstacle stands: left, right and lower end in 1/512 of the picture, rounded outwards."""

    left: int
    right: int
    bottom: int
    is_person: bool = False


class ObstacleBox(msgspec.Struct, frozen=True, array_like=True):
    """A detection of something that may move: its sides in 1/512 of the picture, rounded outwards.

    waterline: the height at which it meets the water, at `OUTLINE_POINTS` places from left to right.
    """

    left: int
    top: int
    right: int
    bottom: int
    label: Label
    waterline: tuple[int, ...]

    @property
    def is_small(self) -> bool:
        """Whether its lower end is where it stands on the water."""
        return self.label in SMALL_LABELS


class Observation(
    msgspec.Struct,
    frozen=True,
    cache_hash=True,
    rename={"stamp_us": "at_us", "aspect_ratio": "aspect", "water_edge": "edge"},
):
    """What one picture shows of the water, and the pose it was taken from. Recorded under the names of `rename`.

    aspect_ratio: picture width over height.
    water_edge: where the water ends in each column, left to right, in 1/128 of the height from the top, rounded towards
    the boat.
    feet: where obstacles stand. boxes: what may move. Of old observations the boxes alone are kept.
    box_track_ids: the advisor's track of each box, 0 where it has none; empty until its tracks are known.
    """

    stamp_us: int
    x_m: float
    y_m: float
    yaw_rad: float
    roll_rad: float
    pitch_rad: float
    aspect_ratio: float
    water_edge: bytes
    feet: tuple[FootLine, ...] = ()
    boxes: tuple[ObstacleBox, ...] = ()
    box_track_ids: tuple[int, ...] = ()

    @property
    def pose(self) -> Pose:
        """The pose of the boat when the picture was taken."""
        return Pose(self.x_m, self.y_m, self.yaw_rad, self.roll_rad, self.pitch_rad)


class ObservationMemory(
    msgspec.Struct,
    frozen=True,
    rename={"odom_pose": "here", "observations": "sights", "frame_id": "frame"},
):
    """The remembered poses and observations, oldest first. It is recorded under the field names of `rename`.

    odom_pose: the position by dead reckoning since the memory began, with the map's axes: REP-105's `odom` frame. All
    observations lie in it, because the GPS position wanders and would carry them about.
    frame_id: epoch and sequence of the newest frame. epoch: of the odometry.
    """

    odom_pose: StampedPose | None = None
    poses: tuple[StampedPose, ...] = ()
    observations: tuple[Observation, ...] = ()
    frame_id: tuple[int, int] = (-1, -1)
    epoch: int = -1
    scans: tuple[Scan, ...] = ()


def update_memory(
    memory: ObservationMemory,
    odometry: Odometry | None,
    evidence: Evidence | None,
    config: PlannerConfig,
    scan: RangeScan | None = None,
) -> ObservationMemory:
    """Add the newest odometry, evidence and range scan.

    Another odometry epoch, no odometry for `max_reckon_s`, or a clock that was set back forgets all observations.
    """
    if odometry is not None and odometry.healthy:
        memory = _add_pose(memory, odometry, config)
    if scan is not None:
        memory = msgspec.structs.replace(memory, scans=add_scan(memory.scans, scan, memory.poses, config))
    if evidence is None or (evidence.frame_epoch, evidence.frame_seq) == memory.frame_id:
        return memory
    memory = msgspec.structs.replace(memory, frame_id=(evidence.frame_epoch, evidence.frame_seq))
    last_us = memory.observations[-1].stamp_us if memory.observations else -OBSERVATION_SPACING_US
    if not is_free_space_evidence(evidence) or evidence.source_us - last_us < OBSERVATION_SPACING_US:
        return memory
    pose = interpolate_pose(memory.poses, evidence.source_us, config.max_pose_gap_s)
    if pose is None:
        return memory
    return msgspec.structs.replace(
        memory, observations=_prune_observations((*memory.observations, _make_observation(evidence, pose)), config)
    )


def begins_anew(memory: ObservationMemory, before: ObservationMemory) -> bool:
    """Whether dead reckoning began anew since the memory before: places of that one lie elsewhere in this one."""
    return not memory.poses or memory.poses[0] not in before.poses


def is_free_space_evidence(evidence: Evidence) -> bool:
    """Whether evidence may free cells: a live, usable picture, segmented by the trained network (F2)."""
    return (
        evidence.usable
        and evidence.navigation_eligible
        and evidence.time_base is TimeBase.CAPTURE
        and evidence.width_px > 0
        and evidence.height_px > 0
        and len(evidence.water_edge) > 0
    )


def _add_pose(memory: ObservationMemory, odometry: Odometry, config: PlannerConfig) -> ObservationMemory:
    """Dead-reckon the odometry's step: its velocity over ground, times its time since the step before."""
    numbers = (odometry.x_m, odometry.y_m, odometry.yaw_rad, odometry.roll_rad, odometry.pitch_rad)
    if not all(map(math.isfinite, (*numbers, odometry.surge_mps, odometry.sway_mps))):
        return memory
    odom_pose = memory.odom_pose
    if odom_pose is None or odometry.epoch != memory.epoch:
        return _restart_memory(memory, odometry)
    step_s = (odometry.source_us - odom_pose.stamp_us) * 1e-6
    if step_s == 0.0:
        return memory
    if not 0.0 < step_s <= config.max_reckon_s:
        return _restart_memory(memory, odometry)
    cos, sin = portable.cos(odometry.yaw_rad), portable.sin(odometry.yaw_rad)
    east_m = (odometry.surge_mps * cos - odometry.sway_mps * sin) * step_s
    north_m = (odometry.surge_mps * sin + odometry.sway_mps * cos) * step_s
    odom_pose = StampedPose(odometry.source_us, odom_pose.x_m + east_m, odom_pose.y_m + north_m, *numbers[2:])
    memory = msgspec.structs.replace(memory, odom_pose=odom_pose)
    if odom_pose.stamp_us - memory.poses[-1].stamp_us < POSE_SPACING_US:
        return memory
    return msgspec.structs.replace(memory, poses=(*memory.poses, odom_pose)[-MAX_POSES:])


def _restart_memory(memory: ObservationMemory, odometry: Odometry) -> ObservationMemory:
    """A memory without observations, at the odometry's position."""
    odom_pose = StampedPose(
        odometry.source_us, odometry.x_m, odometry.y_m, odometry.yaw_rad, odometry.roll_rad, odometry.pitch_rad
    )
    return ObservationMemory(odom_pose, (odom_pose,), frame_id=memory.frame_id, epoch=odometry.epoch)


def _make_observation(evidence: Evidence, pose: StampedPose) -> Observation:
    carriers = [detection for detection in evidence.detections if detection.label in CARRIER_LABELS]
    found = [each for each in evidence.detections if not _is_aboard(each, carriers, evidence.water_edge)]
    return Observation(
        evidence.source_us,
        pose.x_m,
        pose.y_m,
        pose.yaw_rad,
        pose.roll_rad,
        pose.pitch_rad,
        evidence.width_px / evidence.height_px,
        bytes(math.ceil(water_edge * EDGE_STEPS) for water_edge in evidence.water_edge),
        tuple(foot for detection in found for foot in _find_feet(detection, evidence.water_edge)),
        tuple(_make_box(evidence.detections[number - 1], evidence.water_edge) for number in _movable(evidence)),
    )


def _movable(evidence: Evidence) -> list[int]:
    """The numbers, from 1, of the detections that may move on the water, in the order of an observation's boxes."""
    carriers = [detection for detection in evidence.detections if detection.label in CARRIER_LABELS]
    return [
        number
        for number, each in enumerate(evidence.detections, 1)
        if _may_move(each, evidence.water_edge) and not _is_aboard(each, carriers, evidence.water_edge)
    ]


def add_track_ids(memory: ObservationMemory, evidence: Evidence | None, tracks: Tracks | None) -> ObservationMemory:
    """Add the advisor's tracks to the boxes of the newest observation, once both are of the same picture."""
    if evidence is None or tracks is None or not memory.observations:
        return memory
    newest = memory.observations[-1]
    frames = {(evidence.frame_epoch, evidence.frame_seq), (tracks.frame_epoch, tracks.frame_seq)}
    if newest.box_track_ids or not newest.boxes or newest.stamp_us != evidence.source_us or len(frames) != 1:
        return memory
    ids = {track.detection_number: track.id for track in tracks.tracks if track.detection_number}
    labelled = msgspec.structs.replace(newest, box_track_ids=tuple(ids.get(n, 0) for n in _movable(evidence)))
    return msgspec.structs.replace(memory, observations=(*memory.observations[:-1], labelled))


def _is_aboard(rider: Detection, carriers: Sequence[Detection], water_edge: tuple[float, ...]) -> bool:
    """Whether a person stands on a vessel or a pier. Then that is nearer than the person, and counts instead.

    The person's foot lies within the other's box, and most of the water before the person ends below the foot.
    """
    if rider.label is not Label.PERSON or _land_below_foot(rider, water_edge) <= MASK_ROW_FRAC:
        return False
    x1, _, x2, foot = rider.box_xyxy
    return any(
        left <= 0.5 * (x1 + x2) <= right and top <= foot <= bottom - MASK_ROW_FRAC
        for left, top, right, bottom in (carrier.box_xyxy for carrier in carriers)
    )


def _may_move(detection: Detection, water_edge: tuple[float, ...]) -> bool:
    """Whether the detection may move on the water; people ashore do not."""
    is_ashore = (
        detection.label is Label.PERSON and _land_below_foot(detection, water_edge) > MIN_ASHORE_ROWS * MASK_ROW_FRAC
    )
    return detection.label in MOVABLE_LABELS and not is_ashore


def _land_below_foot(detection: Detection, water_edge: tuple[float, ...]) -> float:
    """How far most of the water before a box ends below its foot, of the picture's height; at most 0 in the water."""
    edges = sorted(water_edge[column] for column in _covered_columns(detection, water_edge))
    return edges[len(edges) // 2] - detection.box_xyxy[3] if edges else 0.0


def _make_box(detection: Detection, water_edge: tuple[float, ...]) -> ObstacleBox:
    """The box of what may move, with its waterline.

    It meets the water at its lower end; a hull does where the mask ends the water, if that is in the box's lower half.
    What is as wide as a hull is one, whatever the detector calls it, but for a person.
    """
    x1, y1, x2, y2 = detection.box_xyxy
    left, top, right, bottom = (BOX_STEPS * side for side in detection.box_xyxy)
    waterline = [math.ceil(bottom)] * OUTLINE_POINTS
    is_wide = detection.label is not Label.PERSON and (x2 - x1) * len(water_edge) >= MIN_HULL_COLUMNS
    if detection.label not in SMALL_LABELS or is_wide:
        for number in range(OUTLINE_POINTS):
            u = x1 + (x2 - x1) * (number + 0.5) / OUTLINE_POINTS
            seen = water_edge[min(max(int(u * len(water_edge)), 0), len(water_edge) - 1)]
            if 0.5 * (y1 + y2) <= seen <= y2:
                waterline[number] = math.ceil(seen * BOX_STEPS)
    return ObstacleBox(
        math.floor(left), math.floor(top), math.ceil(right), math.ceil(bottom), detection.label, tuple(waterline)
    )


def _find_feet(detection: Detection, water_edge: tuple[float, ...]) -> Iterator[FootLine]:
    """The places where a detection stands on the water.

    The lower end of a small obstacle is where it stands. A long hull or pier that lies aslant reaches that low at one
    end only: it stands where the mask ends the water, and at its box's lower end where the mask misses it. Columns that
    the box covers in part do not count, because there the mask shows the water beside it.
    """
    x1, y1, x2, y2 = detection.box_xyxy
    bottom = math.ceil(y2 * BOX_STEPS)
    if detection.label in SMALL_LABELS:
        is_person = detection.label is Label.PERSON
        yield FootLine(math.floor(x1 * BOX_STEPS), math.ceil(x2 * BOX_STEPS), bottom, is_person)
        return
    count = len(water_edge)
    columns = range(math.ceil(x1 * count), math.floor(x2 * count)) or _covered_columns(detection, water_edge)
    for is_missed, run in itertools.groupby(columns, key=lambda column: water_edge[column] < y1):
        if is_missed:
            missed = tuple(run)
            yield FootLine(missed[0] * BOX_STEPS // count, -(-(missed[-1] + 1) * BOX_STEPS // count), bottom)


def _covered_columns(detection: Detection, water_edge: tuple[float, ...]) -> range:
    """The mask's columns that the detection's box covers."""
    x1, _, x2, _ = detection.box_xyxy
    return range(math.floor(x1 * len(water_edge)), min(math.ceil(x2 * len(water_edge)), len(water_edge)))


def _prune_observations(observations: tuple[Observation, ...], config: PlannerConfig) -> tuple[Observation, ...]:
    """Keep what is still of use.

    That is every observation within the lifetimes of Q3, a few older ones for what is out of sight, and the boxes of
    more for the velocities of dynamic obstacles.
    """
    newest_us = observations[-1].stamp_us
    views = _distinct_views(observations, newest_us, config)
    kept: list[Observation] = []
    last_us = -BOX_SPACING_US
    for observation in observations:
        age_s = (newest_us - observation.stamp_us) * 1e-6
        is_apart = observation.stamp_us - last_us >= BOX_SPACING_US
        if age_s <= config.occupied_s:
            kept.append(observation)
        elif observation.stamp_us in views:
            kept.append(observation)
            last_us = observation.stamp_us
        elif age_s <= config.fit_s + config.unseen_s and observation.boxes and is_apart:
            is_bare = not observation.water_edge and not observation.feet  # the same object stays: its hash is kept
            kept.append(observation if is_bare else msgspec.structs.replace(observation, water_edge=b"", feet=()))
            last_us = observation.stamp_us
    return tuple(kept[-MAX_OBSERVATIONS:])


def _distinct_views(observations: tuple[Observation, ...], newest_us: int, config: PlannerConfig) -> frozenset[int]:
    """Stamps of the newest of the older pictures from each square to each side, of `OLD_OBSERVATIONS` of these.

    A boat that lies still so remembers each side as it last looked there; one that turns far, the newest of them.
    """
    found: dict[tuple[int, int, int], int] = {}
    for each in reversed(observations):
        if each.water_edge and config.occupied_s < (newest_us - each.stamp_us) * 1e-6 <= config.hidden_s:
            found.setdefault(_view(each), each.stamp_us)
        if len(found) == OLD_OBSERVATIONS:
            break
    return frozenset(found.values())


def _view(observation: Observation) -> tuple[int, int, int]:
    """The numbers of the square and of the side that it was taken from and to."""
    return (
        math.floor(observation.x_m / VIEW_SIZE_M),
        math.floor(observation.y_m / VIEW_SIZE_M),
        math.floor(observation.yaw_rad / VIEW_SIZE_RAD),
    )
