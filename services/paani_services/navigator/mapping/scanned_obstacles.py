"""What a range scanner adds to the map of the water: echoes, and the velocities of what they move with. Pure.

It only ever adds: no cell becomes free by a scan, and nothing that the camera saw goes.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from paani.arrays import F64, I64
from paani.config import PlannerConfig
from paani.messages import Label
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle, measurements_of_end
from paani_services.navigator.mapping.occupancy_grid import NO_BOXES, OccupancyGrid
from paani_services.navigator.mapping.range_scans import (
    MAX_SCANS,
    RANGE_STD_M,
    Scan,
    beam_directions,
    find_echoes,
    find_segments,
    match_segments,
)
from paani_services.navigator.mapping.velocity_fit import PositionMeasurement, Velocity, estimate_velocity

MIN_BEAMS = 2  # that meet what is tracked: one alone tells neither of its ends
POINT_SPACING_M, MAX_POINTS = 0.6, 24  # of an outline: no gap that a hull with its margin fits in
# Of what is longer the nearer end moves as it does, and its middle as more of it comes out from behind that end.
LONG_M = 3.0
FAR_PART = 0.9  # of the scanner's range; what ends beyond may go on
THROUGH_S = 0.8  # before, at least: in this time what moves at a walking pace leaves its own outline
# By which a beam went further than a place, so that it was water: noise, and two deviations of the yaw.
THROUGH_M, THROUGH_RAD = 0.25, 0.02
MIN_THROUGH = 2  # points of an outline that lie where it was water


class ScannedWater(NamedTuple):
    """What the newest scan shows: beams whose echo stands, and what moves."""

    scan: Scan
    standing: I64
    obstacles: tuple[DynamicObstacle, ...]


def scan_water(scans: tuple[Scan, ...], now_us: int, config: PlannerConfig) -> ScannedWater | None:
    """The water by the newest scan that is not older than `scan_max_age_s`; None without one.

    An echo stands unless its segment moves for certain: by a velocity that is no chance, into what was water to an
    earlier scan. Of a bank or a long row another part comes into sight as the boat goes by, and that seems to move too.
    """
    scans = tuple(each for each in scans if each.stamp_us <= now_us)
    if not scans or (now_us - scans[-1].stamp_us) * 1e-6 > config.scan_max_age_s:
        return None
    newest = scans[-1]
    standing, obstacles = newest.ranges_m > 0.0, []
    before = scans[0] if newest.stamp_us - scans[0].stamp_us >= THROUGH_S * 1e6 else None
    for track in _track_segments(scans) if config.predict else ():
        last = track[-1]
        if before is None or not _is_entering(last.outline, before):
            continue
        velocity = _estimate_velocity(track, newest, config)
        if velocity is not None:
            standing[find_segments(newest)[last.box_id[1]]] = False
            obstacles.append(_predict(last.outline, velocity, now_us - newest.stamp_us, config))
    return ScannedWater(newest, np.flatnonzero(standing), tuple(obstacles))


def mark_echoes(grid: OccupancyGrid, water: ScannedWater) -> OccupancyGrid:
    """The grid with the cells of standing echoes occupied, whatever else they were taken for."""
    east_m, north_m = (each[water.standing] for each in find_echoes(water.scan))
    row, column, is_on_grid = grid.locate(east_m, north_m)
    echoes = np.zeros_like(grid.occupied)
    echoes[row[is_on_grid], column[is_on_grid]] = True
    return grid.with_occupied(echoes)


def _track_segments(scans: tuple[Scan, ...]) -> list[list[PositionMeasurement]]:
    """The measurements of each segment of the newest scan that can be tracked, oldest first."""
    tracks = []
    for number, measurement in _measure_segments(scans[-1]).items():
        track, at = [measurement], number
        for before, after in zip(scans[-2::-1], scans[:0:-1], strict=True):
            at = match_segments(before, after).get(at, -1)
            earlier = _measure_segments(before).get(at)
            if earlier is None:
                break
            track.append(earlier)
        tracks.append(track[::-1])
    return tracks


@functools.lru_cache(maxsize=MAX_SCANS)
def _measure_segments(scan: Scan) -> dict[int, PositionMeasurement]:
    """The segments that can be tracked as measurements of positions, by their number."""
    ranges_m = scan.ranges_m
    return {
        number: _measure_segment(scan, number, beams, ranges_m)
        for number, beams in enumerate(find_segments(scan))
        if MIN_BEAMS <= beams.size < ranges_m.size
    }


def _measure_segment(scan: Scan, number: int, beams: I64, ranges_m: F64) -> PositionMeasurement:
    """Its middle, and points of its outline from left to right, which is against the order of the beams."""
    beams = beams[::-1]
    east_m, north_m = (each[beams] for each in find_echoes(scan))
    length_m = math.hypot(float(east_m[-1] - east_m[0]), float(north_m[-1] - north_m[0]))
    count = min(max(math.ceil(length_m / POINT_SPACING_M) + 1, 2), MAX_POINTS)
    chosen = np.unique(np.round(np.linspace(0.0, beams.size - 1.0, count)).astype(np.int64))
    deviation_m = RANGE_STD_M + 0.5 * scan.step_rad * float(ranges_m[beams].min())
    information = 1.0 / (deviation_m * deviation_m)
    return PositionMeasurement(
        (scan.stamp_us, number),
        Label.VESSEL,
        (float(0.5 * (east_m[0] + east_m[-1])), float(0.5 * (north_m[0] + north_m[-1]))),
        (information, 0.0, information),
        deviation_m,
        (east_m[chosen], north_m[chosen]),
        (_is_end(scan, int(beams[0]), 1, ranges_m), _is_end(scan, int(beams[-1]), -1, ranges_m)),
        (length_m, 0.0),
    )


def _is_end(scan: Scan, beam: int, side: int, ranges_m: F64) -> bool:
    """Whether the surface ends at this beam: the next one goes further, and it is not cut off by anything nearer."""
    following_m = float(ranges_m[(beam + side) % ranges_m.size])
    here_m = float(ranges_m[beam])
    return here_m < FAR_PART * scan.max_range_m and (following_m == 0.0 or following_m > here_m)


def _is_entering(outline: tuple[F64, F64], before: Scan) -> bool:
    """Whether points of an outline lie where beams of an earlier scan, and those beside them, went through."""
    east_m, north_m = outline[0] - before.x_m, outline[1] - before.y_m
    distance_m = np.hypot(east_m, north_m)
    east, north = beam_directions(before)
    beam = (east_m[:, None] * east + north_m[:, None] * north).argmax(axis=1)
    ranges_m = before.ranges_m
    reach_m = np.where(ranges_m > 0.0, ranges_m, FAR_PART * before.max_range_m)
    reach_m = np.minimum(np.minimum(np.roll(reach_m, 1), np.roll(reach_m, -1)), reach_m)
    return int((reach_m[beam] > distance_m + THROUGH_M + THROUGH_RAD * distance_m).sum()) >= MIN_THROUGH


def _estimate_velocity(track: list[PositionMeasurement], newest: Scan, config: PlannerConfig) -> Velocity | None:
    """That of the middle of what is short, of the nearer end of what is long; None where it may be chance."""
    last = track[-1]
    if last.is_whole and max(each.size_m[0] for each in track) <= LONG_M:
        return estimate_velocity([each for each in track if each.is_whole], config.fit_s)
    east_m, north_m = last.outline[0] - newest.x_m, last.outline[1] - newest.y_m
    distance_m = np.hypot(east_m, north_m)
    nearer = int(distance_m[-1] < distance_m[0])
    of_end = measurements_of_end(track, nearer)
    return estimate_velocity(of_end, config.fit_s) if of_end and of_end[-1].stamp_us == newest.stamp_us else None


def _predict(outline: tuple[F64, F64], velocity: Velocity, age_us: int, config: PlannerConfig) -> DynamicObstacle:
    age_s = age_us * 1e-6
    east_m, north_m = outline[0] + age_s * velocity.east_mps, outline[1] + age_s * velocity.north_mps
    return DynamicObstacle(east_m, north_m, config.vessel_near_m, velocity, age_s, NO_BOXES, is_scanned=True)
