"""Orders, route, estimates and the operator's word."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from paani.messages.advisor import Direction
from paani.messages.header import Count, Finite, Message, NonNegative, Signed, Stamp, Text


class Inhibit(StrEnum):
    """Why the boat is not ordered to move. An order that moves has none."""

    NOT_ARMED = "NOT_ARMED"
    NO_CLOCK = "NO_CLOCK"
    CLOCK_STOPPED = "CLOCK_STOPPED"
    NO_ODOMETRY = "NO_ODOMETRY"
    STALE_ODOMETRY = "STALE_ODOMETRY"
    UNHEALTHY_ODOMETRY = "UNHEALTHY_ODOMETRY"
    NO_ADVISORY = "NO_ADVISORY"
    STALE_ADVISORY = "STALE_ADVISORY"
    ADVISED_STOP = "ADVISED_STOP"
    ADVISED_NO_DATA = "ADVISED_NO_DATA"
    TURN_CAPPED = "TURN_CAPPED"
    NO_ROUTE = "NO_ROUTE"
    ROUTE_FINISHED = "ROUTE_FINISHED"
    NO_FREE_PATH = "NO_FREE_PATH"
    HOLDING = "HOLDING"
    MISSION_DONE = "MISSION_DONE"
    OUTSIDE_FENCE = "OUTSIDE_FENCE"
    WRONG_DOMAIN = "WRONG_DOMAIN"
    NO_COMMAND = "NO_COMMAND"
    STALE_COMMAND = "STALE_COMMAND"
    COMMAND_INVALID = "COMMAND_INVALID"


class NavCommand(Message, frozen=True, kw_only=True):
    """Atomic order to the controller: heading, speed, enable, frame, validity together (B11).

    `echo_us` is the newest plant stamp the navigator had heard: the plant judges age on its own clock.
    """

    enable: bool
    heading_rad: Finite
    speed_mps: NonNegative
    frame: Text = "map"
    echo_us: Stamp = 0
    inhibits: tuple[Inhibit, ...] = ()
    direction: Direction = Direction.NO_DATA
    waypoint_index: Count = 0
    waypoints_reached: Count = 0
    cross_track_m: Finite = 0.0
    advisory_sent_us: Stamp = 0
    leg_index: Count = 0
    leg: Text = ""

    def is_news_after(self, sent: NavCommand | None) -> bool:
        """New evidence, other advice or another gate goes out at once; the rest waits for the period."""
        if sent is None:
            return True
        return (self.source_us, self.direction, self.inhibits) != (sent.source_us, sent.direction, sent.inhibits)


class Waypoint(msgspec.Struct, frozen=True, kw_only=True):
    x_m: Finite
    y_m: Finite


class Route(Message, frozen=True, kw_only=True):
    """The route being followed, in the map frame; republished so that late joiners have it."""

    name: Text
    waypoints: tuple[Waypoint, ...]
    repeat: bool = True


class Thrust(Message, frozen=True, kw_only=True):
    """Normalised differential thrust, negative: astern (B12); not so where `controller.astern` is 0 (N7)."""

    left: Signed
    right: Signed
    enabled: bool
    echo_us: Stamp = 0
    inhibits: tuple[Inhibit, ...] = ()
    speed_error_mps: Finite = 0.0
    heading_error_rad: Finite = 0.0
    command_sent_us: Stamp = 0


class Arming(Message, frozen=True, kw_only=True):
    """The operator's word. `stopped` latches until the operator arms again."""

    armed: bool
    stopped: bool = False


class Odometry(Message, frozen=True, kw_only=True):
    """Estimated pose and body velocities; an estimate, never simulator truth (L4).

    nis: squared Mahalanobis distance of the newest GPS position from the expected one, 2 on average if the stated
    spread is right; 0: none yet. refused_fixes: how many lay too far off to be used, since the estimate began.
    """

    x_m: Finite
    y_m: Finite
    yaw_rad: Finite
    surge_mps: Finite
    sway_mps: Finite = 0.0
    yaw_rate_radps: Finite = 0.0
    position_std_m: NonNegative = 0.0
    yaw_std_rad: NonNegative = 0.0
    healthy: bool = False
    stopped: bool = False
    latitude_deg: Finite = 0.0
    longitude_deg: Finite = 0.0
    roll_rad: Finite = 0.0
    pitch_rad: Finite = 0.0
    nis: NonNegative = 0.0
    refused_fixes: Count = 0
