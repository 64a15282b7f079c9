"""Integral line-of-sight guidance (ILOS): the integral state that crabs the boat against wind and current.

Borhaug, Pavlov, Pettersen, "Integral LOS control for path following of underactuated marine surface vessels in the
presence of constant ocean currents", CDC 2008. The desired course points at a place `lookahead_m` ahead on the leg
and `y + s` abeam, with cross-track error y and integral s. The integral grows by sigma L y / ((y + s)^2 + L^2) each
second, which fades far from the leg, so that it does not wind up there.

Three things are ours:
  1. The state is a vector in the map frame, and s is its component across the leg: a steady drift pushes to one side
     of the map, so the integral stays valid when the next leg points elsewhere.
  2. The integral is held while the boat closes in on its leg faster than `MAX_CLOSING_MPS`: a cross-track error that
     is shrinking by itself is no drift.
  3. The vector is bounded by `max_crab_deg`.
"""

import math

import msgspec

from paani import portable
from paani.config import NavigatorConfig
from paani.geometry import clip
from paani.messages import Odometry
from paani_services.navigator.guidance.path_progress import WaypointPath, leg_start, velocity_over_ground_mps

MAX_CLOSING_MPS = 0.1  # speed towards the leg beyond which the integral is held; the integral alone closes in slower
MAX_STEP_S = 0.3  # a longer gap since the last step is integrated as this long, three periods at 10 Hz


class IlosState(msgspec.Struct, frozen=True, rename={"updated_us": "at_us"}):
    """Integral of the cross-track error as a vector in the map frame [m], and when it was last stepped [us]."""

    east_m: float = 0.0
    north_m: float = 0.0
    updated_us: int = 0


def integral_offset_m(ilos: IlosState, path: WaypointPath, target: int) -> float:
    """Component of the integral to the left of the leg that ends at waypoint `target`: s of the paper."""
    left_x, left_y = _left_normal(path, target)
    return ilos.east_m * left_x + ilos.north_m * left_y


def integrate(
    ilos: IlosState,
    path: WaypointPath,
    target: int,
    cross_track_m: float,
    odometry: Odometry,
    now_us: int,
    config: NavigatorConfig,
) -> IlosState:
    """Step the integral at this cross-track error (positive to the left of the leg), bounded by `max_crab_deg`."""
    left_x, left_y = _left_normal(path, target)
    east_mps, north_mps = velocity_over_ground_mps(odometry)
    if -math.copysign(1.0, cross_track_m) * (east_mps * left_x + north_mps * left_y) > MAX_CLOSING_MPS:
        return hold_integral(ilos, now_us)
    lookahead_m = config.lookahead_m
    step_s = clip((now_us - ilos.updated_us) * 1e-6, 0.0, MAX_STEP_S) if ilos.updated_us else 0.0
    abeam_m = cross_track_m + integral_offset_m(ilos, path, target)
    growth_m = (
        step_s * config.crab_gain_mps * lookahead_m * cross_track_m / (abeam_m * abeam_m + lookahead_m * lookahead_m)
    )
    east_m, north_m = ilos.east_m + growth_m * left_x, ilos.north_m + growth_m * left_y
    max_m, length_m = lookahead_m * portable.tan(math.radians(config.max_crab_deg)), math.hypot(east_m, north_m)
    if length_m > max_m:
        east_m, north_m = east_m * max_m / length_m, north_m * max_m / length_m
    return IlosState(east_m, north_m, now_us)


def hold_integral(ilos: IlosState, now_us: int) -> IlosState:
    """Keep the integral as it is; the time until now is not integrated later."""
    return IlosState(ilos.east_m, ilos.north_m, now_us)


def _left_normal(path: WaypointPath, target: int) -> tuple[float, float]:
    """Unit vector to the left of the leg, east and north."""
    start = leg_start(path, target)
    end = path.waypoints[target]
    leg_x_m, leg_y_m = end.x_m - start.x_m, end.y_m - start.y_m
    length_m = math.hypot(leg_x_m, leg_y_m)
    return -leg_y_m / length_m, leg_x_m / length_m
