"""What an AIS receiver on the boat hears of the world's vessels. Pure: poses, time and generator in.

Class A of commercial craft, class B of pleasure craft (ITU-R M.1371-5, annex 1, tables 1 and 2). Kayaks, rowers,
jet-skis and swimmers have none.
"""

import math
from collections.abc import Sequence

import numpy as np

from paani.geometry import geodetic_from_enu
from paani.messages import AisVessel
from paani_sim.worlds.world import Actor, Pose2

CLASS_A, CLASS_B = frozenset({"barge", "ferry", "tug", "workboat"}), frozenset({"cruiser", "sailboat"})
CLASS_A_S, CLASS_B_S, RESTING_S = 10.0, 30.0, 180.0  # between two reports; resting: class A moored, B below 2 knots
RESTING_MPS = {True: 0.1, False: 1.03}  # by whether it is of class A
MEMORY_S = 60.0  # for which the receiver tells a vessel again
POSITION_STD_M = 0.8  # per axis, constant over a drive: that of our own receiver
KNOT_MPS, STEP_DEG = 1852.0 / 3600.0, 1.0 / 600_000.0  # units of a report: 0.1 knots, 0.1 degrees, 1/10,000 of a minute


class AisReceiver:
    """Hears what the transponders of a world's actors say; `origin_deg` is the map's latitude and longitude."""

    def __init__(self, actors: Sequence[Actor], origin_deg: tuple[float, float], rng: np.random.Generator) -> None:
        self._origin_deg = origin_deg
        self._actors = [(index, each) for index, each in enumerate(actors) if each.look in CLASS_A | CLASS_B]
        self._offsets_m = POSITION_STD_M * rng.standard_normal((len(self._actors), 2))
        self._due_s = rng.uniform(0.0, CLASS_A_S, len(self._actors)).tolist()
        self._heard: dict[int, AisVessel] = {}

    def hear(
        self, poses: Sequence[Pose2], speeds_mps: Sequence[float], t_s: float, now_us: int
    ) -> tuple[AisVessel, ...]:
        """The vessels heard within `MEMORY_S`, by the actors' poses and speeds at simulated time `t_s`."""
        for number, (index, actor) in enumerate(self._actors):
            if t_s >= self._due_s[number]:
                is_class_a, speed_mps = actor.look in CLASS_A, abs(speeds_mps[index])
                is_resting = speed_mps < RESTING_MPS[is_class_a]
                self._due_s[number] = t_s + (RESTING_S if is_resting else CLASS_A_S if is_class_a else CLASS_B_S)
                self._heard[index] = self._report(number, actor, poses[index], speeds_mps[index], now_us)
        limit_us = now_us - round(MEMORY_S * 1e6)
        return tuple(each for each in self._heard.values() if each.fixed_us >= limit_us)

    def _report(self, number: int, actor: Actor, pose: Pose2, speed_mps: float, now_us: int) -> AisVessel:
        """Rounded as the report is; an actor that goes astern makes good the other course."""
        east_m, north_m = self._offsets_m[number].tolist()
        latitude_deg, longitude_deg = geodetic_from_enu(pose.x_m + east_m, pose.y_m + north_m, *self._origin_deg)
        course_rad = pose.yaw_rad if speed_mps >= 0.0 else pose.yaw_rad + math.pi
        half_length_m, half_beam_m = math.ceil(0.5 * actor.length_m), math.ceil(0.5 * actor.width_m)
        return AisVessel(
            mmsi=235_000_000 + number,
            fixed_us=now_us,
            latitude_deg=round(latitude_deg / STEP_DEG) * STEP_DEG,
            longitude_deg=round(longitude_deg / STEP_DEG) * STEP_DEG,
            sog_mps=round(abs(speed_mps) / KNOT_MPS, 1) * KNOT_MPS,
            cog_rad=math.radians(round(math.degrees(course_rad), 1)),
            to_bow_m=half_length_m,
            to_stern_m=half_length_m,
            to_port_m=half_beam_m,
            to_starboard_m=half_beam_m,
        )
