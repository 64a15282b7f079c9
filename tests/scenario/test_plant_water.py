"""The plant in wind, waves and current, with its faults, hits and energy."""

import dataclasses
import itertools
import math
import statistics
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from paani.config import PlantConfig
from paani.geometry import enu_from_geodetic, wrap_rad
from paani_sim.plant.plant import Plant
from paani_sim.plant.telemetry import gps_message, imu_message, pose_message
from paani_sim.worlds import Behaviour, Current, Fault, FaultKind, Waves, Wind, World, load_world

OTTER = PlantConfig(vessel="otter")
STILL = Wind(0.0, 0.0)
ORIGIN_DEG = (load_world("lake").origin_lat_deg, load_world("lake").origin_lon_deg)
Launch = Callable[..., Plant]


@pytest.fixture
def launch() -> Iterator[Launch]:
    opened: list[Plant] = []

    def make(world: World, config: PlantConfig = OTTER, seed: int = 1, faults: tuple[Fault, ...] = ()) -> Plant:
        opened.append(Plant(world, config, seed, faults))
        return opened[-1]

    yield make
    for plant in opened:
        plant.close()


def lake(**changes: Any) -> World:
    """Open water."""
    world = dataclasses.replace(load_world("lake"), obstacles=(), actors=(), wind=STILL)
    return dataclasses.replace(world, **changes)


def drift(plant: Plant, seconds: float, yaw_rad: float = 0.0) -> tuple[float, float]:
    """Displacement of the free boat from the middle of the lake [m]."""
    plant.place(0.0, 0.0, yaw_rad)
    for _ in range(round(100 * seconds)):
        plant.step(0.0, 0.0)
    return plant.position_m


def test_k8_paper_is_blind_to_wind(launch: Launch) -> None:
    """K8: no validated wind: a gale leaves the paper's boat where it is."""
    assert drift(launch(lake(wind=Wind(10.0, 0.5, 0.3)), PlantConfig()), 20.0) == (0.0, 0.0)


@pytest.mark.parametrize(("wind_mps", "speed_mps"), [(3.0, 0.049), (6.0, 0.146)])
def test_wind_drifts_the_free_boat_broadside(launch: Launch, wind_mps: float, speed_mps: float) -> None:
    """Beam wind against 20 v + 80 v^2: 0.05 m/s at 3 m/s, 0.15 m/s at 6 m/s, downwind."""
    plant = launch(lake(wind=Wind(wind_mps, 0.5 * math.pi)))
    x_m, y_m = drift(plant, 60.0)
    assert plant.velocity[1] == pytest.approx(speed_mps, rel=0.05)
    assert y_m == pytest.approx(60.0 * speed_mps, rel=0.1)
    assert abs(x_m) < 0.1


@pytest.mark.parametrize("vessel", ["paper", "otter"])
def test_current_carries_the_free_boat_at_its_own_speed(launch: Launch, vessel: str) -> None:
    world = lake(current=Current(0.4, 1.0))
    plant = launch(world, PlantConfig(vessel=vessel))
    drift(plant, 60.0, yaw_rad=0.3)
    around = plant.surroundings
    surge_mps, sway_mps, rate_radps = plant.velocity
    yaw_rad = plant.attitude.yaw_rad
    assert surge_mps * math.cos(yaw_rad) - sway_mps * math.sin(yaw_rad) == pytest.approx(around.current_x_mps, abs=5e-3)
    assert surge_mps * math.sin(yaw_rad) + sway_mps * math.cos(yaw_rad) == pytest.approx(around.current_y_mps, abs=5e-3)
    assert abs(rate_radps) < 1e-3


def test_waves_rock_the_boat_gently_and_push_it_little(launch: Launch) -> None:
    """U = 6 m/s over 200 m is a sea of 4 cm, shorter than the hull: tenths of a degree, not degrees."""
    waves = dataclasses.replace(lake(wind=Wind(6.0, 0.5), waves=Waves(200.0)))
    no_windage = launch(waves, PlantConfig(vessel="paper"))
    no_windage.place(0.0, 0.0, 0.0)
    pitch, heights = [], []
    for _ in range(6000):
        no_windage.step(0.0, 0.0)
        pitch.append(no_windage.attitude.pitch_rad)
        heights.append(no_windage.z_m)
    assert 0.02 < math.degrees(statistics.pstdev(pitch)) < 0.6
    assert 1e-4 < statistics.pstdev(heights) < 0.01
    assert no_windage.distance_m > 0.0
    assert math.hypot(*no_windage.position_m) < 1.5


def test_passing_vessel_s_wake_rolls_the_boat(launch: Launch) -> None:
    path_m = np.array([[-90.0, -8.0], [90.0, -8.0]])
    actor = dataclasses.replace(
        load_world("lake").actors[0],
        path_m=path_m,
        speed_mps=3.0,
        start_m=0.0,
        closed=False,
        behaviour=Behaviour.HOLDS_ON,
    )
    plant = launch(lake(actors=(actor,)))
    plant.place(0.0, 0.0, 0.0)
    rolls = []
    for _ in range(4000):
        plant.step(0.0, 0.0)
        rolls.append(abs(plant.attitude.roll_rad))
    before, during = max(rolls[:2400]), max(rolls[2400:])
    assert math.degrees(before) < 0.1
    assert 1.0 < math.degrees(during) < 25.0


def test_same_seed_same_sea(launch: Launch) -> None:
    rough = lake(wind=Wind(6.0, 0.5, 0.3), waves=Waves(200.0), current=Current(0.2, 0.1))

    def trace(seed: int) -> str:
        plant = launch(rough, seed=seed)
        for _ in range(800):
            plant.step(3.0, 3.5)
        return plant.state_hash()

    assert trace(5) == trace(5)
    assert trace(5) != trace(6)


def test_fans_lag_by_a_tenth_of_a_second(launch: Launch) -> None:
    """A step of 10 N: 63 % of the paper boat's acceleration after 0.1 s, for the otter's mass with added mass."""
    plant = launch(lake())
    plant.place(0.0, 0.0, 0.0)
    speeds = []
    for _ in range(11):
        plant.step(5.0, 5.0)
        speeds.append(plant.velocity[0])
    acceleration = (speeds[-1] - speeds[-2]) / 0.01
    assert acceleration == pytest.approx((1.0 - math.exp(-1.1)) * 10.0 / (12.4 * 1.1), rel=0.03)


def test_boat_loses_energy_without_thrust(launch: Launch) -> None:
    """Tilted, dropped and turning, the otter only ever calms down, added mass and Coriolis included."""
    plant = launch(lake())
    plant.place(0.0, 0.0, 0.0)
    for _ in range(600):
        plant.step(2.0, 10.0)
    energies = []
    for _ in range(2000):
        plant.step(0.0, 0.0)
        surge, sway, rate = plant.velocity
        energies.append(12.4 * (1.1 * surge**2 + 2.5 * sway**2) + 2.05 * 2.7 * rate**2)
    assert all(after <= before + 1e-6 for before, after in zip(energies[100::100], energies[200::100], strict=False))
    assert energies[-1] < 0.02 * energies[0]


def test_energy_is_force_times_way_through_water(launch: Launch) -> None:
    """At a steady 0.68 m/s with 12 N, 8.2 W."""
    plant = launch(lake())
    plant.place(-40.0, 0.0, 0.0)
    for _ in range(2000):
        plant.step(6.0, 6.0)
    before_j = plant.energy_j
    for _ in range(1000):
        plant.step(6.0, 6.0)
    assert (plant.energy_j - before_j) / 10.0 == pytest.approx(12.0 * 0.68, rel=0.02)
    assert launch(lake()).energy_j == 0.0


def test_hits_name_what_was_touched_and_when(launch: Launch) -> None:
    world = dataclasses.replace(load_world("lake"), actors=(), wind=STILL)
    sail = next(obstacle for obstacle in world.obstacles if obstacle.id == "sail_middle")
    plant = launch(world)
    plant.place(sail.pose.x_m - 7.0, sail.pose.y_m, 0.0)
    for _ in range(2500):
        plant.step(6.0, 6.0)
    assert {hit.name for hit in plant.touches} == {"sail_middle"}
    assert plant.collisions == len(plant.touches) >= 1
    assert 3.0 < plant.touches[0].began_s < 12.0


def test_gps_outage_and_jump(launch: Launch) -> None:
    """Outage: no fix, and the position stays the last one. Jump: as far east as it says. Noise as without faults."""
    faults = (Fault(FaultKind.GPS_OUTAGE, 2.0, 1.0), Fault(FaultKind.GPS_JUMP, 4.0, 1.0, 25.0))
    faulty, sound = launch(lake(), faults=faults), launch(lake())
    east_m, fixes, held = [], [], []
    for step in range(600):
        for plant in (faulty, sound):
            plant.step(0.0, 0.0)
        if step % 20 == 19:
            measured, true = gps_message(faulty, 1), gps_message(sound, 1)
            told_m, true_m = (
                enu_from_geodetic(fix.latitude_deg, fix.longitude_deg, *ORIGIN_DEG)[0] for fix in (measured, true)
            )
            east_m.append(told_m - true_m)
            fixes.append(measured.fix)
            held.append(told_m)
    assert [index for index, fix in enumerate(fixes) if not fix] == [9, 10, 11, 12, 13]
    assert len(set(held[8:14])) == 1
    assert east_m[19:24] == pytest.approx([25.0] * 5, abs=0.01)
    assert not any(east_m[:9] + east_m[14:19] + east_m[24:])


def test_compass_and_gyro_bias(launch: Launch) -> None:
    faults = (Fault(FaultKind.COMPASS_BIAS, 0.5, 0.5, 0.4), Fault(FaultKind.GYRO_BIAS, 0.5, 0.5, -0.02))
    faulty, sound = launch(lake(), faults=faults), launch(lake())
    turned, rates = [], []
    for _ in range(150):
        for plant in (faulty, sound):
            plant.step(0.0, 0.0)
        measured, true = imu_message(faulty, 1), imu_message(sound, 1)
        turned.append(wrap_rad(measured.yaw_rad - true.yaw_rad))
        rates.append(measured.gyro_z_radps - true.gyro_z_radps)
    assert turned[:49] == rates[:49] == [0.0] * 49
    assert turned[50:99] == pytest.approx([0.4] * 49)
    assert rates[50:99] == pytest.approx([-0.02] * 49)
    assert turned[100:] == rates[100:] == [0.0] * 50


@pytest.mark.parametrize(("amount", "side"), [(0.6, -1.0), (-0.6, 1.0)])
def test_weak_thruster_turns_the_boat_towards_it(launch: Launch, amount: float, side: float) -> None:
    """Left fan weak: to port is the other way: the right one pushes on, so the bow goes to port."""
    plant = launch(lake(), faults=(Fault(FaultKind.THRUSTER_LOSS, 0.0, amount=amount),))
    plant.place(0.0, 0.0, 0.0)
    for _ in range(500):
        plant.step(5.0, 5.0)
    assert plant.velocity[2] * side < -0.05
    assert plant.energy_j > 0.0


def test_true_pose_carries_the_actors_distances(launch: Launch) -> None:
    """One that gives way is late when the boat lies on its path; the pose says by how much."""
    world = load_world("lake")
    actor = dataclasses.replace(world.actors[0], behaviour=Behaviour.GIVES_WAY)
    plant = launch(dataclasses.replace(lake(), actors=(actor, world.actors[1])))
    ahead = actor.path_m[(int(len(actor.path_m) * 0.25)) % len(actor.path_m)]
    plant.place(float(ahead[0]), float(ahead[1]), 0.0)
    for _ in range(6000):
        plant.step(0.0, 0.0)
    truth = pose_message(plant, 1)
    assert truth.actors_along_m == plant.actors_along_m
    assert truth.actors_along_m[0] < actor.start_m + 0.8 * actor.speed_mps * 60.0
    assert truth.actors_along_m[1] == pytest.approx(world.actors[1].start_m + world.actors[1].speed_mps * 60.0, abs=0.1)
    assert plant.collisions == 0


def test_otter_heaves_and_rolls_with_its_added_mass(launch: Launch) -> None:
    """Heave: sqrt(650 / 24.8) = 5.12 rad/s, zeta 0.3: 1.29 s. Roll: sqrt(90 / 1.032) = 9.34 rad/s, 0.2: 0.69 s."""
    plant = launch(lake())
    plant.place(0.0, 0.0, 0.0, z_m=0.227)
    plant._data.qvel[3] = 0.2
    heights, rolls = [], []
    for _ in range(300):
        plant.step(0.0, 0.0)
        heights.append(plant.z_m - 0.177)
        rolls.append(plant.attitude.roll_rad)
    assert period_s(heights) == pytest.approx(1.286, abs=0.03)
    assert period_s(rolls) == pytest.approx(0.687, abs=0.02)


def period_s(swing: list[float]) -> float:
    """Twice the time between the first two changes of sign."""
    changes = [index for index, (a, b) in enumerate(itertools.pairwise(swing)) if a * b < 0.0]
    return 2.0 * (changes[1] - changes[0]) * 0.01


@pytest.mark.parametrize("vessel", ["paper", "otter"])
def test_boat_rides_waves_much_longer_than_itself(launch: Launch, vessel: str) -> None:
    """Swell of 20 m: the hull goes up and down with the surface and leans with its slope."""
    plant = launch(lake(wind=Wind(10.0, 0.0), waves=Waves(20_000.0)), PlantConfig(vessel=vessel))
    plant.place(0.0, 0.0, 0.0)
    lifts, surface, pitches, slopes = [], [], [], []
    for step in range(4000):
        plant.step(0.0, 0.0)
        if step > 1000:
            lifts.append(plant.z_m - 0.177)
            surface.append(plant.surroundings.elevation_m)
            pitches.append(-plant.attitude.pitch_rad)
            slopes.append(plant.surroundings.slope_ahead)
    assert statistics.correlation(lifts, surface) > 0.98
    assert statistics.pstdev(lifts) == pytest.approx(statistics.pstdev(surface), rel=0.15)
    assert statistics.correlation(pitches, slopes) > 0.9
