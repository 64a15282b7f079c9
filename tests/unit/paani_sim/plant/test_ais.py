"""What the simulated AIS receiver hears of a world's actors."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paani.geometry import enu_from_geodetic
from paani.messages import AisVessel
from paani_sim.plant.ais import CLASS_A_S, CLASS_B_S, MEMORY_S, POSITION_STD_M, RESTING_S, AisReceiver
from paani_sim.worlds.world import Actor, Kind, Pose2

ORIGIN_DEG = (51.44, -0.95)
PATH_M = np.array([[0.0, 0.0], [100.0, 0.0]])


def actor(look: str, length_m: float = 13.0, width_m: float = 2.6) -> Actor:
    return Actor(look, Kind.VESSEL, look, PATH_M, 2.0, length_m, width_m, 2.0)


def listen(look: str, speed_mps: float, seconds: int = 600) -> list[tuple[AisVessel, ...]]:
    """Every second to one vessel that goes north-east, and back while its speed is negative."""
    receiver = AisReceiver([actor(look)], ORIGIN_DEG, np.random.default_rng(3))
    rate_mps = speed_mps * math.sqrt(0.5)
    return [
        receiver.hear([Pose2(rate_mps * t_s, rate_mps * t_s, math.pi / 4)], [speed_mps], t_s, t_s * 1_000_000)
        for t_s in range(seconds)
    ]


@pytest.mark.parametrize(
    ("look", "speed_mps", "every_s"),
    [("barge", 2.0, CLASS_A_S), ("cruiser", 2.0, CLASS_B_S), ("cruiser", 0.9, RESTING_S), ("ferry", 0.0, RESTING_S)],
)
def test_each_class_speaks_as_often_as_its_standard_says(look: str, speed_mps: float, every_s: float) -> None:
    heard = listen(look, speed_mps)
    times_us = sorted({vessel.fixed_us for vessels in heard for vessel in vessels})
    assert np.diff(times_us).tolist() == [every_s * 1e6] * (len(times_us) - 1)
    assert len(times_us) > 2
    silent = [t_s for t_s, vessels in enumerate(heard) if not vessels and t_s > CLASS_A_S]
    assert bool(silent) is (every_s > MEMORY_S), "it is not remembered for longer than that"


@pytest.mark.parametrize("look", ["kayak", "eight", "jetski", "narrowboat", "swimming"])
def test_who_has_no_transponder_is_not_heard(look: str) -> None:
    assert not any(listen(look, 2.0, 60))


@pytest.mark.parametrize("speed_mps", [2.0, -0.4])
def test_a_report_is_true_but_for_the_errors_of_its_receiver_and_rounding(speed_mps: float) -> None:
    [vessel] = listen("barge", speed_mps, 100)[-1]
    at_m = speed_mps * math.sqrt(0.5) * vessel.fixed_us * 1e-6
    east_m, north_m = enu_from_geodetic(vessel.latitude_deg, vessel.longitude_deg, *ORIGIN_DEG)
    assert max(abs(east_m - at_m), abs(north_m - at_m)) < 4.0 * POSITION_STD_M
    assert east_m != at_m
    assert vessel.sog_mps == pytest.approx(abs(speed_mps), abs=0.03)
    assert math.cos(vessel.cog_rad - math.pi / 4) == pytest.approx(math.copysign(1.0, speed_mps), abs=1e-5)
    assert (vessel.to_bow_m + vessel.to_stern_m, vessel.to_port_m + vessel.to_starboard_m) == (14.0, 4.0)
