"""The parameters of an ArduPilot Rover: what they must be before it is armed, and what they say of its sticks. Pure."""

from __future__ import annotations

import math
from typing import NamedTuple

from paani_services.thrusters.autopilot_sticks import Channel, StickMixer

TOLERANCE = 1e-3
IGNORES_OVERRIDES = 2  # of RC_OPTIONS: sticks from a line count for nothing
STEERING, THROTTLE = "RCMAP_ROLL", "RCMAP_THROTTLE"
THROTTLE_MOST = "MOT_THR_MAX"
CHANNEL_FIELDS = ("MIN", "MAX", "TRIM", "DZ", "REVERSED")
CHANNELS = 16
SIDES = {73: "left", 74: "right"}  # SERVOn_FUNCTION of a motor on that side
OUTPUTS = tuple(f"SERVO{number}_FUNCTION" for number in range(1, 17))
ASKED_AT_ONCE = 16  # the autopilot keeps twenty questions and drops the rest


class Requirement(NamedTuple):
    """A parameter of the autopilot that must read `value`; of several names the autopilot knows one."""

    names: tuple[str, ...]
    value: float


def required_parameters(own_system: int) -> tuple[Requirement, ...]:
    """What makes the autopilot let go of the motors when this process, or its line, is gone.

    And what makes it mix the sticks as `StickMixer` does: its mixer (AP_MotorsUGV) adds and subtracts the two.
    """
    return (
        Requirement(("SYSID_MYGCS", "MAV_GCS_SYSID"), own_system),  # whose sticks and heartbeat count
        Requirement(("RC_OVERRIDE_TIME",), 0.5),  # sticks not renewed for so long are let go, in seconds
        Requirement(("FS_THR_ENABLE",), 1),  # without sticks and receiver: no thrust, and the action
        Requirement(("FS_GCS_ENABLE",), 1),  # without our heartbeat: the action
        Requirement(("FS_GCS_TIMEOUT",), 2),  # seconds, the least of its range
        Requirement(("FS_TIMEOUT",), 1),  # seconds from a loss to the action, the least of its range
        Requirement(("FS_ACTION",), 2),  # HOLD: no thrust
        Requirement(("PILOT_STEER_TYPE",), 3),  # the sticks are ahead and starboard, and not the two sides
        Requirement(("MANUAL_STR_EXPO",), 0),  # the stick to starboard counts as it is
        Requirement(("MOT_SLEWRATE",), 0),  # thrust ahead follows at once, above all to zero, as steering does
        Requirement(("MOT_THR_MIN",), 0),  # nothing is added to what the thrust adapter decided
    )


class Write(NamedTuple):
    """A parameter that reads otherwise than required."""

    name: str
    value: float


class ParameterTable:
    """What was read since `clear`."""

    def __init__(self, own_system: int) -> None:
        self._requirements = required_parameters(own_system)
        self._read: dict[str, float] = {}

    def clear(self) -> None:
        """Know nothing any more."""
        self._read.clear()

    def receive(self, name: str, value: float) -> None:
        """Take a parameter that was read."""
        self._read[name] = value

    def due(self) -> tuple[list[Write], list[str]]:
        """What to write, and what to read then; both empty once all is known and as required."""
        writes = [
            Write(name, requirement.value)
            for requirement in self._requirements
            for name in self._known(requirement.names)
            if not _is_near(self._read[name], requirement.value)
        ]
        unknown = [
            name
            for requirement in self._requirements
            if not self._known(requirement.names)
            for name in requirement.names
        ]
        unknown += [name for name in self._names_of_sticks() if name not in self._read]
        if self._side_without_motor():
            unknown += [name for name in OUTPUTS if name not in self._read]
        return writes, [*(write.name for write in writes), *unknown[:ASKED_AT_ONCE]]

    def problem(self) -> str:
        """The first parameter that is not known to be as required, or by which no stick can be meant."""
        for requirement in self._requirements:
            name = next(iter(self._known(requirement.names)), requirement.names[0])
            value = self._read.get(name)
            if value is None or not _is_near(value, requirement.value):
                read = "is not answered" if value is None else f"reads {value:g}"
                return f"parameter {name} {read}, expected {requirement.value:g}"
        for name in self._names_of_sticks():
            if name not in self._read:
                return f"parameter {name} is not answered"
            if not math.isfinite(self._read[name]):
                return f"parameter {name} reads {self._read[name]:g}"
        if int(self._read["RC_OPTIONS"]) & IGNORES_OVERRIDES:
            return f"parameter RC_OPTIONS reads {self._read['RC_OPTIONS']:g}: the autopilot ignores our sticks"
        if not 0 < self._read[THROTTLE_MOST] <= 100:  # percent
            return f"parameter {THROTTLE_MOST} reads {self._read[THROTTLE_MOST]:g}, expected 1 to 100"
        for mapping in (THROTTLE, STEERING):
            if not self._is_channel(mapping):
                return f"parameter {mapping} reads {self._read[mapping]:g}, expected 1 to {CHANNELS}"
            if problem := self._channel(mapping).problem:
                return f"parameters {self._prefix(mapping)}MIN, TRIM, MAX and DZ: {problem}"
        if self._read[THROTTLE] == self._read[STEERING]:
            return f"parameters {THROTTLE} and {STEERING} read the same, {self._read[THROTTLE]:g}"
        return self._side_without_motor()

    def mixer(self) -> StickMixer:
        """Of the sticks as they were read; only while there is no problem."""
        return StickMixer(self._channel(THROTTLE), self._channel(STEERING), self._read[THROTTLE_MOST] / 100)

    def _known(self, names: tuple[str, ...]) -> list[str]:
        return [name for name in names if name in self._read]

    def _names_of_sticks(self) -> list[str]:
        names = ["RC_OPTIONS", THROTTLE_MOST, THROTTLE, STEERING]
        for mapping in (THROTTLE, STEERING):
            if self._is_channel(mapping):
                names += [self._prefix(mapping) + field for field in CHANNEL_FIELDS]
        return names

    def _side_without_motor(self) -> str:
        """What lacks for two sides; where the autopilot turns by a rudder, both."""
        found = {self._read[name] for name in OUTPUTS if name in self._read}
        lacking = [f"{number}, thrust of the {side} side" for number, side in SIDES.items() if number not in found]
        return f"parameters {OUTPUTS[0]} to {OUTPUTS[-1]}: none reads {lacking[0]}" if lacking else ""

    def _is_channel(self, mapping: str) -> bool:
        return self._read.get(mapping, 0.0) in range(1, CHANNELS + 1)

    def _prefix(self, mapping: str) -> str:
        return f"RC{int(self._read[mapping])}_"

    def _channel(self, mapping: str) -> Channel:
        least, most, rest, dead_zone, is_reversed = (
            self._read[self._prefix(mapping) + field] for field in CHANNEL_FIELDS
        )
        return Channel(int(least), int(most), int(rest), int(dead_zone), is_reversed != 0)


def _is_near(value: float, required: float) -> bool:
    return abs(value - required) <= TOLERANCE
