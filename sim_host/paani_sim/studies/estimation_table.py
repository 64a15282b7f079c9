"""The estimator against truth: one seeded course in the lake, in calm and wind, with GPS and compass at fault.

The boat lies still for a minute, steers hexagons for five by a helm that sees the truth, and lies still again.

`paani bench water --only estimation`, or `python -m paani_sim.studies.estimation_table [SEEDS]`.
"""

import dataclasses
import math
import sys
from collections.abc import Iterator
from typing import Literal, NamedTuple

import msgspec

from paani import messages as m
from paani.config import Config, load_config
from paani.cores import load_estimator
from paani.geometry import clip, enu_from_geodetic, wrap_rad
from paani.statistics.figure_table import FigureTable, table_text
from paani_sim.plant.plant import Plant
from paani_sim.plant.telemetry import gps_message, imu_message
from paani_sim.worlds import Fault, FaultKind, Pose2, Waves, Wind, World, load_world

Ekf = Literal["augmented", "plain"]
SEEDS = (1, 2, 3)
EKFS: tuple[Ekf, ...] = ("augmented", "plain")  # ours, and the paper's
START_US = 1_000_000_000
REST_S, UNDER_WAY_S, LEG_S = 60.0, 300.0, 25.0
CRUISE_FORCE_N, MAX_FORCE_N = 6.0, 15.0
FAULT_AT_S = 150.0
REST_SPEED_MPS, REST_TIME_S, FALSE_MOTION_MPS = 0.02, 2.0, 0.05  # true rest, its least duration, false motion (L5)


class Condition(NamedTuple):
    """Weather and faults of a course."""

    name: str
    wind: Wind = Wind(speed_mps=0.0)
    waves: Waves = Waves()
    faults: tuple[Fault, ...] = ()


CONDITIONS = (
    Condition("calm"),
    Condition("wind 6 m/s, waves", Wind(speed_mps=6.0, toward_rad=0.9, gust_frac=0.2), Waves(fetch_m=200.0)),
    Condition("GPS away for 30 s", faults=(Fault(FaultKind.GPS_OUTAGE, FAULT_AT_S, 30.0),)),
    Condition("GPS 8 m off for 60 s", faults=(Fault(FaultKind.GPS_JUMP, FAULT_AT_S, 60.0, 8.0),)),
    Condition("compass 0.1 rad off", faults=(Fault(FaultKind.COMPASS_BIAS, FAULT_AT_S, amount=0.1),)),
    Condition("gyro 0.02 rad/s off", faults=(Fault(FaultKind.GYRO_BIAS, FAULT_AT_S, amount=0.02),)),
)


class EstimationStep(NamedTuple):
    """One step of the estimator: what is true, what it says, and the compass and fix it was given."""

    at_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    estimate: m.Odometry
    compass_rad: float
    fix: m.GpsFix | None


class EstimationRow(msgspec.Struct, frozen=True, kw_only=True):
    """One course. Distances are in the plane; healthy: while the estimate states it.

    gps_m, compass_deg: RMS errors of the fixes and of the compass themselves. nis: mean over the fixes that were used,
    2 if the stated spread is right; nis_low, nis_high: its 95 % band. nees: mean squared position error over the
    published variance, at most 2 if the published spread covers the error. false_motion_frac: of the steps truly at
    rest, those with an estimated speed above 0.05 m/s; None: never at rest. false_motion_s: the longest stretch of
    them.
    """

    condition: str
    ekf: Ekf
    seed: int
    position_m: float
    healthy_position_m: float
    gps_m: float
    heading_deg: float
    compass_deg: float
    speed_mps: float
    nis: float
    nis_low: float
    nis_high: float
    nees: float
    false_motion_frac: float | None
    false_motion_s: float
    unhealthy_s: float
    refused: int


def simulate_course(condition: Condition, seed: int, config: Config) -> Iterator[EstimationStep]:
    """The boat's minutes, step by step of the estimator."""
    world = _build_world(condition)
    origin_deg = (world.origin_lat_deg, world.origin_lon_deg)
    estimator = load_estimator(msgspec.structs.replace(config.localization, origin_lat_lon_deg=origin_deg))
    plant = Plant(world, config.plant, seed, condition.faults)
    every = {
        what: max(1, round(1.0 / (config.plant.step_s * hz)))
        for what, hz in (
            ("imu", config.plant.sensors.imu_rate_hz),
            ("gps", config.plant.sensors.gps_rate_hz),
            ("estimate", config.localization.rate_hz),
        )
    }
    samples, fix = list[m.ImuSample](), None
    try:
        while (at_s := plant.sim_us * 1e-6) < 2.0 * REST_S + UNDER_WAY_S:
            plant.step(*_steer_fans_n(plant, at_s))
            now_us = START_US + plant.sim_us
            if plant.steps % every["imu"] == 0:
                samples.append(imu_message(plant, now_us))
            if plant.steps % every["gps"] == 0:
                fix = gps_message(plant, now_us)
            if plant.steps % every["estimate"] == 0:
                _, estimate = estimator.step(samples, fix, now_us)
                surge_mps, sway_mps, _ = plant.velocity
                speed_mps = math.hypot(surge_mps, sway_mps)
                truth = (*plant.position_m, plant.attitude.yaw_rad, speed_mps)
                yield EstimationStep(plant.sim_us * 1e-6, *truth, estimate, samples[-1].yaw_rad, fix)
                samples, fix = [], None
    finally:
        plant.close()


def summarise_course(condition: str, ekf: Ekf, seed: int, steps: list[EstimationStep], world: World) -> EstimationRow:
    """The figures of one course, from the first healthy estimate on."""
    first = next((number for number, step in enumerate(steps) if step.estimate.healthy), None)
    if first is None:
        raise ValueError(f"{condition}, {ekf}, seed {seed}: never healthy")
    steps = steps[first:]
    step_s = steps[1].at_s - steps[0].at_s
    off2_m2 = [_squared_error_m2(step) for step in steps]
    healthy = [off2 for off2, step in zip(off2_m2, steps, strict=True) if step.estimate.healthy]
    used, refused = list[float](), steps[0].estimate.refused_fixes
    for step in steps:
        if step.fix is not None and step.fix.fix and step.estimate.refused_fixes == refused:
            used.append(step.estimate.nis)
        refused = step.estimate.refused_fixes
    half = 1.96 * math.sqrt(4.0 / len(used))
    still = list(_at_rest(steps))
    false = [math.hypot(step.estimate.surge_mps, step.estimate.sway_mps) > FALSE_MOTION_MPS for step in still]
    return EstimationRow(
        condition=condition,
        ekf=ekf,
        seed=seed,
        position_m=_rms(off2_m2),
        healthy_position_m=_rms(healthy),
        gps_m=_rms([_squared_fix_error_m2(step, world) for step in steps if step.fix is not None and step.fix.fix]),
        heading_deg=math.degrees(_rms([wrap_rad(step.estimate.yaw_rad - step.yaw_rad) ** 2 for step in steps])),
        compass_deg=math.degrees(_rms([wrap_rad(step.compass_rad - step.yaw_rad) ** 2 for step in steps])),
        speed_mps=_rms(
            [(math.hypot(step.estimate.surge_mps, step.estimate.sway_mps) - step.speed_mps) ** 2 for step in steps]
        ),
        nis=sum(used) / len(used),
        nis_low=2.0 - half,
        nis_high=2.0 + half,
        nees=sum(off2 / step.estimate.position_std_m**2 for off2, step in zip(off2_m2, steps, strict=True))
        / len(steps),
        false_motion_frac=sum(false) / len(false) if false else None,
        false_motion_s=_longest_run(false) * step_s,
        unhealthy_s=step_s * sum(not step.estimate.healthy for step in steps),
        refused=refused,
    )


def estimation_table(
    seeds: tuple[int, ...] = SEEDS,
    conditions: tuple[Condition, ...] = CONDITIONS,
    ekfs: tuple[Ekf, ...] = ("augmented",),
) -> Iterator[EstimationRow]:
    """Each condition with each seed, by each of these filters: the same boat, weather, faults and sensors."""
    for condition in conditions:
        for ekf in ekfs:
            # Wind takes hold of this hull.
            config = load_config(sets=["plant.vessel=otter", f"localization.ekf={ekf}"])
            for seed in seeds:
                steps = list(simulate_course(condition, seed, config))
                yield summarise_course(condition.name, ekf, seed, steps, _build_world(condition))


def tabulate_estimation() -> FigureTable:
    """The table for `paani bench water`."""
    return tabulate_rows(list(estimation_table(ekfs=EKFS)))


def tabulate_rows(rows: list[EstimationRow]) -> FigureTable:
    """Metres, degrees, seconds."""
    return FigureTable(
        name="estimation",
        columns=(
            "condition", "filter", "seed", "position m", "if healthy", "GPS m", "heading deg", "compass deg",
            "speed m/s", "NIS", "95 % band", "NEES", "false motion %", "longest s", "unhealthy s", "refused",
        ),
        rows=tuple(
            (
                row.condition, row.ekf, row.seed, round(row.position_m, 2), round(row.healthy_position_m, 2),
                round(row.gps_m, 2), round(row.heading_deg, 2), round(row.compass_deg, 2), round(row.speed_mps, 3),
                round(row.nis, 2), f"{row.nis_low:.2f}..{row.nis_high:.2f}", round(row.nees, 2),
                None if row.false_motion_frac is None else round(100.0 * row.false_motion_frac, 2),
                round(row.false_motion_s, 2), round(row.unhealthy_s, 1), row.refused,
            )
            for row in rows
        ),
        note="RMS errors against truth from the first healthy estimate on; false motion: of the time truly at rest.",
    )  # fmt: skip


def _build_world(condition: Condition) -> World:
    """The lake with nothing in it."""
    return dataclasses.replace(
        load_world("lake"),
        obstacles=(),
        actors=(),
        start=Pose2(0.0, -25.0, 0.4),
        wind=condition.wind,
        waves=condition.waves,
    )


def _steer_fans_n(plant: Plant, at_s: float) -> tuple[float, float]:
    """Left and right: nothing at rest, else ahead on the leg's heading."""
    if not REST_S <= at_s < REST_S + UNDER_WAY_S:
        return 0.0, 0.0
    heading_rad = 0.4 + math.floor((at_s - REST_S) / LEG_S) * math.pi / 3.0
    _, _, yaw_rate_radps = plant.velocity
    turn_n = 10.0 * wrap_rad(heading_rad - plant.attitude.yaw_rad) - 8.0 * yaw_rate_radps
    return clip(CRUISE_FORCE_N - turn_n, 0.0, MAX_FORCE_N), clip(CRUISE_FORCE_N + turn_n, 0.0, MAX_FORCE_N)


def _at_rest(steps: list[EstimationStep]) -> Iterator[EstimationStep]:
    """Those before which the boat lay truly still for as long as it takes to be called stopped."""
    since_s = -REST_TIME_S
    for step in steps:
        if step.speed_mps >= REST_SPEED_MPS:
            since_s = step.at_s
        elif step.at_s - since_s >= REST_TIME_S:
            yield step


def _squared_error_m2(step: EstimationStep) -> float:
    return (step.estimate.x_m - step.x_m) ** 2 + (step.estimate.y_m - step.y_m) ** 2


def _squared_fix_error_m2(step: EstimationStep, world: World) -> float:
    assert step.fix is not None
    x_m, y_m = enu_from_geodetic(
        step.fix.latitude_deg, step.fix.longitude_deg, world.origin_lat_deg, world.origin_lon_deg
    )
    return (x_m - step.x_m) ** 2 + (y_m - step.y_m) ** 2


def _rms(squares: list[float]) -> float:
    return math.sqrt(sum(squares) / len(squares)) if squares else math.nan


def _longest_run(flags: list[bool]) -> int:
    """The longest run of True."""
    longest = run = 0
    for flag in flags:
        run = run + 1 if flag else 0
        longest = max(longest, run)
    return longest


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else len(SEEDS)
    sys.stdout.write(table_text(tabulate_rows(list(estimation_table(tuple(range(1, count + 1)), ekfs=EKFS)))))
