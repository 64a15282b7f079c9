"""Scans of flat water with walls in it, as a range scanner on the boat would measure them without noise."""

from __future__ import annotations

import math

import numpy as np

from paani import messages as m
from paani_services.navigator.mapping.observation import ObservationMemory, update_memory
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import PLANNER, Bar, move_to

BEAMS, MAX_RANGE_M = 360, 20.0
STEP_RAD = 2.0 * math.pi / BEAMS
SCAN_US = 200_000  # between two turns


def sides_of(bar: Bar) -> tuple[tuple[float, float, float, float], ...]:
    """The four sides of a bar, as x and y of both ends."""
    west, south, east, north = bar
    return (
        (west, south, east, south),
        (east, south, east, north),
        (east, north, west, north),
        (west, north, west, south),
    )


def scan_of(at_us: int, boat: BoatPose, bars: tuple[Bar, ...], forward_m: float = 0.0) -> m.RangeScan:
    """One turn, for a boat with this pose among these bars."""
    bearings = boat.yaw_rad - math.pi + STEP_RAD * np.arange(BEAMS)
    east, north = np.cos(bearings), np.sin(bearings)
    x_m, y_m = boat.x_m + forward_m * math.cos(boat.yaw_rad), boat.y_m + forward_m * math.sin(boat.yaw_rad)
    nearest = np.full(BEAMS, np.inf)
    for x1, y1, x2, y2 in (side for bar in bars for side in sides_of(bar)):
        along_x, along_y = x2 - x1, y2 - y1
        cross = east * along_y - north * along_x
        with np.errstate(divide="ignore", invalid="ignore"):
            range_m = ((x1 - x_m) * along_y - (y1 - y_m) * along_x) / cross
            part = ((x1 - x_m) * north - (y1 - y_m) * east) / cross
        is_met = np.isfinite(range_m) & (range_m > 0.0) & (part >= 0.0) & (part <= 1.0)
        nearest = np.minimum(nearest, np.where(is_met, range_m, np.inf))
    ranges_m = np.where(nearest <= MAX_RANGE_M, nearest, 0.0)
    return m.RangeScan(
        source_us=at_us,
        ranges_m=tuple(ranges_m.tolist()),
        first_bearing_rad=-math.pi,
        step_rad=STEP_RAD,
        max_range_m=MAX_RANGE_M,
        forward_m=forward_m,
    )


def scan_from(
    at_us: int, boat: BoatPose, bars: tuple[Bar, ...], memory: ObservationMemory, forward_m: float = 0.0
) -> ObservationMemory:
    """The memory after one more turn of the scanner at this pose."""
    memory = move_to(memory, at_us, boat)
    return update_memory(memory, None, None, PLANNER, scan_of(at_us, boat, bars, forward_m))
