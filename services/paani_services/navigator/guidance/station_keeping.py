"""A boat that the advice stops, or that has no path, is kept where it stopped, against wind and current. Pure."""

import math
from typing import NamedTuple

import msgspec

from paani import portable
from paani.clock import has_passed
from paani.config import NavigatorConfig
from paani.geometry import clip, wrap_rad
from paani.messages import STATION_ASTERN_MPS, Advisory, Inhibit, Odometry

LEAD_S = 2.0  # the bow is turned to where the boat will be then, which is sooner than it can have turned
AT_STATION_M = 0.12  # nearer the bow stays where it is: the velocity's noise times `LEAD_S`, twice
RETURN_PER_S = 0.2  # astern speed for each metre away from the station
RESUME_S = 5.0  # in which a boat at the least planned speed, 0.06 m/s, does not turn away from what it stopped for
LOST_M = 1.5  # farther off, the boat has made way; 0.3 m/s of current carry it as far while its bow comes round


class Station(msgspec.Struct, frozen=True):
    """A place by dead reckoning, in metres with the map's axes; since when and when last the water stopped the boat.

    turn_rad: the heading in the map, out of the picture, to which the boat was turning when it stopped; None once it is
    on it.
    """

    since_us: int
    stopped_us: int
    x_m: float
    y_m: float
    turn_rad: float | None = None


class StationSetpoint(NamedTuple):
    """heading_rad in the map; astern_mps in [0, STATION_ASTERN_MPS]."""

    heading_rad: float
    astern_mps: float


def may_keep_station(inhibits: list[Inhibit], advisory: Advisory | None, *, is_nobody_near: bool) -> bool:
    """Whether thrust may hold the boat where it is: the advice alone stops it and allows that, or the planner alone.

    is_nobody_near: as far as the planner remembers. The advice tells of those whom the picture shows.
    """
    if inhibits == [Inhibit.NO_FREE_PATH]:
        return is_nobody_near
    return inhibits == [Inhibit.ADVISED_STOP] and advisory is not None and advisory.may_keep_station is True


def take_station(station: Station | None, here_m: tuple[float, float], now_us: int, config: NavigatorConfig) -> Station:
    """The place that is kept: where the boat was once it had braked.

    A boat that stops again within `RESUME_S` and `LOST_M` has made no way: it goes back to where it stopped before.
    """
    if (
        station is None
        or has_passed(station.stopped_us, RESUME_S * 1e6, now_us)
        or math.dist((station.x_m, station.y_m), here_m) > LOST_M
    ):
        return Station(now_us, now_us, *here_m)
    if not has_passed(station.since_us, config.planner.brake_s * 1e6, now_us):
        return Station(station.since_us, now_us, *here_m)
    return msgspec.structs.replace(station, stopped_us=now_us)


def hold_station(station: Station, here_m: tuple[float, float], odometry: Odometry) -> StationSetpoint:
    """The bow turns to where the boat is carried, looks there, and the boat goes back astern to its station.

    A turn that the stop interrupted is finished first, on the spot: the stop is for what the picture shows, and where
    the boat turns to lies out of it. A boat that turned back instead would never see there.

    Fans work along the hull alone: a drift abeam ends only with the bow towards it. Nothing leads the boat ahead. It
    goes astern the slower the more its station lies to a side, and not at all from 45 degrees on: astern it crosses
    nothing but the water over which it has come.
    """
    cos, sin = portable.cos(odometry.yaw_rad), portable.sin(odometry.yaw_rad)
    off_x_m, off_y_m = here_m[0] - station.x_m, here_m[1] - station.y_m
    soon_x_m = off_x_m + LEAD_S * (odometry.surge_mps * cos - odometry.sway_mps * sin)
    soon_y_m = off_y_m + LEAD_S * (odometry.surge_mps * sin + odometry.sway_mps * cos)
    heading_rad = odometry.yaw_rad
    if station.turn_rad is not None:
        heading_rad = station.turn_rad
    elif math.hypot(soon_x_m, soon_y_m) > AT_STATION_M and not odometry.stopped:
        heading_rad = wrap_rad(portable.atan2(soon_y_m, soon_x_m))
    astern_m, aside_m = off_x_m * cos + off_y_m * sin, abs(off_y_m * cos - off_x_m * sin)
    return StationSetpoint(heading_rad, clip(RETURN_PER_S * (astern_m - aside_m), 0.0, STATION_ASTERN_MPS))
