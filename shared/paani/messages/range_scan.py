"""What a planar range scanner measures around the boat, by the conventions of ROS `sensor_msgs/LaserScan`."""

from __future__ import annotations

import math
from typing import Annotated

import msgspec

from paani.messages.header import Finite, Message

MAX_BEAMS = 1440  # a quarter of a degree all round, finer than what a boat can use
MAX_RANGE_M = 655.0  # centimetres in 16 bits

Range = Annotated[float, msgspec.Meta(ge=0.0, le=MAX_RANGE_M)]
Bearing = Annotated[float, msgspec.Meta(ge=-2.0 * math.pi, le=2.0 * math.pi)]


class RangeScan(Message, frozen=True, kw_only=True):
    """One turn of the scanner, at a place of the boat; bearings are counter-clockwise from ahead.

    Beam k looks to `first_bearing_rad` + k x `step_rad` and met something `ranges_m[k]` away; 0: nothing within
    `max_range_m`, or nothing that is known. `forward_m`: where the scanner is, ahead of the boat's middle. Echoes of
    the boat itself are left out.
    """

    ranges_m: Annotated[tuple[Range, ...], msgspec.Meta(min_length=1, max_length=MAX_BEAMS)]
    first_bearing_rad: Bearing
    step_rad: Annotated[float, msgspec.Meta(gt=0.0, le=math.pi / 6.0)]
    max_range_m: Annotated[float, msgspec.Meta(gt=0.0, le=MAX_RANGE_M)]
    forward_m: Finite = 0.0
