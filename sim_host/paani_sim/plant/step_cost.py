"""CPU time of the plant's steps, with and without actors, waves, wakes, gusts and current."""

import dataclasses
import statistics

from paani.clock import process_cpu_s
from paani.config import PlantConfig
from paani.statistics.figure_table import FigureTable
from paani_sim.plant.plant import Plant
from paani_sim.plant.telemetry import gps_message, imu_message
from paani_sim.worlds import Actor, Current, Waves, Wind, World, load_world

ACTORS = (0, 4, 12)
FETCH_M = 200.0
WIND = Wind(6.0, 0.5, gust_frac=0.2)
CURRENT = Current(0.3)
WARM_S, RUN_S, ROUNDS = 20.0, 10.0, 5
FANS_N = (2.0, 4.0)


def measure_physics() -> FigureTable:
    """The otter circling on the river, sensors read when due; CPU time of one core, median of interleaved rounds."""
    plants = {
        (count, rough): Plant(_build_world(count, rough=rough), PlantConfig(vessel="otter"))
        for rough in (False, True)
        for count in ACTORS
    }
    start = load_world("river").start
    cpu_s: dict[tuple[int, bool], list[float]] = {case: [] for case in plants}
    try:
        for plant in plants.values():
            plant.place(*start)
            _run_plant(plant, WARM_S)
        for _ in range(ROUNDS):
            for case, plant in plants.items():
                plant.place(*start)  # wherever wind and current have taken it
                before_s = process_cpu_s()
                _run_plant(plant, RUN_S)
                cpu_s[case].append(process_cpu_s() - before_s)
    finally:
        for plant in plants.values():
            plant.close()
    cost_s = {case: statistics.median(times) for case, times in cpu_s.items()}
    return FigureTable(
        name="physics",
        columns=("actors", "waves, wakes, gusts, current", "us a step", "x real time a core", "over still and empty"),
        rows=tuple(
            (count, "yes" if rough else "no", 1e4 * each_s / RUN_S, RUN_S / each_s, each_s / cost_s[0, False])
            for (count, rough), each_s in cost_s.items()
        ),
        note="banks, obstacles and contacts of the river; IMU at 100 Hz, GPS at 5 Hz; actors under way at 2.5 m/s",
    )


def _build_world(actors: int, *, rough: bool) -> World:
    world = load_world("river")
    lead = world.actors[0]
    fleet = tuple(_place_on_path(lead, number, actors) for number in range(actors))
    world = dataclasses.replace(world, actors=fleet, wind=Wind(0.0, 0.0))
    if not rough:
        return world
    return dataclasses.replace(world, wind=WIND, waves=Waves(FETCH_M), current=CURRENT)


def _place_on_path(lead: Actor, number: int, actors: int) -> Actor:
    """Evenly spread round the path of `lead`, fast enough for a wake."""
    return dataclasses.replace(lead, id=f"actor_{number}", start_m=number * 240.0 / actors, speed_mps=2.5)


def _run_plant(plant: Plant, seconds: float) -> None:
    config = PlantConfig()
    gps_every = round(1.0 / (config.step_s * config.sensors.gps_rate_hz))
    for _ in range(round(seconds / config.step_s)):
        plant.step(*FANS_N)
        imu_message(plant, 1)
        if plant.steps % gps_every == 0:
            gps_message(plant, 1)
