"""The plant (a simulated or a real boat): clock, sensors, applied thrust, and the simulator's truth."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import msgspec

from paani.messages.header import Count, Finite, Message, NonNegative, Signed, Stamp, Text


class SimTime(Message, frozen=True, kw_only=True):
    """The plant's clock.

    `sim_us` advances only while the simulation runs. `stamp_us` is the plant's own clock; orders and thrust echo it.
    """

    sim_us: Stamp
    stamp_us: Stamp
    running: bool = True


class GpsFix(Message, frozen=True, kw_only=True):
    """A fix of the GPS receiver: position, speed and course over ground (`cog_rad` counter-clockwise from east).

    `position_std_m`: standard deviation per axis that the receiver states. `fix` false: the receiver has no position.
    """

    latitude_deg: Annotated[float, msgspec.Meta(ge=-90.0, le=90.0)]
    longitude_deg: Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)]
    sog_mps: NonNegative
    cog_rad: Finite
    position_std_m: NonNegative
    fix: bool = True


class ImuSample(Message, frozen=True, kw_only=True):
    """Angular rates and specific force along the body's axes (at rest +9.81 on z), and orientation.

    `orientation_available` false: the IMU gives no yaw, as one without a compass (A12).
    """

    gyro_x_radps: Finite
    gyro_y_radps: Finite
    gyro_z_radps: Finite
    accel_x_mps2: Finite
    accel_y_mps2: Finite
    accel_z_mps2: Finite
    orientation_available: bool = False
    roll_rad: Finite = 0.0
    pitch_rad: Finite = 0.0
    yaw_rad: Finite = 0.0


class ZeroCause(StrEnum):
    """Why the thrust adapter applies zero; NONE while it applies the thrust that it was sent.

    The last seven are a hull's: LINE_LOST is that the microcontroller or autopilot does not answer, REFUSED that it
    takes no thrust; the others are what holds the thrusters on the microcontroller itself. REARM: it waits for the
    operator to disarm, and to arm again.
    """

    NONE = "none"
    NO_COMMAND = "no_command"
    TIMEOUT = "timeout"
    NOT_ENABLED = "not_enabled"
    NOT_ARMED = "not_armed"
    ARMING_LOST = "arming_lost"
    PULSE_LOST = "pulse_lost"
    STALE_ECHO = "stale_echo"
    WRONG_PRODUCER = "wrong_producer"
    WRONG_DOMAIN = "wrong_domain"
    OLD_EPOCH = "old_epoch"
    REPLAYED = "replayed"
    FUTURE = "future"
    INVALID = "invalid"
    LINE_LOST = "line_lost"
    REFUSED = "refused"
    EMERGENCY_STOP = "emergency_stop"
    RECEIVER = "receiver"
    BATTERY_LOW = "battery_low"
    OVER_CURRENT = "over_current"
    REARM = "rearm"


class ThrustApplied(Message, frozen=True, kw_only=True):
    """What the thrust adapter, the last decision before force, applies now, and why where it applies zero.

    `left` and `right`: normalised, negative astern; `left_n` and `right_n`: the same in newtons. `command_seq`,
    `command_sent_us` and `command_source_us` are those of the newest thrust message accepted. `rejected`: thrust
    messages refused so far. `lost_pulse`: the process whose pulse is missing. `since_us`: since when the present
    command, or zero for a cause, is applied. `zero_since_us`: since when no fan has thrust, commanded or for whatever
    cause; 0 while one has.
    """

    left: Signed
    right: Signed
    left_n: Finite
    right_n: Finite
    zero_cause: ZeroCause
    command_seq: Count = 0
    command_sent_us: Stamp = 0
    command_source_us: Stamp = 0
    rejected: Count = 0
    lost_pulse: Text = ""
    since_us: Stamp = 0
    zero_since_us: Stamp = 0


class TruePose(Message, frozen=True, kw_only=True):
    """The simulator's truth, under the verbatim `@truth` chunk: for the eye, the dashboard and scoring only.

    `distance_m`: way made so far. `collisions`: contacts so far; `in_contact`: one is going on. `actors_along_m`: how
    far along its path each moving thing is, in the order of the world; empty: as far as the time says.
    """

    sim_us: Stamp
    x_m: Finite
    y_m: Finite
    z_m: Finite
    roll_rad: Finite
    pitch_rad: Finite
    yaw_rad: Finite
    surge_mps: Finite
    sway_mps: Finite
    yaw_rate_radps: Finite
    distance_m: NonNegative = 0.0
    collisions: Count = 0
    in_contact: bool = False
    actors_along_m: tuple[Finite, ...] = ()
