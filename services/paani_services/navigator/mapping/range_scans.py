"""Range scans of the last seconds in the frame of dead reckoning, and the segments that their echoes form. Pure."""

import functools
import math

import msgspec
import numpy as np

from paani import portable
from paani.arrays import F64, I64
from paani.config import PlannerConfig
from paani.messages import RangeScan
from paani_services.navigator.mapping.stamped_pose import StampedPose, interpolate_pose

CM = 100.0  # ranges are kept in whole centimetres, finer than a scanner measures
SPACING_US = 90_000  # between two remembered scans, at least
MAX_SCANS = 48  # they span `fit_s` at 10 Hz, and more
# The least angle between a beam and the surface that it meets at which the next beam's echo still belongs to it.
LEAST_INCIDENCE_RAD = math.radians(10.0)
GATE_M, GATE_MPS = 0.3, 3.5  # between two scans of one surface: its shape, and the fastest vessel (rowing eights)
RANGE_STD_M = 0.03  # of one echo, of the common scanners


class Scan(msgspec.Struct, frozen=True, array_like=True, cache_hash=True):
    """One turn: where the scanner was, the bearing of its first beam in the map, and its ranges.

    ranges_cm: 16 bits of each beam, low byte first; 0: nothing within `max_range_m`.
    """

    stamp_us: int
    x_m: float
    y_m: float
    first_rad: float
    step_rad: float
    max_range_m: float
    ranges_cm: bytes

    @property
    def ranges_m(self) -> F64:
        """The range of each beam, 0 where nothing was met [beams]."""
        return np.asarray(np.frombuffer(self.ranges_cm, np.dtype("<u2")) / CM)


def add_scan(
    scans: tuple[Scan, ...], message: RangeScan, poses: tuple[StampedPose, ...], config: PlannerConfig
) -> tuple[Scan, ...]:
    """Add the newest scan, if it is a new one and the boat's pose at its time is known; forget what is of no use."""
    newest_us = scans[-1].stamp_us if scans else -SPACING_US
    if config.scan_max_age_s == 0.0 or message.source_us - newest_us < SPACING_US:
        return scans
    pose = interpolate_pose(poses, message.source_us, config.max_pose_gap_s)
    if pose is None:
        return scans
    cos, sin = portable.cos(pose.yaw_rad), portable.sin(pose.yaw_rad)
    scan = Scan(
        message.source_us,
        pose.x_m + message.forward_m * cos,
        pose.y_m + message.forward_m * sin,
        pose.yaw_rad + message.first_bearing_rad,
        message.step_rad,
        message.max_range_m,
        np.round(np.array(message.ranges_m) * CM).astype("<u2").tobytes(),
    )
    oldest_us = message.source_us - round(config.fit_s * 1e6)
    return (*(each for each in scans if each.stamp_us >= oldest_us), scan)[-MAX_SCANS:]


@functools.lru_cache(maxsize=MAX_SCANS)
def beam_directions(scan: Scan) -> tuple[F64, F64]:
    """East and north of a unit vector along each beam [beams]."""
    ahead, aside = _directions_from_first(scan.step_rad, len(scan.ranges_cm) // 2)
    cos, sin = portable.cos(scan.first_rad), portable.sin(scan.first_rad)
    return ahead * cos - aside * sin, ahead * sin + aside * cos


@functools.lru_cache(maxsize=4)
def _directions_from_first(step_rad: float, count: int) -> tuple[F64, F64]:
    """Along and across the first beam, of a unit vector along each [beams]."""
    turns_rad = [number * step_rad for number in range(count)]
    return np.array([portable.cos(each) for each in turns_rad]), np.array([portable.sin(each) for each in turns_rad])


@functools.lru_cache(maxsize=MAX_SCANS)
def find_echoes(scan: Scan) -> tuple[F64, F64]:
    """East and north of each beam's echo; the scanner's own place where nothing was met [beams]."""
    east, north = beam_directions(scan)
    ranges_m = scan.ranges_m
    return scan.x_m + ranges_m * east, scan.y_m + ranges_m * north


@functools.lru_cache(maxsize=MAX_SCANS)
def match_segments(before: Scan, after: Scan) -> dict[int, int]:
    """For segments of one scan, by number, the one of the scan before to which all their echoes together lie nearest.

    None is further away than `GATE_M` and what the fastest vessel makes meanwhile. Two may go on from one: a hull whose
    side breaks off at another place in every scan. A piece that broke off is near to a few echoes of the hull alone.
    """
    runs, later_runs = find_segments(before), find_segments(after)
    if not runs or not later_runs:
        return {}
    east_m, north_m = (each[np.concatenate(runs)] for each in find_echoes(before))
    later_east_m, later_north_m = (each[np.concatenate(later_runs)] for each in find_echoes(after))
    off_east_m, off_north_m = later_east_m[:, None] - east_m, later_north_m[:, None] - north_m
    square_m2 = off_east_m * off_east_m + off_north_m * off_north_m
    first, later_first = ([0, *np.cumsum([run.size for run in each])[:-1]] for each in (runs, later_runs))
    nearest_m2 = np.minimum.reduceat(square_m2, first, axis=1)  # of each echo to each segment before
    gate_m = GATE_M + GATE_MPS * (after.stamp_us - before.stamp_us) * 1e-6
    is_far = np.minimum.reduceat(nearest_m2, later_first, axis=0) > gate_m * gate_m
    # In whole millimetres, as the sum of whole numbers does not depend on their order.
    together_mm = np.add.reduceat(np.rint(1e3 * np.sqrt(nearest_m2)).astype(np.int64), later_first, axis=0)
    together_mm[is_far] = np.iinfo(np.int64).max
    return {number: int(row_mm.argmin()) for number, row_mm in enumerate(together_mm) if not is_far[number].all()}


@functools.lru_cache(maxsize=MAX_SCANS)
def find_segments(scan: Scan) -> list[I64]:
    """The beams of each run of echoes that lie on one surface, in their order; a run may go on past the last beam.

    Two echoes side by side are of one surface while it may still be met at `LEAST_INCIDENCE_RAD` (adaptive breakpoint
    detection; Borges, Aldon: "Line extraction in 2D range images for mobile robotics", 2004, equation 8).
    """
    ranges_m = scan.ranges_m
    count = ranges_m.size
    is_round = abs(count * scan.step_rad - 2.0 * math.pi) < 0.5 * scan.step_rad
    east_m, north_m = find_echoes(scan)
    ratio = portable.sin(scan.step_rad) / portable.sin(max(LEAST_INCIDENCE_RAD - scan.step_rad, scan.step_rad))
    apart_m = np.hypot(np.roll(east_m, -1) - east_m, np.roll(north_m, -1) - north_m)
    is_met = ranges_m > 0.0
    goes_on = is_met & np.roll(is_met, -1) & (apart_m <= ratio * ranges_m + 3.0 * RANGE_STD_M)
    goes_on[-1] &= is_round
    if goes_on.all():
        return [np.arange(count)]
    first = int(np.flatnonzero(~goes_on)[0]) + 1  # of a beam that goes on from none
    order = (first + np.arange(count)) % count
    ends = np.flatnonzero(~goes_on[order])
    return [run for run in np.split(order, ends[:-1] + 1) if is_met[run[0]]]
