"""What people are shown of the navigator's intent: the way ahead, what it meets, home. Pure; it decides nothing."""

import math

import numpy as np

from paani.clock import has_passed
from paani.config import NavigatorConfig
from paani.geometry import wrap_rad
from paani.messages import (
    EncounterClass,
    HeadingVerdict,
    LegKind,
    Mission,
    MovingObstacle,
    NavCommand,
    Odometry,
    Prediction,
    Waypoint,
)
from paani_services.navigator.avoidance.courtesy import Encounter, assess_encounter, describe_encounter
from paani_services.navigator.avoidance.replanning import PlannerState, explain_plan
from paani_services.navigator.avoidance.rollout import BoatState, roll_out
from paani_services.navigator.mapping.ais_targets import predict_unseen_targets
from paani_services.navigator.mapping.dynamic_obstacles import find_dynamic_obstacles
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.mapping.scanned_obstacles import scan_water
from paani_services.navigator.navigate import NavigatorState

PLAN_MAX_AGE_US = 1_000_000  # of a plan whose reasons are told; the boat is not steered by an older one
EVERY = 3  # steps of the rollout between two points that are drawn


def predict(
    state: NavigatorState,
    order: NavCommand,
    odometry: Odometry | None,
    mission: Mission | None,
    now_us: int,
    camera: Camera,
    config: NavigatorConfig,
    before: Prediction | None = None,
) -> Prediction:
    """From the state after a step and its order. Without a position there is nothing to draw but home.

    before: the prediction before this one; encounters that it names keep their class until they are past.
    """
    home = _home(state, mission)
    if odometry is None:
        return Prediction(source_us=now_us, home=home)
    path = _roll_out_order(order, odometry, config) if order.enable else ()
    encounters: list[Encounter] = []
    boat = _boat_among_obstacles(state.planner_state, odometry)
    if config.planner.acts_on(camera.calibration) and config.planner.predict and boat is not None:
        encounters = _encounters(state.planner_state, boat, now_us, camera, config, before)
    courtesy = ""
    if boat is not None and encounters:
        nearest = min(encounters, key=lambda each: (each.kind is EncounterClass.NONE, each.approach.tcpa_s))
        courtesy = describe_encounter(nearest, boat, order)
    obstacles = tuple(_on_map(each, boat, odometry) for each in encounters if boat is not None)
    headings: tuple[HeadingVerdict, ...] = ()
    if not has_passed(state.planner_state.planned_us, PLAN_MAX_AGE_US, now_us):
        fence = mission.bounds if mission is not None else ()
        headings = explain_plan(state.planner_state, camera, config.planner, fence)
    return Prediction(
        source_us=odometry.source_us,
        path=path,
        obstacles=obstacles,
        home=home,
        courtesy=courtesy,
        headings=headings,
        soundings=state.planner_state.soundings.status,
        depth_m=state.planner_state.soundings.depth_m,
    )


def _home(state: NavigatorState, mission: Mission | None) -> tuple[Waypoint, ...]:
    """The mission's own home, else where the boat was first free to move."""
    for leg in mission.legs if mission is not None else ():
        if leg.kind is LegKind.RETURN_HOME and leg.waypoints:
            return leg.waypoints[-1:]
    if mission is not None and mission.home:
        return mission.home
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


def _boat_among_obstacles(planner: PlannerState, odometry: Odometry) -> BoatState | None:
    """The boat in the frame of dead reckoning, in which obstacles are; None before that begins."""
    here = planner.memory.odom_pose
    if here is None:
        return None
    velocity = (odometry.surge_mps, odometry.yaw_rate_radps, odometry.sway_mps)
    return BoatState(here.x_m, here.y_m, odometry.yaw_rad, *velocity)


def _encounters(
    planner: PlannerState,
    boat: BoatState,
    now_us: int,
    camera: Camera,
    config: NavigatorConfig,
    before: Prediction | None,
) -> list[Encounter]:
    """Those with the obstacles that the plan was made for. What has no name, as an echo, is classified each time."""
    is_old = has_passed(planner.planned_us, PLAN_MAX_AGE_US, now_us)
    targets = planner.basis.targets if planner.basis is not None and not is_old else ()
    scanned = scan_water(planner.memory.scans, now_us, config.planner)
    met = scanned.obstacles if scanned is not None and not is_old else ()
    if not planner.obstacle_track_ids and not targets and not met:
        return []
    named = [each for each in before.obstacles if each.track_id or each.mmsi] if before is not None else []
    classes = {(each.track_id, each.mmsi): each.encounter for each in named}
    seen = find_dynamic_obstacles(planner.memory.observations, now_us, camera, config.planner)
    unseen = predict_unseen_targets(targets, seen, boat[:3], camera.calibration)
    return [
        assess_encounter(each, boat, classes.get((each.track_id, each.mmsi), EncounterClass.NONE))
        for each in (*seen, *met, *unseen)
        if each.mmsi or each.is_scanned or each.track_id in planner.obstacle_track_ids
    ]


def _on_map(encounter: Encounter, boat: BoatState, odometry: Odometry) -> MovingObstacle:
    obstacle = encounter.obstacle
    east_m, north_m = obstacle.east_m, obstacle.north_m
    middle_m = math.fsum(east_m) / east_m.size, math.fsum(north_m) / north_m.size
    return MovingObstacle(
        track_id=obstacle.track_id,
        x_m=middle_m[0] + odometry.x_m - boat.x_m,
        y_m=middle_m[1] + odometry.y_m - boat.y_m,
        radius_m=float(np.max(np.hypot(east_m - middle_m[0], north_m - middle_m[1]))),
        east_mps=obstacle.velocity.east_mps,
        north_mps=obstacle.velocity.north_mps,
        velocity_std_mps=obstacle.velocity.deviation_mps,
        age_s=max(0.0, obstacle.age_s),
        cpa_m=encounter.approach.cpa_m,
        cpa_std_m=max(0.0, encounter.cpa_std_m),
        tcpa_s=encounter.approach.tcpa_s,
        encounter=encounter.kind,
        mmsi=obstacle.mmsi,
        is_scanned=obstacle.is_scanned,
    )
