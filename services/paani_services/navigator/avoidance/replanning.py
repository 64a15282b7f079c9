"""When the local planner makes a new plan, and from which observations. Pure."""

import math

import msgspec

from paani.clock import has_passed
from paani.config import PlannerConfig
from paani.fence_geometry import Fence
from paani.geometry import wrap_rad
from paani.messages import AisVessels, Depth, Evidence, HeadingVerdict, Odometry, RangeScan, Tracks
from paani.motion_planning import MotionPlanner, MovingObstacle, PlanningInputs
from paani_services.navigator.avoidance.fence_cells import apply_fence
from paani_services.navigator.avoidance.planner import judge_candidates, plan_motion
from paani_services.navigator.avoidance.request import PlanRequest
from paani_services.navigator.avoidance.rollout import RESIDUAL_DRIFT_MPS, BoatState, GuidanceSetpoint, Plan
from paani_services.navigator.avoidance.verdicts import tell_headings
from paani_services.navigator.mapping.ais_targets import AisTarget, locate_targets, predict_unseen_targets
from paani_services.navigator.mapping.barriers import BarrierMemory, update_barriers
from paani_services.navigator.mapping.observation import (
    ObservationMemory,
    add_track_ids,
    begins_anew,
    update_memory,
)
from paani_services.navigator.mapping.observed_cells import CELL_M, Camera
from paani_services.navigator.mapping.shallow_cells import CellNumbers, apply_shallow_cells, cells_on_grid
from paani_services.navigator.mapping.soundings import SoundingMemory, update_soundings
from paani_services.navigator.mapping.water_map import is_refuted, map_water

COURSE_TOLERANCE_RAD = math.radians(3.0)  # desired courses this near to each other share a plan
PERSON_NEAR_M = 1.5  # `advisor.people.stop_m`: nobody is so near to fans that turn


class PlanBasis(msgspec.Struct, frozen=True, kw_only=True):
    """What a plan was requested with beside the course and the water, so that the request can be made again.

    map_offset_m: east and north of the boat in the map, less those by dead reckoning. targets: vessels told by AIS.
    scan_us: stamp of the newest range scan; -1 without one.
    shallow: cells of water that is too shallow, or expected to be.
    """

    start: BoatState
    speed_mps: float
    is_pivot_only: bool
    previous: Plan | None
    may_wait: bool
    map_offset_m: tuple[float, float]
    escape_mps: float = 0.0
    targets: tuple[AisTarget, ...] = ()
    scan_us: int = -1
    shallow: CellNumbers = ()


class PlannerState(
    msgspec.Struct,
    frozen=True,
    rename={"advised_side": "side", "waiting_since_us": "waits_us", "frame_id": "frame", "basis": "request"},
):
    """The remembered observations and soundings, and the plan in force. Recorded under the field names of `rename`.

    course_rad, advised_side, planned_us, frame_id: the setpoint, time and newest frame for which the plan was made.
    waiting_since_us: since when no plan has led the boat onward.
    obstacle_track_ids: the advisor's tracks of the dynamic obstacles that the plan was made for.
    basis: what the plan was made from; None where another planner made it.
    barriers: what stood in the water where the boat has been, in the frame of the memory.
    is_nobody_near: whether a recent picture showed the water then, and no person might be within `PERSON_NEAR_M`.
    """

    memory: ObservationMemory = ObservationMemory()
    plan: Plan | None = None
    course_rad: float = 0.0
    advised_side: float = 0.0
    planned_us: int = 0
    waiting_since_us: int | None = None
    frame_id: tuple[int, int] = (-1, -1)
    obstacle_track_ids: tuple[int, ...] = ()
    basis: PlanBasis | None = None
    is_nobody_near: bool = False
    soundings: SoundingMemory = SoundingMemory()
    barriers: BarrierMemory = BarrierMemory()


def observe(
    state: PlannerState,
    odometry: Odometry | None,
    evidence: Evidence | None,
    config: PlannerConfig,
    tracks: Tracks | None = None,
    scan: RangeScan | None = None,
    depth: Depth | None = None,
    now_us: int = 0,
) -> PlannerState:
    """Add what is new to the planner's memory: odometry, evidence of another frame and its tracks, scan, sounding."""
    memory = update_memory(state.memory, odometry, evidence, config, scan)
    soundings = update_soundings(state.soundings, depth, memory, odometry, now_us, config)
    barriers = BarrierMemory() if begins_anew(memory, state.memory) else state.barriers
    memory = add_track_ids(memory, evidence, tracks)
    return msgspec.structs.replace(state, memory=memory, soundings=soundings, barriers=barriers)


def replan(
    state: PlannerState,
    odometry: Odometry,
    setpoint: GuidanceSetpoint,
    now_us: int,
    camera: Camera,
    config: PlannerConfig,
    fence: Fence = (),
    planner: MotionPlanner | None = None,
    ais: AisVessels | None = None,
) -> tuple[PlannerState, Plan]:
    """The plan for this setpoint, within the fence and no faster than the setpoint allows; by `planner` where given.

    One that is faster than was asked for when it was made leads out of the way of what comes to the boat.

    A new plan is made for a new frame, another course or advised side, or after `replan_s`. Without an odometry pose
    the boat stops.
    """
    here = state.memory.odom_pose
    if here is None:
        return state, Plan(odometry.yaw_rad, 0.0)
    plan = state.plan
    if plan is None or _is_plan_due(state, setpoint, now_us, config):
        velocity = (odometry.surge_mps, odometry.yaw_rate_radps, odometry.sway_mps)
        since_us = now_us if state.waiting_since_us is None else min(state.waiting_since_us, now_us)
        basis = PlanBasis(
            start=BoatState(here.x_m, here.y_m, odometry.yaw_rad, *velocity),
            speed_mps=setpoint.speed_mps,
            is_pivot_only=setpoint.is_pivot_only,
            previous=plan,
            may_wait=(now_us - since_us) * 1e-6 < config.patience_s,
            map_offset_m=(odometry.x_m - here.x_m, odometry.y_m - here.y_m),
            escape_mps=setpoint.escape_mps,
            targets=locate_targets(ais, odometry, here, now_us, config),
            scan_us=state.memory.scans[-1].stamp_us if state.memory.scans else -1,
            shallow=cells_on_grid(state.soundings.cells, (here.x_m, here.y_m)),
        )
        request = _request_plan(state.memory, basis, setpoint, now_us, camera, config, fence)
        plan = plan_motion(request) if planner is None else Plan(*planner(_planning_inputs(request)))
        state = PlannerState(
            state.memory,
            plan,
            setpoint.course_rad,
            setpoint.advised_side,
            now_us,
            since_us if plan.is_waiting or plan.speed_mps == 0.0 else None,
            state.memory.frame_id,
            tuple(sorted({obstacle.track_id for obstacle in request.obstacles} - {0})),
            basis if planner is None else None,
            request.grid.is_recent and request.nearest_person_m() >= PERSON_NEAR_M,
            state.soundings,
            update_barriers(state.barriers, request.grid, now_us),
        )
    is_escape = state.basis is not None and plan.speed_mps > state.basis.speed_mps
    allowed_mps = max(setpoint.speed_mps, setpoint.escape_mps) if is_escape else setpoint.speed_mps
    return state, msgspec.structs.replace(plan, speed_mps=min(plan.speed_mps, allowed_mps))


def explain_plan(
    state: PlannerState, camera: Camera, config: PlannerConfig, fence: Fence = ()
) -> tuple[HeadingVerdict, ...]:
    """Why the plan in force took or refused each heading: the planner is asked again what it was asked then.

    Empty where another planner made the plan, and where the memory does not lead to it any more.
    """
    basis = state.basis
    if basis is None or state.frame_id != state.memory.frame_id:
        return ()
    setpoint = GuidanceSetpoint(
        state.course_rad, basis.speed_mps, state.advised_side, basis.is_pivot_only, basis.escape_mps
    )
    judged = judge_candidates(_request_plan(state.memory, basis, setpoint, state.planned_us, camera, config, fence))
    return tell_headings(judged) if judged is not None and judged.cheapest_plan() == state.plan else ()


def _request_plan(
    memory: ObservationMemory,
    basis: PlanBasis,
    setpoint: GuidanceSetpoint,
    now_us: int,
    camera: Camera,
    config: PlannerConfig,
    fence: Fence,
) -> PlanRequest:
    """The request on the water as it is remembered: the grid ends at the fence."""
    start = basis.start
    scans = tuple(each for each in memory.scans if each.stamp_us <= basis.scan_us)
    grid, seen = map_water(memory.observations, start[:2], now_us, camera, config, scans)
    unseen = predict_unseen_targets(basis.targets, seen, start[:3], camera.calibration)
    return PlanRequest(
        grid=apply_shallow_cells(apply_fence(grid, fence, basis.map_offset_m), basis.shallow),
        start=start,
        setpoint=setpoint,
        config=config,
        obstacles=seen,
        ais_vessels=tuple(each for each in unseen if not is_refuted(each, grid)),
        previous=basis.previous,
        may_wait=basis.may_wait,
    )


def _is_plan_due(state: PlannerState, setpoint: GuidanceSetpoint, now_us: int, config: PlannerConfig) -> bool:
    """Whether the frame, the course or the advised side is another, or the plan is `replan_s` old."""
    is_other_course = abs(wrap_rad(setpoint.course_rad - state.course_rad)) > COURSE_TOLERANCE_RAD
    is_other = setpoint.advised_side != state.advised_side or state.memory.frame_id != state.frame_id
    return is_other or is_other_course or has_passed(state.planned_us, config.replan_s * 1e6, now_us)


def _planning_inputs(request: PlanRequest) -> PlanningInputs:
    grid, start, config, previous = request.grid, request.start, request.config, request.previous
    return PlanningInputs(
        start.x_m,
        start.y_m,
        start.yaw_rad,
        start.surge_mps,
        start.yaw_rate_radps,
        request.setpoint.course_rad,
        min(request.setpoint.speed_mps, config.speed_mps),
        None if previous is None else previous.heading_rad,
        grid.occupied,
        grid.west_m,
        grid.south_m,
        CELL_M,
        tuple(
            MovingObstacle(each.east_m, each.north_m, each.velocity.east_mps, each.velocity.north_mps)
            for each in request.obstacles
            if each.age_s <= config.unseen_s
        ),
    )


def is_braking(state: PlannerState, odometry: Odometry, now_us: int, config: PlannerConfig) -> bool:
    """Whether a boat whose plan is to stop is still ordered to brake, instead of getting no thrust at all.

    It brakes for at most `brake_s`, and only while its surge is more than what wind and current may cause.
    """
    since_us = state.waiting_since_us
    has_just_stopped = since_us is not None and not has_passed(since_us, config.brake_s * 1e6, now_us)
    return has_just_stopped and odometry.surge_mps > RESIDUAL_DRIFT_MPS
