"""What the simulated range scanner measures of a world."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from paani.config import PlantConfig
from paani_sim.plant.lidar import BEAMS, FIRST_BEARING_RAD, HEIGHT_M, MAX_RANGE_M, RANGE_STD_M, STEP_RAD
from paani_sim.plant.plant import Plant
from paani_sim.worlds import load_world
from paani_sim.worlds.world import Actor, Kind, Obstacle, Pose2

PORT_BEAM, AHEAD_BEAM = BEAMS * 3 // 4, BEAMS // 2
OpenPlant = Callable[..., Plant]


@pytest.fixture
def afloat() -> Iterator[OpenPlant]:
    """A boat at rest in the middle of a lake, with these things in it and nothing else within range."""
    opened: list[Plant] = []

    def make(*things: Obstacle | Actor, yaw_rad: float = 0.0, seed: int = 1) -> Plant:
        world = dataclasses.replace(
            load_world("lake"),
            obstacles=tuple(each for each in things if isinstance(each, Obstacle)),
            actors=tuple(each for each in things if isinstance(each, Actor)),
        )
        plant = Plant(world, PlantConfig(), seed)
        opened.append(plant)
        plant.place(0.0, 0.0, yaw_rad)
        return plant

    yield make
    for plant in opened:
        plant.close()


def wall(x_m: float, height_m: float = 2.0) -> Obstacle:
    """4 m wide, its face to the boat `x_m` east of it."""
    return Obstacle("wall", Kind.PIER, "pier", Pose2(x_m + 0.5, 0.0, 0.0), 1.0, 4.0, height_m)


def test_the_range_of_every_beam_is_that_of_what_it_meets(afloat: OpenPlant) -> None:
    ranges_m = np.array(afloat(wall(6.0)).read_lidar())
    bearings_rad = FIRST_BEARING_RAD + STEP_RAD * np.arange(BEAMS)
    is_met = np.abs(np.tan(bearings_rad)) * 6.0 < 2.0
    is_met &= np.cos(bearings_rad) > 0.0
    assert (ranges_m > 0.0).tolist() == is_met.tolist()
    errors_m = ranges_m[is_met] - 6.0 / np.cos(bearings_rad[is_met])
    assert np.abs(errors_m).max() < 5.0 * RANGE_STD_M


def test_bearings_are_the_boats(afloat: OpenPlant) -> None:
    """What lies east is to port of a boat that looks south; the hull itself is not in the way."""
    ranges_m = afloat(wall(6.0), yaw_rad=-0.5 * math.pi).read_lidar()
    assert ranges_m[PORT_BEAM] == pytest.approx(6.0, abs=5.0 * RANGE_STD_M)
    assert ranges_m[AHEAD_BEAM] == 0.0


@pytest.mark.parametrize(("x_m", "height_m"), [(MAX_RANGE_M + 1.0, 2.0), (6.0, HEIGHT_M - 0.05)])
def test_what_is_out_of_range_or_lower_than_the_beams_is_not_met(
    afloat: OpenPlant, x_m: float, height_m: float
) -> None:
    """As a swimmer is: a scanner never stands in for the camera."""
    assert not any(afloat(wall(x_m, height_m)).read_lidar())
    assert any(afloat(wall(6.0, HEIGHT_M + 0.05)).read_lidar())


@pytest.mark.slow
def test_errors_are_as_large_as_stated_and_new_in_each_turn(afloat: OpenPlant) -> None:
    plant = afloat(wall(6.0))
    errors_m = [plant.read_lidar()[AHEAD_BEAM] - 6.0 for _ in range(400)]
    assert np.mean(errors_m) == pytest.approx(0.0, abs=4.0 * RANGE_STD_M / 20.0)
    assert np.std(errors_m) == pytest.approx(RANGE_STD_M, rel=0.2)


def test_a_vessel_is_met_where_it_is_by_now(afloat: OpenPlant) -> None:
    path_m = np.array([[10.0, 0.0], [-100.0, 0.0]])
    plant = afloat(Actor("barge", Kind.VESSEL, "barge", path_m, 1.0, 4.0, 2.0, 2.0, closed=False))
    for _ in range(200):
        plant.step(0.0, 0.0)
    assert plant.read_lidar()[AHEAD_BEAM] == pytest.approx(10.0 - 2.0 - 2.0, abs=0.3)


@pytest.mark.slow
def test_equal_seeds_measure_alike_and_no_other_sensor_notices(afloat: OpenPlant) -> None:
    one, other, without = afloat(wall(6.0)), afloat(wall(6.0)), afloat(wall(6.0))
    another = afloat(wall(6.0), seed=2)
    assert one.read_lidar() == other.read_lidar() != another.read_lidar()
    for _ in range(20):
        one.step(10.0, 12.0)
        without.step(10.0, 12.0)
        one.read_lidar()
    assert (one.read_gps(), one.read_imu()) == (without.read_gps(), without.read_imu())
    assert one.state_hash() == without.state_hash()
