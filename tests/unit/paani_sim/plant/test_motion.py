"""The plant as a boat: heave, speeds, turning, collisions, determinism."""

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import paani_sim.vessels
from paani.config import PlantConfig
from paani_sim.plant.plant import COLLISION_GAP_S, Plant, PlantDiverged
from paani_sim.vessels import load_vessel
from paani_sim.worlds import Behaviour, Fault, FaultKind, Scenario, World, load_world

STEP_S = 0.01
FORCE_N = 75.0
OpenPlant = Callable[..., Plant]


@pytest.fixture
def open_plant() -> Iterator[OpenPlant]:
    opened: list[Plant] = []

    def make(world: World | None = None, config: PlantConfig | None = None, seed: int = 1) -> Plant:
        opened.append(Plant(world or open_water(), config or PlantConfig(), seed))
        return opened[-1]

    yield make
    for plant in opened:
        plant.close()


def drive(plant: Plant, steps: int, force_n: float) -> None:
    for _ in range(steps):
        plant.step(force_n, force_n)


def open_water() -> World:
    return dataclasses.replace(load_world("lake"), obstacles=(), actors=())


def test_k6_heave_settles_at_0_177_with_a_damped_period_of_1_s(open_plant: OpenPlant) -> None:
    """K6, 1a: omega_n 7.24 rad/s, zeta 0.50; damped period 1.0 s, overshoot 16 %, z_e 0.177 m."""
    plant = open_plant()
    plant.place(0.0, 0.0, 0.0, z_m=0.227)
    heights = []
    for _ in range(400):
        plant.step(0.0, 0.0)
        heights.append(plant.z_m - 0.177)
    crossings = [i for i, (a, b) in enumerate(itertools.pairwise(heights)) if a * b < 0.0]
    assert 2.0 * (crossings[1] - crossings[0]) * STEP_S == pytest.approx(0.99, abs=0.04)
    assert -min(heights) / 0.05 == pytest.approx(0.16, abs=0.02)
    assert plant.z_m == pytest.approx(0.177, abs=1e-4)


@pytest.mark.parametrize(
    ("thrust_frac", "speed_mps"), [(0.01, 0.19), (0.02, 0.30), (0.04, 0.46), (0.08, 0.68), (1.0, 2.69)]
)
@pytest.mark.slow
def test_k4_k5_thrust_gives_the_drag_limited_speed(open_plant: OpenPlant, thrust_frac: float, speed_mps: float) -> None:
    """75 N per unit and fan against 4 v + 20 v^2; 0.68 m/s at the paper's forward limit (1a)."""
    plant = open_plant()
    plant.place(-60.0, 0.0, 0.0)
    drive(plant, 2500, FORCE_N * thrust_frac)
    forward_mps, _, _ = plant.velocity
    over_ground_mps = forward_mps / math.cos(plant.attitude.pitch_rad)
    assert over_ground_mps == pytest.approx(speed_mps, rel=0.02)


@pytest.mark.slow
def test_k4_two_fans_turn_the_boat_away_from_the_stronger(open_plant: OpenPlant) -> None:
    """Forward 0.08 and steering 0.04: 1.8 N m against 4 r + 25 r^2 is 0.200 rad/s, to port."""
    plant = open_plant()
    plant.place(0.0, 0.0, 0.0)
    for _ in range(1500):
        plant.step(FORCE_N * 0.04, FORCE_N * 0.12)
    assert plant.velocity[2] == pytest.approx(0.200, abs=0.002)


@pytest.mark.slow
def test_k10_displacement_needs_thrust(open_plant: OpenPlant) -> None:
    """K10: 27 s of thrust displace the boat; 27 s without do not."""
    plant = open_plant()
    drive(plant, 2700, 0.0)
    assert plant.distance_m < 1e-6
    drive(plant, 2700, FORCE_N * 0.02)
    assert plant.distance_m == pytest.approx(27.0 * 0.30, rel=0.2)


@pytest.mark.slow
def test_running_into_the_bank_counts_once(open_plant: OpenPlant) -> None:
    """K3: banks are solid; staying in touch is one collision, coming back later another."""
    plant = open_plant()
    east_m = load_world("lake").shore_m[:, 0].max()
    plant.place(east_m - 4.0, 0.0, 0.0)
    drive(plant, 1500, FORCE_N * 0.06)
    assert plant.collisions == 1
    assert plant.in_contact
    assert plant.touches[-1].ended_s == pytest.approx(15.0)
    assert max(touch.ended_s - touch.began_s for touch in plant.touches) > COLLISION_GAP_S
    plant.place(east_m - 4.0, 0.0, 0.0)
    drive(plant, 1500, FORCE_N * 0.06)
    assert plant.collisions == 2


@pytest.mark.slow
def test_moving_actor_hits_a_drifting_boat(open_plant: OpenPlant) -> None:
    world = load_world("river")
    holding_on = dataclasses.replace(world.actors[0], behaviour=Behaviour.HOLDS_ON)
    plant = open_plant(dataclasses.replace(world, actors=(holding_on,)))
    path_m = holding_on.path_m
    ahead_m = path_m[(len(path_m) * 2) // 3]
    plant.place(float(ahead_m[0]), float(ahead_m[1]), 0.0)
    hit = False
    for _ in range(26000):
        plant.step(0.0, 0.0)
        hit = hit or plant.collisions > 0
        if hit:
            break
    assert hit


@pytest.mark.parametrize("vessel", ["paper", "otter"])
@pytest.mark.slow
def test_boat_inside_a_solid_is_thrown_out_not_to_infinity(open_plant: OpenPlant, vessel: str) -> None:
    """The worst of contacts, athwart the middle of every thing on the lake: thrown out, then slowed by the water."""
    plant = open_plant(load_world("lake"), PlantConfig(vessel=vessel))
    for obstacle in load_world("lake").obstacles:
        plant.place(obstacle.pose.x_m, obstacle.pose.y_m, 0.7)
        drive(plant, 250, 9.0)
        assert max(map(abs, plant.velocity)) < 5.0, obstacle.id


@pytest.mark.slow
def test_same_seed_same_bits(open_plant: OpenPlant) -> None:
    """1000 steps in one process, with a second plant alive: the force hook keeps them apart."""

    def trace(seed: int) -> tuple[str, tuple[float, ...]]:
        plant = open_plant(load_world("river"), seed=seed)
        for step in range(1000):
            plant.step(3.0, 4.0 + 0.001 * step)
        return plant.state_hash(), (*plant.read_gps(), plant.read_imu().yaw_rad)

    assert trace(5) == trace(5)
    assert trace(5)[0] == trace(6)[0]
    assert trace(5)[1] != trace(6)[1]


def test_divergence_names_itself(open_plant: OpenPlant, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo would reset the boat and write a log file; neither happens."""
    monkeypatch.chdir(tmp_path)
    paper = (Path(paani_sim.vessels.__file__).parent / "paper.toml").read_text(encoding="utf-8")
    file = tmp_path / "stiff.toml"
    file.write_text(paper.replace("_damping = 24.0", "_damping = 1e9").replace("_damping = 90.0", "_damping = 1e9"))
    plant = open_plant(config=PlantConfig(vessel=str(file)))
    file.unlink()
    plant.place(0.0, 0.0, 0.0, z_m=0.2)
    with pytest.raises(PlantDiverged, match="not finite"):
        drive(plant, 2000, 1e8)
    assert not list(tmp_path.iterdir())


def test_vessel_of_the_settings_goes_before_the_scenario_s(open_plant: OpenPlant) -> None:
    """A scenario's vessel, seed and faults make its boat; `--set plant.vessel=...` tries another vessel in it."""
    scenario = Scenario("still", open_water(), seed=4, vessel="otter", faults=(Fault(FaultKind.GPS_OUTAGE, 0.0),))
    for config, vessel in ((PlantConfig(), "otter"), (PlantConfig(vessel="paper"), "paper")):
        plant = Plant.from_scenario(scenario, config)
        try:
            assert plant.vessel == load_vessel(vessel)
            assert not plant.read_gps().fix
        finally:
            plant.close()


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0])
def test_k4_k8_the_boat_weighs_12_4_kg_to_whatever_side_it_is_pushed(open_plant: OpenPlant, yaw_rad: float) -> None:
    """2 N from rest, for one step: nothing is added to its mass."""
    plant = open_plant()
    plant.place(0.0, 0.0, yaw_rad)
    plant.step(1.0, 1.0)
    assert plant.velocity[0] == pytest.approx(2.0 / 12.4 * STEP_S, rel=0.01)


@pytest.mark.parametrize(("axis", "inertia_kgm2"), [(1, 0.86), (2, 1.45)], ids=["roll", "pitch"])
def test_k7_a_tilted_boat_is_turned_upright_by_the_whole_stiffness(
    open_plant: OpenPlant, axis: int, inertia_kgm2: float
) -> None:
    """0.1 rad, for one step of the engine, which damps a little of it at once."""
    plant = open_plant()
    plant.place(0.0, 0.0, 0.0)
    plant._qpos[3], plant._qpos[3 + axis] = math.cos(0.05), math.sin(0.05)
    plant.step(0.0, 0.0)
    assert plant._qvel[2 + axis] == pytest.approx(-90.0 * 0.1 / inertia_kgm2 * STEP_S, rel=0.25)
