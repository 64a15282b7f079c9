"""What guides the boat: the order, the route, the thrust, the operator's arming, and the estimate of the pose."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from paani.messages.advisor import Direction
from paani.messages.header import Count, Finite, Message, NonNegative, Signed, Stamp, Text


class Inhibit(StrEnum):
    """Why the boat may not move. An order that moves the boat has none."""

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
    MAP_MOVED = "MAP_MOVED"
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
    NO_ORDER = "NO_ORDER"
    STALE_ORDER = "STALE_ORDER"
    IDLE = "IDLE"
    NEUTRAL = "NEUTRAL"
    BLOCKED_AHEAD = "BLOCKED_AHEAD"


STATION_ASTERN_MPS = 0.2  # most of a boat that goes back to its station: two thirds of an advised turn's speed


class NavCommand(Message, frozen=True, kw_only=True):
    """Atomic order to the controller: heading, speed, enable, frame and the reasons not to move, together (B11).

    `heading_rad` and `speed_mps` count in `frame`; both are 0 unless `enable` is true. `inhibits`: every reason not to
    move. `echo_us`: the newest stamp of the plant's clock that the navigator had, so that the plant can judge the
    order's age on its own clock. `direction` and `advisory_sent_us` are those of the advisory that was followed.
    `waypoint_index`: the waypoint steered for. `waypoints_reached`: of all legs since the start. `cross_track_m`:
    distance from the line of the leg, positive to its left. `leg_index`: the leg of the mission that is due; `leg`:
    the same in words.
    `obstacle_track_ids`: the advisor's tracks of the dynamic obstacles that the plan in force was made for.
    `astern_mps`: the speed astern that a hand asks for, only where `speed_mps` is 0. `vetoes`: why a hand gets no
    thrust ahead, while it may turn and go astern. `keeps_station`: the advice stops the boat, or it has no path, which
    `vetoes` names, and it is held where it stopped: `speed_mps` is 0, `astern_mps` at most `STATION_ASTERN_MPS`, back
    to the place from which it was carried, and the heading is where it is carried to.
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
    obstacle_track_ids: tuple[Count, ...] = ()
    astern_mps: NonNegative = 0.0
    vetoes: tuple[Inhibit, ...] = ()
    keeps_station: bool = False

    @property
    def halt_reasons(self) -> tuple[Inhibit, ...]:
        """Why the boat is to stand still, with thrust or without; empty for one that is to move."""
        return self.vetoes if self.keeps_station else self.inhibits

    def is_news_after(self, sent: NavCommand | None) -> bool:
        """Whether evidence, advice or inhibits differ from those of the order sent before: then it is sent at once."""
        if sent is None:
            return True
        return self._news() != sent._news()

    def _news(self) -> tuple[object, ...]:
        return self.source_us, self.direction, self.inhibits, self.keeps_station


class Waypoint(msgspec.Struct, frozen=True, kw_only=True):
    """A point of the map: metres east (`x_m`) and north (`y_m`) of its origin."""

    x_m: Finite
    y_m: Finite


class Route(Message, frozen=True, kw_only=True):
    """The route that is followed, in the map frame; published again and again for processes that start late.

    `repeat`: the last waypoint leads back to the first.
    """

    name: Text
    waypoints: tuple[Waypoint, ...]
    repeat: bool = True


class Thrust(Message, frozen=True, kw_only=True):
    """Normalised thrust of the two fans, negative astern (B12); never astern where `controller.astern` is 0 (N7).

    `enabled` false: zero thrust for the reasons in `inhibits`. `echo_us`, from the order, is the newest stamp of the
    plant's clock that the navigator had. `command_sent_us` is when that order was sent.
    `heading_error_rad`: of the turn that is made, so beyond pi where it goes the longer way (`controller.turn_on_deg`).
    """

    left: Signed
    right: Signed
    enabled: bool
    echo_us: Stamp = 0
    inhibits: tuple[Inhibit, ...] = ()
    speed_error_mps: Finite = 0.0
    heading_error_rad: Finite = 0.0
    command_sent_us: Stamp = 0


class Arming(Message, frozen=True, kw_only=True):
    """Whether the operator has armed the boat. `stopped`: a stop was pressed; held until the boat is armed again.

    `mode_ordered`: an `OperatorOrder` says what for; a boat that has not heard it does not move.
    """

    armed: bool
    stopped: bool = False
    mode_ordered: bool = False


class Odometry(Message, frozen=True, kw_only=True):
    """Estimated pose in the map and velocities along the body's axes; an estimate, never the simulator's truth (L4).

    `healthy` false: the boat may not be guided by it. `stopped`: slow for `localization.stopped_after_s` (L5).
    `nis`: normalised innovation squared of the newest fix, 2 on average if the stated standard deviation is right; 0
    before the first. `refused_fixes`: fixes outside the validation gate since the estimate began.
    `position_std_m`: root mean square of both half axes of the position's error ellipse; `position_major_std_m`: the
    longer one, `position_major_rad`: its direction; 0 where only the mean is known.
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
    position_major_std_m: NonNegative = 0.0
    position_major_rad: Finite = 0.0
