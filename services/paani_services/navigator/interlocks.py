"""What the navigator has heard, and what about it forbids motion. Pure."""

import math

import msgspec

from paani.config import NavigatorConfig
from paani.map_origin import MapPlace, is_map_moved, map_place_of
from paani.messages import (
    Advisory,
    AisVessels,
    Arming,
    Depth,
    Direction,
    Evidence,
    Inhibit,
    Odometry,
    OperatorOrder,
    RangeScan,
    SimTime,
    Tracks,
)


class NavigatorInputs(msgspec.Struct, frozen=True):
    """The newest message of each kind, and when it was received [us]."""

    advisory: Advisory | None = None
    advisory_us: int = 0
    odometry: Odometry | None = None
    odometry_us: int = 0
    clock: SimTime | None = None
    clock_us: int = 0
    arming: Arming | None = None
    arming_us: int = 0
    evidence: Evidence | None = None
    tracks: Tracks | None = None
    order: OperatorOrder | None = None
    order_us: int = 0
    ais: AisVessels | None = None
    scan: RangeScan | None = None
    depth: Depth | None = None


def is_out_of_date(stamp_us: int, limit_s: float, now_us: int, config: NavigatorConfig) -> bool:
    """Whether a stamp is older than the limit, or of the future."""
    return not -config.max_future_s <= (now_us - stamp_us) * 1e-6 <= limit_s


def find_inhibits(
    inputs: NavigatorInputs,
    clock_advanced_us: int | None,
    map_place: MapPlace | None,
    now_us: int,
    domain: int,
    config: NavigatorConfig,
) -> list[Inhibit]:
    """Everything about the inputs that forbids motion (M8-M11).

    clock_advanced_us: when simulated time last moved forward; None before it did. map_place: by which the map is known
    in which mission and fence lie; where localization has begun another, they lie elsewhere on Earth.
    """

    def is_old(limit_s: float, *stamps_us: int) -> bool:
        return any(is_out_of_date(each, limit_s, now_us, config) for each in stamps_us)

    found: list[Inhibit] = []
    advisory, odometry, clock, arming = inputs.advisory, inputs.odometry, inputs.clock, inputs.arming
    messages = (advisory, odometry, clock, arming, inputs.evidence)
    if any(message is not None and message.domain != domain for message in messages):
        found.append(Inhibit.WRONG_DOMAIN)
    if (
        arming is None
        or not arming.armed
        or arming.stopped
        or is_old(config.arming_max_age_s, inputs.arming_us, arming.source_us)
    ):
        found.append(Inhibit.NOT_ARMED)
    if clock is None or is_old(config.clock_max_age_s, inputs.clock_us):
        found.append(Inhibit.NO_CLOCK)
    elif not clock.running or clock_advanced_us is None or is_old(config.clock_max_age_s, clock_advanced_us):
        found.append(Inhibit.CLOCK_STOPPED)
    if odometry is None:
        found.append(Inhibit.NO_ODOMETRY)
    else:
        if is_old(config.odometry_max_age_s, inputs.odometry_us, odometry.source_us):
            found.append(Inhibit.STALE_ODOMETRY)
        numbers = (odometry.x_m, odometry.y_m, odometry.yaw_rad)
        if not odometry.healthy or not all(map(math.isfinite, numbers)):
            found.append(Inhibit.UNHEALTHY_ODOMETRY)
        if is_map_moved(map_place, map_place_of(odometry)):
            found.append(Inhibit.MAP_MOVED)
    if advisory is None:
        found.append(Inhibit.NO_ADVISORY)
    else:
        is_received_late = is_old(config.advisory_max_receipt_s, inputs.advisory_us)
        if is_received_late or is_old(config.advisory_max_age_s, advisory.source_us):
            found.append(Inhibit.STALE_ADVISORY)
        if advisory.direction is Direction.STOP:
            found.append(Inhibit.ADVISED_STOP)
        elif advisory.direction is Direction.NO_DATA:
            found.append(Inhibit.ADVISED_NO_DATA)
    return found
