"""Flat water with bars across it, as the calibrated camera of the simulator would report it."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from paani import messages as m
from paani.config import PlannerConfig, calibration_of, load_config
from paani_services.navigator.avoidance.planner import judge_candidates, plan_motion
from paani_services.navigator.avoidance.request import PlanRequest
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint, Plan, Trajectories
from paani_services.navigator.avoidance.verdicts import tell_headings
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.observation import ObservationMemory, update_memory
from paani_services.navigator.mapping.observed_cells import CELL_M, Camera
from paani_services.navigator.mapping.occupancy_grid import OccupancyGrid, build_occupancy_grid
from paani_sim.eye.camera import BoatPose, camera_pose, project
from paani_sim.eye.configured_camera import build_camera

CONFIG = load_config()
CAMERA = Camera(calibration_of(CONFIG.eye))
PLANNER = CONFIG.navigator.planner
EYE = build_camera(CONFIG.eye)
ROWS, COLUMNS = 64, 80
START_US = 5_000_000
Bar = tuple[float, float, float, float]  # west, south, east, north [m] of an obstacle in the water
FAR_M = 500.0
AT_REST, EMPTY_MEMORY = BoatPose(0.0, 0.0, 0.0), ObservationMemory()
ASTERN = BoatPose(0.0, 0.0, 2.5)  # the camera looks away from what lies ahead


def distance_to_bar_m(x_m: float, y_m: float, bar: Bar) -> float:
    """From a place to the nearest point of a bar; 0 inside it."""
    west, south, east, north = bar
    return math.hypot(max(west - x_m, 0.0, x_m - east), max(south - y_m, 0.0, y_m - north))


def water_edge_of(boat: BoatPose, bars: tuple[Bar, ...] = (), bank_m: float = FAR_M) -> tuple[float, ...]:
    """`Evidence.water_edge` of bars in a pool with its bank `bank_m` away; each column ends at its lowest bar."""
    position, turn = camera_pose(boat, EYE)
    right = ((np.arange(COLUMNS) + 0.5) / COLUMNS - 0.5) * EYE.width_px
    up = (0.5 - (np.arange(ROWS) + 0.5) / ROWS) * EYE.height_px
    pixels = np.stack(np.broadcast_arrays(right[None, :], up[:, None], -EYE.focal_px))
    east, north, fall = np.einsum("ij,jrc->irc", turn * np.array([1.0, 1.0, -1.0])[:, None], pixels)
    below = np.maximum(fall, 1e-9)
    x_m, y_m = position[0] + position[2] / below * east, position[1] + position[2] / below * north
    ends = (fall <= 0.0) | (np.hypot(x_m - position[0], y_m - position[1]) > bank_m)
    for west, south, east_m, north_m in bars:
        ends |= (x_m >= west) & (x_m <= east_m) & (y_m >= south) & (y_m <= north_m)
    lowest = ROWS - ends[::-1].argmax(axis=0)
    return tuple(np.where(ends.any(axis=0), lowest / ROWS, 0.0).tolist())


def detection_of(bar: Bar, high_m: float, label: m.Label = m.Label.PERSON, foot_m: float = 0.0) -> m.Detection:
    """The box of an obstacle with this footprint, for a boat at rest. foot_m: height of its foot above the water."""
    west, south, east, north = bar
    corners = np.array([[x, y, z] for x in (west, east) for y in (south, north) for z in (foot_m, foot_m + high_m)])
    across, down = project(corners, AT_REST, EYE).T / np.array([[EYE.width_px], [EYE.height_px]])
    box = (float(across.min()), float(down.min()), float(across.max()), float(down.max()))
    return m.Detection(label=label, confidence=0.9, box_xyxy=box)


def evidence(at_us: int, edge: tuple[float, ...], **changes: object) -> m.Evidence:
    """Usable evidence of a frame taken at this time."""
    given: dict[str, object] = {
        "source_us": at_us,
        "frame_seq": at_us // 1000,
        "frame_epoch": 1,
        "width_px": 320,
        "height_px": 240,
        "usable": True,
        "navigation_eligible": True,
        "segmentation": m.SegmentationSource.LEARNED,
        "water_edge": edge,
    }
    return m.Evidence(**(given | changes))  # type: ignore[arg-type]


def odometry(at_us: int, boat: BoatPose, surge_mps: float = 0.0, **changes: object) -> m.Odometry:
    """Healthy odometry of a boat with this pose."""
    given: dict[str, object] = {
        "source_us": at_us,
        "epoch": 1,
        "x_m": boat.x_m,
        "y_m": boat.y_m,
        "yaw_rad": boat.yaw_rad,
        "roll_rad": boat.roll_rad,
        "pitch_rad": boat.pitch_rad,
        "surge_mps": surge_mps,
        "healthy": True,
    }
    return m.Odometry(**(given | changes))  # type: ignore[arg-type]


def observe_from(
    boat: BoatPose = AT_REST,
    edge: tuple[float, ...] | None = None,
    at_us: int = START_US,
    memory: ObservationMemory = EMPTY_MEMORY,
    **changes: object,
) -> ObservationMemory:
    """The memory after one more picture from this pose; of open water by default."""
    water_edge = edge if edge is not None else water_edge_of(boat)
    memory = move_to(memory, at_us, boat)
    return update_memory(memory, None, evidence(at_us, water_edge, **changes), PLANNER)


@functools.cache
def open_water() -> OccupancyGrid:
    """What a boat at rest maps of open water."""
    return build_occupancy_grid(observe_from().observations, (0.0, 0.0), START_US, CAMERA, PLANNER)


def observe_then_look_astern(
    seconds: float, thing: m.Detection, edge: tuple[float, ...] | None = None
) -> tuple[ObservationMemory, int]:
    """The memory of a boat that saw this ahead three times and has looked astern since, and the time by then."""
    memory, at_us = EMPTY_MEMORY, START_US
    for _ in range(3):
        memory, at_us = observe_from(edge=edge, at_us=at_us, memory=memory, detections=(thing,)), at_us + 800_000
    for _ in range(round(seconds / 0.8)):
        memory, at_us = observe_from(ASTERN, at_us=at_us, memory=memory), at_us + 800_000
    return memory, at_us - 800_000


def move_to(memory: ObservationMemory, at_us: int, boat: BoatPose) -> ObservationMemory:
    """The memory of a boat that has moved to this pose, with odometry ten times a second."""
    while memory.odom_pose is not None and memory.odom_pose.stamp_us < at_us:
        here = memory.odom_pose
        step_us = min(at_us - here.stamp_us, 100_000)
        part = step_us / (at_us - here.stamp_us)
        travelled_m = (boat.x_m - here.x_m, boat.y_m - here.y_m)
        cos, sin = np.cos(boat.yaw_rad), np.sin(boat.yaw_rad)
        speed = part * 1e6 / step_us
        surge, sway = (
            speed * (cos * travelled_m[0] + sin * travelled_m[1]),
            speed * (cos * travelled_m[1] - sin * travelled_m[0]),
        )
        memory = update_memory(
            memory, odometry(here.stamp_us + step_us, boat, float(surge), sway_mps=float(sway)), None, PLANNER
        )
    return memory if memory.odom_pose is not None else update_memory(memory, odometry(at_us, boat), None, PLANNER)


def static_distances_m(grid: OccupancyGrid, trajectories: Trajectories) -> np.ndarray:
    """Distances from each position of one trajectory to the middle of the nearest occupied cell [times]."""
    rows, columns = np.nonzero(grid.occupied)
    x_m, y_m = grid.west_m + CELL_M * (columns + 0.5), grid.south_m + CELL_M * (rows + 0.5)
    gaps_m: np.ndarray = np.hypot(trajectories.x_m - x_m, trajectories.y_m - y_m).min(axis=1, initial=np.inf)
    return gaps_m


def pool(*bars: Bar, bank_m: float = 500.0) -> OccupancyGrid:
    """The grid of a boat at the origin that has just taken a picture along x."""
    memory = observe_from(edge=water_edge_of(AT_REST, bars, bank_m))
    return build_occupancy_grid(memory.observations, (0.0, 0.0), START_US, CAMERA, PLANNER)


def request_on(
    grid: OccupancyGrid,
    start: BoatState,
    setpoint: GuidanceSetpoint,
    previous: Plan | None = None,
    config: PlannerConfig = PLANNER,
    obstacles: Sequence[DynamicObstacle] = (),
    *,
    may_wait: bool = True,
) -> PlanRequest:
    """What the planner is asked on this water."""
    return PlanRequest(
        grid=grid,
        start=start,
        setpoint=setpoint,
        config=config,
        obstacles=obstacles,
        previous=previous,
        may_wait=may_wait,
    )


def plan_on(*water: Any, **options: Any) -> Plan:
    """The plan for what `request_on` makes of the same."""
    return plan_motion(request_on(*water, **options))


def explain_motion(*water: Any, **options: Any) -> tuple[Plan, tuple[m.HeadingVerdict, ...]]:
    """The plan that `plan_on` makes of the same, and its verdict on each heading, the desired course first."""
    judged = judge_candidates(request_on(*water, **options))
    assert judged is not None
    return judged.cheapest_plan(), tell_headings(judged)
