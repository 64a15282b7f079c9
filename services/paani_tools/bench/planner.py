"""What the navigator's planner costs: mapping the water and choosing a plan, among moving obstacles."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from paani import messages as m
from paani.clock import process_cpu_s
from paani.config import CalibrationConfig, Config, calibration_of
from paani.decider import decider_of
from paani.logs.reader import open_log
from paani.statistics.figure_table import Cell, FigureTable
from paani.statistics.order_statistics import nearest_rank
from paani_services.navigator.avoidance.planner import plan_motion
from paani_services.navigator.avoidance.request import PlanRequest
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.mapping.observation import ObservationMemory, update_memory
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.mapping.occupancy_grid import LEVEL_POSE
from paani_services.navigator.mapping.projection import PinholeCamera, pinhole_at
from paani_services.navigator.mapping.water_map import map_water
from paani_tools.replay.compatibility import provenance_of
from paani_tools.replay.ledger import Ledger
from paani_tools.replay.recompute import Recomputation
from paani_tools.replay.verify import recording_facts

OBSTACLES = 12  # the bar of the planning step is for so many
MEMORY_S = 33.0  # of pictures before the first step that counts: nothing that is remembered is older
PERIOD_US, START_US = 200_000, 1_000_000_000
BOAT_MPS = 0.4  # the obstacles keep abreast of the boat: each moves, and stays in the picture
COLUMNS, WIDTH_PX, HEIGHT_PX = 80, 320, 240
NEAREST_M, FURTHEST_M, ABREAST_DEG = 4.0, 9.0, 28.0  # of the obstacles from the boat, and off its bow
SWAY_M, SWAY_S = 0.3, 20.0  # how far each goes to and fro, and how long that takes
SHAPES = {m.Label.VESSEL: (0.6, 0.5), m.Label.PERSON: (0.25, 0.4)}  # half of its width, and height [m]
BANK_M = 200.0
COURSES_RAD = (0.0, 0.5, -0.5, 1.5, -1.5)  # asked for in turn
PERCENTS = (50, 95, 99)
COLUMN_NAMES = ("part", *(f"p{each} ms" for each in PERCENTS), "steps", "obstacles p50")
CPU_NOTE = "time of the process's own CPU"


def plan_among_obstacles(config: Config, steps: int) -> FigureTable:
    """The steps that follow `MEMORY_S` of pictures of 12 vessels and swimmers under way, each with a new picture.

    The first, which sees all of them for the first time, does not count. A camera that nobody has calibrated is the
    simulator's.
    """
    calibration = config.calibration if config.calibration.valid else calibration_of(config.eye)
    planner, camera = config.navigator.planner, Camera(calibration, config.perception.ego_polygon)
    memory, plan, courses = ObservationMemory(), Plan(0.0, BOAT_MPS), itertools.cycle(COURSES_RAD)
    counts, found = list[int](), list[tuple[float, float]]()
    for number in range(round(MEMORY_S * 1e6 / PERIOD_US) + 1 + steps):
        now_us = START_US + number * PERIOD_US
        for pose_us in (now_us - PERIOD_US // 2, now_us):
            memory = update_memory(memory, _odometry(pose_us), None, planner)
        memory = update_memory(memory, None, _crowded_evidence(now_us, calibration), planner)
        here = memory.odom_pose
        if now_us < START_US + MEMORY_S * 1e6 or here is None:
            continue
        start = BoatState(here.x_m, here.y_m, here.yaw_rad, BOAT_MPS)
        begin_s = process_cpu_s()
        grid, obstacles = map_water(memory.observations, start[:2], now_us, camera, planner)
        mapped_s, setpoint = process_cpu_s(), GuidanceSetpoint(next(courses), BOAT_MPS)
        plan = plan_motion(
            PlanRequest(grid=grid, start=start, setpoint=setpoint, config=planner, obstacles=obstacles, previous=plan)
        )
        found.append((mapped_s - begin_s, process_cpu_s() - mapped_s))
        counts.append(len(obstacles))
    mapping_s, planning_s = zip(*found[1:], strict=True)
    parts = {"map": mapping_s, "plan": planning_s, "step": [sum(each) for each in found[1:]]}
    return FigureTable(
        name=f"planning step, {MEMORY_S:g} s of memory",
        columns=COLUMN_NAMES,
        rows=tuple((*_row(name, spent_s), nearest_rank(counts, 50)) for name, spent_s in parts.items()),
        note=CPU_NOTE,
    )


def plan_recorded(drives: list[Path]) -> FigureTable:
    """The navigator's steps of recorded drives that made a plan. Raises UserError for a log that cannot be read."""
    rows = []
    for drive in drives:
        spent_s, counts = list[float](), list[int]()
        for each_s, count in _recorded_plans(drive):
            spent_s.append(each_s)
            counts.append(count)
        rows.append((*_row(drive.name, spent_s), nearest_rank(counts, 50) if counts else None))
    return FigureTable(
        name="recorded steps that made a plan",
        columns=COLUMN_NAMES,
        rows=tuple(rows),
        note=f"{CPU_NOTE}; the whole step, with reading what it had heard from the log",
    )


def _recorded_plans(drive: Path) -> Iterator[tuple[float, int]]:
    """The time of each step that made a plan, and how many obstacles with a track that was for."""
    log, decider = open_log(drive), decider_of("navigator")
    config = provenance_of(log, force=True).config
    again = Recomputation(decider, config, recording_facts(log), evolve=True)
    steps, planned_us = again.steps(log.records(Ledger(decider).topics)), 0
    while True:
        begin_s = process_cpu_s()
        if next(steps, None) is None:
            return
        spent_s, state = process_cpu_s() - begin_s, again.state
        if state is not None and state.planner_state.planned_us != planned_us:
            planned_us = state.planner_state.planned_us
            yield spent_s, len(state.planner_state.obstacle_track_ids)


def _row(name: str, spent_s: Sequence[float]) -> tuple[Cell, ...]:
    figures = (1e3 * nearest_rank(spent_s, percent) if spent_s else None for percent in PERCENTS)
    return (name, *figures, len(spent_s))


def _odometry(at_us: int) -> m.Odometry:
    x_m = BOAT_MPS * (at_us - START_US) * 1e-6
    return m.Odometry(source_us=at_us, epoch=1, x_m=x_m, y_m=0.0, yaw_rad=0.0, surge_mps=BOAT_MPS, healthy=True)


def _crowded_evidence(at_us: int, calibration: CalibrationConfig) -> m.Evidence:
    """What the calibrated camera shows of the obstacles and of the bank behind them."""
    camera = pinhole_at(LEVEL_POSE, calibration, WIDTH_PX / HEIGHT_PX)
    edge = [_in_picture(camera, BANK_M, 0.0, 0.0)[1]] * COLUMNS
    boxes = [_box(camera, number, (at_us - START_US) * 1e-6) for number in range(OBSTACLES)]
    for box in boxes:
        left, _, right, foot = box.box_xyxy
        for column in range(math.floor(left * COLUMNS), min(math.ceil(right * COLUMNS), COLUMNS)):
            edge[column] = max(edge[column], foot)
    return m.Evidence(
        source_us=at_us,
        frame_seq=(at_us - START_US) // PERIOD_US,
        frame_epoch=1,
        width_px=WIDTH_PX,
        height_px=HEIGHT_PX,
        usable=True,
        navigation_eligible=True,
        segmentation=m.SegmentationSource.LEARNED,
        detections=tuple(boxes),
        water_edge=tuple(edge),
    )


def _box(camera: PinholeCamera, number: int, time_s: float) -> m.Detection:
    """Of one obstacle: they lie spread over the picture and over its depth."""
    label = m.Label.PERSON if number % 3 == 0 else m.Label.VESSEL
    half_m, high_m = SHAPES[label]
    part = number / (OBSTACLES - 1)
    bearing_rad = math.radians(ABREAST_DEG * (2.0 * part - 1.0))
    range_m = NEAREST_M + (FURTHEST_M - NEAREST_M) * (number * 5 % OBSTACLES) / (OBSTACLES - 1)
    x_m, y_m = range_m * math.cos(bearing_rad), range_m * math.sin(bearing_rad)
    y_m += SWAY_M * math.sin(2.0 * math.pi * (time_s / SWAY_S + part))
    (left, foot), (right, _) = (_in_picture(camera, x_m, y_m + side * half_m, 0.0) for side in (1.0, -1.0))
    top = _in_picture(camera, x_m, y_m, high_m)[1]
    sides = tuple(min(max(each, 0.0), 1.0) for each in (left, top, right, foot))
    return m.Detection(label=label, confidence=0.9, box_xyxy=(sides[0], sides[1], sides[2], sides[3]))


def _in_picture(camera: PinholeCamera, x_m: float, y_m: float, z_m: float) -> tuple[float, float]:
    """Where the camera shows a point, as fractions of the picture's width and height."""
    there = [at_m - from_m for at_m, from_m in zip((x_m, y_m, z_m), camera.position_m, strict=True)]
    outward, right, down = (
        sum(row[axis] * each for row, each in zip(camera.rotation, there, strict=True)) for axis in range(3)
    )
    focal, centre = camera.focal, camera.centre
    return centre[0] + focal[0] * right / outward, centre[1] + focal[1] * down / outward
