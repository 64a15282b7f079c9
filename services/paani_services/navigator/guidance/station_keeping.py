"""A boat that the advice stops is kept where it is, against wind and current. Pure."""

import math

from paani.geometry import wrap_rad
from paani.messages import Advisory, Inhibit, Odometry


def may_keep_station(inhibits: list[Inhibit], advisory: Advisory | None) -> bool:
    """Whether nothing but the advice forbids motion, and the advice allows thrust that holds the boat where it is."""
    return inhibits == [Inhibit.ADVISED_STOP] and advisory is not None and advisory.may_keep_station is True


def drift_heading_rad(odometry: Odometry) -> float:
    """The heading of a boat that keeps its station: that of its drift, so that it looks there and brakes.

    At rest it is the boat's own. Fans work along the hull alone: a drift abeam ends only with the bow towards it.
    """
    if odometry.stopped:
        return odometry.yaw_rad
    return wrap_rad(odometry.yaw_rad + math.atan2(odometry.sway_mps, odometry.surge_mps))
