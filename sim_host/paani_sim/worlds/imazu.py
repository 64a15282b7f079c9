"""The Imazu problem: 22 encounters with one to three vessels on a collision course, on open water, scaled to the boat.

From table 4 of Sawada, Sato, Majima: "Automatic ship collision avoidance using deep reinforcement learning with LSTM in
continuous action spaces", J. Mar. Sci. Technol. 26 (2021), doi 10.1007/s00773-020-00755-0: every vessel reaches the
same point at the same time as the own ship, if nobody manoeuvres. There the own ship runs 30 min at 12 kn to it. Here
it is 40 s at 0.6 m/s, in proportion to the runs of a model ship of 1.255 m (80 s at 0.68 m/s). Nobody gives way.

On a collision course the bearing is constant: a vessel that is outside the lens at the start never comes into it unless
the boat turns. In the camera-fair form every vessel is so slow (0.43 of the boat's speed) that it comes from within 26
degrees of the bow.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from paani_sim.worlds.curves import circle
from paani_sim.worlds.encounter_paths import NOMINAL_BOAT_MPS
from paani_sim.worlds.route_frame import start_pose
from paani_sim.worlds.scenario import Scenario, Task
from paani_sim.worlds.sizes import SIZES
from paani_sim.worlds.world import Actor, Light, Waves, Wind, World

TCPA_S = 40.0
RUN_M = NOMINAL_BOAT_MPS * TCPA_S  # of the own ship to the closest point of approach
FAIR_SPEED_RATIO = 0.43  # of every vessel in the camera-fair form; 18.52 / 43.3 in the cases of Klins101/CORALL
# From the first step of a drive to the beginning of a run at full speed that would arrive with the boat [s]: measured
# on a blind drive with nobody there, in which the boat is armed after 2.2 s.
DEPARTURE_S = 2.2
ROUTE_LENGTH_M = 2.0 * RUN_M
OVERRUN_M = 140.0  # of a vessel beyond the closest point, more than it sails within the time limit
BASIN_RADIUS_M, SHORE_POINTS = 185.0, 96
TARGET_LOOK = "dinghy"
PREFIX, FAIR_PREFIX = "imazu-", "imazu-fair-"


class TargetCode(NamedTuple):
    """Course relative to the own ship's, clockwise [deg], and speed over the own ship's."""

    course_deg: float
    speed_ratio: float


CODES = {
    "H": TargetCode(180.0, 1.0),
    "F": TargetCode(225.0, 1.0),
    "A": TargetCode(270.0, 1.0),
    "a": TargetCode(90.0, 1.0),
    "S": TargetCode(0.0, 0.7),
    "s": TargetCode(45.0, 0.7),
    "B": TargetCode(315.0, 1.0),
    "b": TargetCode(45.0, 1.0),
    "C": TargetCode(330.0, 1.0),
    "D": TargetCode(345.0, 1.0),
    "d": TargetCode(15.0, 1.0),
    "E": TargetCode(350.0, 1.0),
    "e": TargetCode(10.0, 1.0),
}
# The copies of the table differ in two cases: 8 is "H A", as 5 is, or "H a"; 12 is with or without the vessel ahead.
CASES = {
    "01": "H", "02": "A", "03": "S", "04": "b", "05": "HA", "06": "EB", "07": "SB", "08": "HA", "08b": "Ha",
    "09": "CA", "10": "Ad", "11": "aC", "12": "HBE", "12b": "BE", "13": "Heb", "14": "EBA", "15": "SBA", "16": "saA",
    "17": "SeB", "18": "FDC", "19": "dDF", "20": "SDA", "21": "DdA", "22": "SBA",
}  # fmt: skip
IMAZU_SCENARIOS = tuple(prefix + case for prefix in (PREFIX, FAIR_PREFIX) for case in CASES)


class RelativeStart(NamedTuple):
    """Where a vessel starts, seen from the own ship: ahead and to starboard [m]."""

    ahead_m: float
    starboard_m: float

    @property
    def bearing_deg(self) -> float:
        """Off the bow, clockwise, (-180, 180]."""
        return math.degrees(math.atan2(self.starboard_m, self.ahead_m))


def speed_ratio(name: str, code: str) -> float:
    """Of a vessel in this scenario, over the own ship's speed."""
    return FAIR_SPEED_RATIO if is_fair(name) else CODES[code].speed_ratio


def relative_start(name: str, code: str) -> RelativeStart:
    """Where the vessel is when the own ship has `RUN_M` to go to the closest point."""
    course_rad, ratio = math.radians(CODES[code].course_deg), speed_ratio(name, code)
    return RelativeStart(RUN_M * (1.0 - ratio * math.cos(course_rad)), -RUN_M * ratio * math.sin(course_rad))


def is_fair(name: str) -> bool:
    """Whether this is a case in the camera-fair form."""
    return name.startswith(FAIR_PREFIX)


def case_codes(name: str) -> str:
    """The vessels of a scenario, a letter each."""
    return CASES[name.removeprefix(FAIR_PREFIX).removeprefix(PREFIX)]


def count_seen(name: str, hfov_deg: float) -> int:
    """How many of its vessels are within the lens at the start."""
    return sum(abs(relative_start(name, code).bearing_deg) <= 0.5 * hfov_deg for code in case_codes(name))


def build_imazu_scenario(name: str) -> Scenario:
    """The scenario of that name, of `IMAZU_SCENARIOS`. The boat starts at the origin and heads east, in no wind."""
    route_m = np.array([[along_m, 0.0] for along_m in np.linspace(0.0, ROUTE_LENGTH_M, 8)])
    world = World(
        name="open_water",
        seed=1,
        origin_lat_deg=47.6512,
        origin_lon_deg=9.4794,
        shore_m=circle((RUN_M, 0.0), BASIN_RADIUS_M, SHORE_POINTS),
        route_m=route_m,
        start=start_pose(route_m),
        obstacles=(),
        actors=tuple(_build_target(name, number, code) for number, code in enumerate(case_codes(name))),
        wind=Wind(speed_mps=0.0),
        light=Light(sky="cloudy", sun_azimuth_rad=2.2, sun_elevation_rad=0.7),
        waves=Waves(0.0),
        route_closed=False,
    )
    return Scenario(name, world, task=Task(0.0, 3.0 * ROUTE_LENGTH_M / NOMINAL_BOAT_MPS + 60.0))


def _build_target(name: str, number: int, code: str) -> Actor:
    start, course_rad = relative_start(name, code), math.radians(CODES[code].course_deg)
    speed_mps = NOMINAL_BOAT_MPS * speed_ratio(name, code)
    before_m = speed_mps * DEPARTURE_S
    east, north = math.cos(course_rad), -math.sin(course_rad)
    first = (start.ahead_m - before_m * east, -start.starboard_m - before_m * north)
    last = (RUN_M + OVERRUN_M * east, OVERRUN_M * north)
    size = SIZES[TARGET_LOOK]
    return Actor(
        f"{code}_{number}", size.kind, TARGET_LOOK, np.array([first, last]), speed_mps, *size[1:], closed=False
    )
