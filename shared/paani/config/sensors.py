"""Devices of a real hull: GPS, IMU, heading, AIS, lidar and sonar, each on its own line or several on one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

import msgspec

from paani.config.section import NonNegative, Offset, Positive, Section
from paani.port_address import parse_address

Degrees = Annotated[float, msgspec.Meta(ge=-180.0, le=180.0)]
SPEED_MARK = "?speed="
FASTEST = "max"


class GpsConfig(Section, frozen=True):
    """`line`: `serial:/dev/ttyUSB0@9600`, `socket://HOST:PORT`, or a recorded log `file:PATH`.

    A log plays in real time, with `file:PATH?speed=4` four times as fast, with `file:PATH?speed=max` as fast as it can.
    """

    line: str = ""  # no receiver unless one is named: no two boats have the same ports
    # `auto` reads both, and takes the fixes of UBX where there are any, because they state their accuracy.
    protocol: Literal["nmea", "ubx", "auto"] = "auto"
    latency_s: NonNegative = 0.1  # from measurement to the last byte: 50 ms of computing and 40 ms at 38400 baud


class ImuConfig(Section, frozen=True):
    """`mount_*_deg`: how the sensor's axes (x forward, y left, z up) are turned against the boat's, yaw first."""

    line: str = ""  # no unit unless one is named
    mount_roll_deg: Degrees = 0.0  # flat on the deck
    mount_pitch_deg: Degrees = 0.0  # positive: its front is lower
    mount_yaw_deg: Degrees = 0.0  # its x ahead; positive: turned to port
    # North that a 9-axis unit's yaw refers to; `none`: its yaw is not used, as beside motors that disturb its compass.
    yaw: Literal["magnetic", "true", "none"] = "magnetic"


class HeadingConfig(Section, frozen=True):
    """A compass or a receiver with two antennas. Once it is set, the IMU's own yaw is not used."""

    line: str = ""  # none unless one is named; the same line as another device's is opened once
    offset_deg: Degrees = 0.0  # direction it points to on the boat, clockwise from ahead
    max_age_s: Positive = 1.5  # of a heading that the gyro carries on: the slowest compasses speak once a second


class AisConfig(Section, frozen=True):
    """A receiver of what vessels tell of themselves. It adds caution where the camera does not look."""

    line: str = ""  # none unless one is named; many receivers speak 38400 baud
    own_mmsi: Annotated[int, msgspec.Meta(ge=0, le=999_999_999)] = 0  # of a transponder on the boat itself; 0: none


class LidarConfig(Section, frozen=True):
    """A planar range scanner, above whatever stands on deck. It adds obstacles all round; the camera's stay."""

    line: str = ""  # none unless one is named; `serial:/dev/ttyUSB0@230400` of an LD06 or LD19, @921600 of an STL-27L
    offset_deg: Degrees = 0.0  # direction of the mark on its case, clockwise from ahead
    forward_m: Offset = 0.0  # ahead of the boat's middle
    near_m: NonNegative = 0.6  # nearer echoes are the boat's own: mast, aerials, half the beam
    max_range_m: Annotated[float, msgspec.Meta(ge=1.0, le=100.0)] = 12.0  # of an LD06 or LD19


class SonarConfig(Section, frozen=True):
    """An echo sounder under the hull. What it finds shallow becomes an obstacle; it frees no water."""

    line: str = ""  # none unless one is named; most sounders speak 4800 baud
    transducer_m: NonNegative = 0.19  # how deep it lies below the water's surface: the draught of the paper's boat


class SensorDevicesConfig(Section, frozen=True):
    """What is on the boat's lines. Nothing is published for a device that is not set."""

    gps: GpsConfig = GpsConfig()
    imu: ImuConfig = ImuConfig()
    heading: HeadingConfig = HeadingConfig()
    ais: AisConfig = AisConfig()
    lidar: LidarConfig = LidarConfig()
    sonar: SonarConfig = SonarConfig()
    # East positive; makes magnetic headings true. Unset: only headings that bring their own variation are used,
    # because a wrong one turns the boat.
    variation_deg: Degrees | None = None

    @property
    def lines(self) -> Mapping[str, str]:
        """The line of each device by its role, "" where none is named."""
        names = ("gps", "imu", "heading", "ais", "lidar", "sonar")
        return {name: getattr(self, name).line for name in names}

    def __post_init__(self) -> None:
        """Every line is one that can be opened."""
        for name, line in self.lines.items():
            try:
                require_line(line)
            except ValueError as error:
                raise ValueError(f"{name}.line: {error}") from error
        for name, line in self.lines.items():
            if line and name != "lidar" and line.partition("@")[0] == self.lidar.line.partition("@")[0]:
                raise ValueError(f"lidar.line: is also {name}.line; a range scanner shares its line with nothing")


def require_line(line: str) -> None:
    """Raises ValueError for a text that is no device line; empty is none, and in order."""
    if line.startswith("file:"):
        path, speed = recording_of(line)
        if not path or (speed is not None and not 1.0 <= speed <= 1000.0):
            raise ValueError(f"'{line}' is no recording (expected file:PATH, file:PATH?speed=4 or file:PATH?speed=max)")
    elif line:
        parse_address(line)


def recording_of(line: str) -> tuple[str, float | None]:
    """Path and speed of a recorded log: 1 is real time, None as fast as it can. A speed that is no number gives 0."""
    path, _, speed = line.removeprefix("file:").partition(SPEED_MARK)
    if speed == FASTEST:
        return path, None
    try:
        return path, float(speed) if speed else 1.0
    except ValueError:
        return path, 0.0
