"""The devices of a real hull, as the sensor process finds them."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from paani.messages.header import Count, Message, NonNegative, Text


class SensorRole(StrEnum):
    """What a device is for."""

    GPS = "gps"
    IMU = "imu"
    HEADING = "heading"
    AIS = "ais"
    LIDAR = "lidar"
    SONAR = "sonar"


class SensorStatus(StrEnum):
    """What a device does. Its data are published while it is OK or has NO_FIX, and withheld otherwise.

    OFF: no line is set. ABSENT: it cannot be opened, or is gone. SILENT: open, but no bytes come. UNREADABLE: bytes
    come that are no frame of its protocol. INCOMPLETE: frames come, but none with what it is for. FROZEN: it repeats
    itself although the boat moves or time goes on. IMPLAUSIBLE: an inertial unit without gravity. NO_FIX: a receiver
    without a position.
    """

    OFF = "off"
    ABSENT = "absent"
    SILENT = "silent"
    UNREADABLE = "unreadable"
    INCOMPLETE = "incomplete"
    FROZEN = "frozen"
    IMPLAUSIBLE = "implausible"
    NO_FIX = "no_fix"
    OK = "ok"


class SensorDevice(msgspec.Struct, frozen=True, kw_only=True):
    """One device. `rate_hz` and `age_s` are those of usable data; all counts are since the process began.

    `frames`: intact sentences and messages; `heard`: their kinds. `checksum_failures`: frames whose checksum did not
    fit; `damaged`: other frames that could not be read. `withheld`: data of a frozen or implausible device.
    `reconnections`: how often the line was opened again. `note` says what is wrong, and what to do.
    """

    role: SensorRole
    line: Text
    status: SensorStatus
    note: Text = ""
    rate_hz: NonNegative = 0.0
    age_s: NonNegative = 0.0
    bytes: Count = 0
    frames: Count = 0
    heard: Text = ""
    checksum_failures: Count = 0
    damaged: Count = 0
    withheld: Count = 0
    reconnections: Count = 0


class SensorsState(Message, frozen=True, kw_only=True):
    """Every device of the sensor process."""

    devices: tuple[SensorDevice, ...] = ()
