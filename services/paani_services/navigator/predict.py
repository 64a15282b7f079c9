"""What the map shows of the navigator's intent: the way ahead, moving obstacles, home. Pure; it decides nothing."""

import math

import numpy as np

from paani.config import NavigatorConfig
from paani.geometry import wrap_rad
from paani.messages import LegKind, Mission, MovingObstacle, NavCommand, Odometry, Prediction, Waypoint
from paani_services.navigator.avoidance.replanning import PlannerState
from paani_services.navigator.avoidance.rollout import BoatState, roll_out
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle, find_dynamic_obstacles
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.navigate import NavigatorState

EVERY = 3  # steps of the rollout between two points that are drawn


def predict(
    state: NavigatorState,
    order: NavCommand,
    odometry: Odometry | None,
    mission: Mission | None,
    now_us: int,
    camera: Camera,
    config: NavigatorConfig,
) -> Prediction:
    """From the state after a step and its order. Without a position there is nothing to draw but home."""
    home = _home(state, mission)
    if odometry is None:
        return Prediction(source_us=now_us, home=home)
    path = _roll_out_order(order, odometry, config) if order.enable else ()
    obstacles: tuple[MovingObstacle, ...] = ()
    if config.planner.acts_on(camera.calibration) and config.planner.predict:
        obstacles = _moving_obstacles(state.planner_state, odometry, now_us, camera, config)
    return Prediction(source_us=odometry.source_us, path=path, obstacles=obstacles, home=home)


def _home(state: NavigatorState, mission: Mission | None) -> tuple[Waypoint, ...]:
    """The mission's own home, else where the boat was first free to move."""
    for leg in mission.legs if mission is not None else ():
        if leg.kind is LegKind.RETURN_HOME and leg.waypoints:
            return leg.waypoints[-1:]
    return () if state.progress.home is None else (state.progress.home,)


def _roll_out_order(order: NavCommand, odometry: Odometry, config: NavigatorConfig) -> tuple[Waypoint, ...]:
    """The boat's way within the planner's horizon, by its own limits."""
    velocity = (odometry.surge_mps, odometry.yaw_rate_radps, odometry.sway_mps)
    start = BoatState(odometry.x_m, odometry.y_m, odometry.yaw_rad, *velocity)
    offsets_rad = np.array([wrap_rad(order.heading_rad - odometry.yaw_rad)])
    rolled = roll_out(start, offsets_rad, np.array([order.speed_mps]), config.planner)
    last = round(config.planner.horizon_s / config.planner.step_s) + 1
    points = zip(rolled.x_m[:last:EVERY, 0], rolled.y_m[:last:EVERY, 0], strict=True)
    return tuple(Waypoint(x_m=float(x_m), y_m=float(y_m)) for x_m, y_m in points)


def _moving_obstacles(
    planner: PlannerState, odometry: Odometry, now_us: int, camera: Camera, config: NavigatorConfig
) -> tuple[MovingObstacle, ...]:
    """Those that the plan was made for, moved from the frame of dead reckoning to the map."""
    here = planner.memory.odom_pose
    if here is None or not planner.obstacle_track_ids:
        return ()
    to_map_m = odometry.x_m - here.x_m, odometry.y_m - here.y_m
    found = find_dynamic_obstacles(planner.memory.observations, now_us, camera, config.planner)
    return tuple(_on_map(each, to_map_m) for each in found if each.track_id in planner.obstacle_track_ids)


def _on_map(obstacle: DynamicObstacle, to_map_m: tuple[float, float]) -> MovingObstacle:
    east_m, north_m = obstacle.east_m, obstacle.north_m
    middle_m = math.fsum(east_m) / east_m.size, math.fsum(north_m) / north_m.size
    return MovingObstacle(
        track_id=obstacle.track_id,
        x_m=middle_m[0] + to_map_m[0],
        y_m=middle_m[1] + to_map_m[1],
        radius_m=float(np.max(np.hypot(east_m - middle_m[0], north_m - middle_m[1]))),
        east_mps=obstacle.velocity.east_mps,
        north_mps=obstacle.velocity.north_mps,
        velocity_std_mps=obstacle.velocity.deviation_mps,
        age_s=max(0.0, obstacle.age_s),
    )
