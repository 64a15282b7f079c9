"""The navigator's step: advice, mission and estimate to one order. Pure: no clock, no bus, no logging.

The advice is a veto: no mission, fence or planner moves the boat where it is STOP or NO_DATA. Everything that forbids
motion is named in the order's `inhibits`; an order that moves the boat has none.
"""

import math

import msgspec

from paani.clock import has_passed
from paani.config import NavigatorConfig
from paani.fence_geometry import Fence, is_allowed
from paani.geometry import wrap_rad
from paani.map_origin import MapPlace, map_place_of
from paani.messages import (
    Advisory,
    AisVessels,
    Direction,
    Inhibit,
    Mission,
    NavCommand,
    Odometry,
)
from paani.motion_planning import MotionPlanner
from paani_services.navigator.avoidance.constraints import HALF_FIELD_OF_VIEW_RAD
from paani_services.navigator.avoidance.fence import limit_speed
from paani_services.navigator.avoidance.replanning import (
    COURSE_TOLERANCE_RAD,
    PlannerState,
    is_braking,
    observe,
    replan,
)
from paani_services.navigator.avoidance.rollout import GuidanceSetpoint
from paani_services.navigator.guidance.headway import Headway, is_barred, note_headway
from paani_services.navigator.guidance.ilos import IlosState, hold_integral, integrate
from paani_services.navigator.guidance.mission_progress import (
    LegSetpoint,
    MissionInputs,
    MissionProgress,
    advance_mission,
    compute_leg_setpoint,
    describe_leg,
)
from paani_services.navigator.guidance.passed_obstacles import PassedObstacles, limit_course_rad, remember_obstacles
from paani_services.navigator.guidance.station_keeping import (
    Station,
    StationSetpoint,
    hold_station,
    may_keep_station,
    take_station,
)
from paani_services.navigator.guidance.visual_turns import (
    ON_HEADING_RAD,
    TURN_DIRECTIONS,
    TURN_SIDE,
    VisualTurn,
    constant_rate_heading_rad,
    is_turn_to_look,
    latch_heading,
)
from paani_services.navigator.interlocks import NavigatorInputs, find_inhibits
from paani_services.navigator.mapping.observation import begins_anew
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.mapping.occupancy_grid import UNCALIBRATED_CAMERA
from paani_services.navigator.way_round import course_round_rad


class NavigatorState(
    msgspec.Struct,
    frozen=True,
    rename={
        "ilos": "crab",
        "passed_obstacles": "guards",
        "planner_state": "pilot",
        "clock_advanced_us": "advanced_us",
    },
):
    """What one step leaves for the next. It is recorded under the field names given by `rename`.

    `sim_us` is the newest simulated time, -1 before the first; `clock_advanced_us` is when it last moved forward.
    `is_ordered`: an order of a mode was heard. Of HOLD or RETURN: `errand` is how far that has come, `errand_ilos` its
    integral, `errand_since_us` when it was ordered. `progress` and `ilos` are those of the mission throughout.
    `legs_us`: stamp of the legs that they count for. `station`: where the boat is kept while it stops.
    `headway`: that along its path. `map_place`: by which the map is known that mission and fence lie in.
    """

    progress: MissionProgress = MissionProgress()
    ilos: IlosState = IlosState()
    turn: VisualTurn | None = None
    passed_obstacles: PassedObstacles = PassedObstacles()
    planner_state: PlannerState = PlannerState()
    sim_us: int = -1
    clock_advanced_us: int | None = None
    is_ordered: bool = False
    errand: MissionProgress = MissionProgress()
    errand_ilos: IlosState = IlosState()
    errand_since_us: int = 0
    legs_us: int = 0
    station: Station | None = None
    headway: Headway = Headway()
    map_place: MapPlace | None = None


def navigate(
    state: NavigatorState,
    inputs: NavigatorInputs,
    mission: Mission | None,
    now_us: int,
    domain: int,
    config: NavigatorConfig,
    camera: Camera = UNCALIBRATED_CAMERA,
    planner: MotionPlanner | None = None,
) -> tuple[NavigatorState, NavCommand]:
    """One step along a mission. The order carries the advisory's `source_us` and the plant's newest stamp.

    With a valid calibration the metric planner chooses heading and speed; it never overrides an inhibit. Nor does
    `planner`, which chooses in its place.
    """
    state, inhibits = begin_step(state, inputs, now_us, domain, config, camera)
    if mission is None:
        inhibits.append(Inhibit.NO_ROUTE)
    is_planned = config.planner.acts_on(camera.calibration)
    odometry, advisory = inputs.odometry, inputs.advisory
    if odometry is None or Inhibit.UNHEALTHY_ODOMETRY in inhibits or mission is None:
        return state, build_command(state, inputs, now_us, inhibits)

    position_m = (odometry.x_m, odometry.y_m)
    direction = advisory.direction if advisory is not None else Direction.NO_DATA
    if advisory is not None and config.clear_m > 0.0:
        passed = remember_obstacles(state.passed_obstacles, advisory, odometry, config.clear_m)
        state = msgspec.structs.replace(state, passed_obstacles=passed)
    # M1, M3: a visual turn keeps its waypoint. The planner steers for the route whatever is advised.
    is_straight = not inhibits and (is_planned or direction is Direction.STRAIGHT)
    mission_inputs = MissionInputs(odometry, inputs.arming, state.sim_us, is_free=not inhibits, is_straight=is_straight)
    state = _advance_mission(state, mission, mission_inputs, config)
    setpoint = compute_leg_setpoint(state.progress, mission, state.ilos, position_m, config)
    if setpoint.inhibit is not None:
        inhibits.append(setpoint.inhibit)
    if not is_allowed(mission.bounds, position_m) and not config.fence_return:
        inhibits.append(Inhibit.OUTSIDE_FENCE)
    leg, cross_m = describe_leg(state.progress, mission), setpoint.cross_track_m
    headway = Headway() if _is_more_than_advice(inhibits) else state.headway
    headway = note_headway(headway, setpoint, state.progress.waypoints_reached, position_m, now_us)
    state = msgspec.structs.replace(state, headway=headway)
    if inhibits:
        state = hold_cross_track(state, now_us)
        state, at_station = _keep_station(state, inhibits, inputs, now_us, config, camera)
        return state, build_command(state, inputs, now_us, inhibits, at_station=at_station, cross_m=cross_m, leg=leg)
    heading_rad, limit_mps = setpoint.course_rad, speed_limit_mps(advisory)
    speed_mps = min(setpoint.speed_mps, limit_mps)
    escape_mps = min(setpoint.speed_mps * config.escape_factor, limit_mps)
    if direction in TURN_DIRECTIONS:
        state = hold_cross_track(state, now_us)
        speed_mps *= config.turn_speed_frac
        if not is_planned:
            state, heading_rad, is_capped = _steer_visual_turn(state, direction, odometry.yaw_rad, now_us, config)
            if is_capped:
                inhibits.append(Inhibit.TURN_CAPPED)
    elif not is_planned:
        # The planner remembers where things are; without it the course keeps off what was passed.
        heading_rad = limit_course_rad(setpoint.course_rad, state.passed_obstacles)
    if is_planned and not inhibits and speed_mps > 0.0:
        # The planner weighs the advised side against what the map shows.
        # It turns as slowly as every advised turn is, but for one out of the way of what comes to the boat.
        looks = is_turn_to_look(advisory)
        if is_barred(state.headway, now_us, config.planner) and not looks:
            detour_rad = course_round_rad(state.planner_state, setpoint, odometry, config.planner)
            if detour_rad is not None:
                heading_rad, leg = detour_rad, f"{leg}, by a way round what bars it"
        planner_setpoint = GuidanceSetpoint(
            heading_rad, speed_mps, TURN_SIDE.get(direction, 0.0), looks, 0.0 if looks else escape_mps
        )
        state, heading_rad, speed_mps, is_path_free = _steer_planned(
            state, odometry, planner_setpoint, now_us, camera, config, mission.bounds, planner, inputs.ais
        )
        if not is_path_free:
            inhibits.append(Inhibit.NO_FREE_PATH)
    if direction not in TURN_DIRECTIONS:
        is_on_course = abs(wrap_rad(heading_rad - setpoint.course_rad)) <= COURSE_TOLERANCE_RAD
        state = _integrate_cross_track(state, setpoint, odometry, now_us, config, is_on_course=is_on_course)
    bounded_mps = limit_speed(mission.bounds, odometry, heading_rad, min(speed_mps, limit_mps), config)
    if bounded_mps is None:
        inhibits.append(Inhibit.OUTSIDE_FENCE)
    state, at_station = _keep_station(state, inhibits, inputs, now_us, config, camera)
    return state, build_command(
        state,
        inputs,
        now_us,
        inhibits,
        heading_rad,
        bounded_mps or 0.0,
        at_station=at_station,
        cross_m=cross_m,
        leg=leg,
        obstacle_track_ids=state.planner_state.obstacle_track_ids if is_planned else (),
    )


def begin_step(
    state: NavigatorState, inputs: NavigatorInputs, now_us: int, domain: int, config: NavigatorConfig, camera: Camera
) -> tuple[NavigatorState, list[Inhibit]]:
    """What every mode begins with: the state with what this step shows, and what about the inputs forbids motion."""
    state = note_clock_advance(state, inputs, now_us)
    inhibits = find_inhibits(inputs, state.clock_advanced_us, state.map_place, now_us, domain, config)
    state = msgspec.structs.replace(state, map_place=state.map_place or map_place_of(inputs.odometry))
    if _is_more_than_advice(inhibits):
        state = msgspec.structs.replace(state, station=None)  # it lies by dead reckoning, which may have begun anew
    state = _end_visual_turn(state, inputs)
    if config.planner.acts_on(camera.calibration):
        planner_state = observe(
            state.planner_state,
            inputs.odometry,
            inputs.evidence,
            config.planner,
            inputs.tracks,
            inputs.scan,
            inputs.depth,
            now_us,
        )
        station = None if begins_anew(planner_state.memory, state.planner_state.memory) else state.station
        state = msgspec.structs.replace(state, planner_state=planner_state, station=station)
    return state, inhibits


def _is_more_than_advice(inhibits: list[Inhibit]) -> bool:
    """Whether anything but a STOP of the advice forbids motion."""
    return bool(inhibits) and inhibits != [Inhibit.ADVISED_STOP]


def _keep_station(
    state: NavigatorState,
    inhibits: list[Inhibit],
    inputs: NavigatorInputs,
    now_us: int,
    config: NavigatorConfig,
    camera: Camera,
) -> tuple[NavigatorState, StationSetpoint | None]:
    """The state with the station that is kept, and what holds the boat there; None, so no thrust, if it may not be."""
    here, odometry = state.planner_state.memory.odom_pose, inputs.odometry
    is_asked_for = config.keep_station and config.planner.acts_on(camera.calibration)
    if here is None or odometry is None or not is_asked_for:
        return state, None
    if not may_keep_station(inhibits, inputs.advisory, is_nobody_near=state.planner_state.is_nobody_near):
        return state, None
    here_m = (here.x_m, here.y_m)
    turn_rad = _interrupted_turn_rad(state, odometry.yaw_rad, now_us, config)
    station = msgspec.structs.replace(take_station(state.station, here_m, now_us, config), turn_rad=turn_rad)
    return msgspec.structs.replace(state, station=station), hold_station(station, here_m, odometry)


def _interrupted_turn_rad(state: NavigatorState, yaw_rad: float, now_us: int, config: NavigatorConfig) -> float | None:
    """The heading of the plan that the stop interrupts, if the boat does not see in that direction, until it is on it.

    Its plan is newer than the stop before, and no older than `replan_s`.
    """
    planner_state, station = state.planner_state, state.station
    if station is not None and station.stopped_us >= planner_state.planned_us:
        turn_rad, seen_rad = station.turn_rad, ON_HEADING_RAD
    else:
        plan, seen_rad = planner_state.plan, HALF_FIELD_OF_VIEW_RAD
        is_in_force = not has_passed(planner_state.planned_us, config.planner.replan_s * 1e6, now_us)
        turn_rad = plan.heading_rad if plan is not None and plan.speed_mps > 0.0 and is_in_force else None
    return turn_rad if turn_rad is not None and abs(wrap_rad(turn_rad - yaw_rad)) > seen_rad else None


def _advance_mission(
    state: NavigatorState, mission: Mission, inputs: MissionInputs, config: NavigatorConfig
) -> NavigatorState:
    """One step of the mission. The integral begins anew with another leg of it."""
    progress = advance_mission(state.progress, mission, inputs, config)
    ilos = state.ilos if progress.leg_index == state.progress.leg_index else IlosState()
    return msgspec.structs.replace(state, progress=progress, ilos=ilos)


def _steer_visual_turn(
    state: NavigatorState, direction: Direction, yaw_rad: float, now_us: int, config: NavigatorConfig
) -> tuple[NavigatorState, float, bool]:
    """The state, the heading of the advised turn, and whether the limit of the whole turn forbids it."""
    if not config.latch_turns:
        return state, constant_rate_heading_rad(direction, yaw_rad, config), False
    turn, is_capped = latch_heading(state.turn, direction, yaw_rad, now_us, config)
    return msgspec.structs.replace(state, turn=turn), turn.heading_rad, is_capped


def _steer_planned(
    state: NavigatorState,
    odometry: Odometry,
    setpoint: GuidanceSetpoint,
    now_us: int,
    camera: Camera,
    config: NavigatorConfig,
    fence: Fence,
    planner: MotionPlanner | None,
    ais: AisVessels | None,
) -> tuple[NavigatorState, float, float, bool]:
    """The state, the planner's heading and speed, and whether it has a path or is still braking for want of one."""
    planner_state, plan = replan(
        state.planner_state, odometry, setpoint, now_us, camera, config.planner, fence, planner, ais
    )
    state = msgspec.structs.replace(state, planner_state=planner_state)
    is_path_free = plan.speed_mps > 0.0 or is_braking(planner_state, odometry, now_us, config.planner)
    return state, plan.heading_rad, plan.speed_mps, is_path_free


def speed_limit_mps(advisory: Advisory | None) -> float:
    """The advised limit, which only ever lowers a speed; infinite where nothing is advised."""
    if advisory is None or isinstance(advisory.speed_limit_mps, msgspec.UnsetType):
        return math.inf
    return advisory.speed_limit_mps


def _integrate_cross_track(
    state: NavigatorState,
    setpoint: LegSetpoint,
    odometry: Odometry,
    now_us: int,
    config: NavigatorConfig,
    *,
    is_on_course: bool,
) -> NavigatorState:
    """Step the integral while the boat is ordered along its path; hold it otherwise."""
    if setpoint.path is None or config.lookahead_m <= 0.0 or not is_on_course:
        return hold_cross_track(state, now_us)
    ilos = integrate(state.ilos, setpoint.path, setpoint.target, setpoint.cross_track_m, odometry, now_us, config)
    return msgspec.structs.replace(state, ilos=ilos)


def hold_cross_track(state: NavigatorState, now_us: int) -> NavigatorState:
    """The integral stays as it is over this step."""
    return msgspec.structs.replace(state, ilos=hold_integral(state.ilos, now_us))


def note_clock_advance(state: NavigatorState, inputs: NavigatorInputs, now_us: int) -> NavigatorState:
    """Note when simulated time last moved forward.

    A time set back means that the simulation was reset and the boat may be anywhere, so it joins its route anew.
    """
    if inputs.clock is None or inputs.clock.sim_us == state.sim_us:
        return state
    sim_us = inputs.clock.sim_us
    if state.sim_us < 0:
        return msgspec.structs.replace(state, sim_us=sim_us)
    if sim_us < state.sim_us:
        return NavigatorState(
            progress=MissionProgress(waypoints_reached=state.progress.waypoints_reached), sim_us=sim_us
        )
    return msgspec.structs.replace(state, sim_us=sim_us, clock_advanced_us=now_us)


def _end_visual_turn(state: NavigatorState, inputs: NavigatorInputs) -> NavigatorState:
    """End the visual turn on STRAIGHT advice or when the boat is disarmed; a STOP between two turns does not end it."""
    is_straight = inputs.advisory is not None and inputs.advisory.direction is Direction.STRAIGHT
    is_armed = inputs.arming is not None and inputs.arming.armed and not inputs.arming.stopped
    if state.turn is not None and (is_straight or not is_armed):
        return msgspec.structs.replace(state, turn=None)
    return state


def build_command(
    state: NavigatorState,
    inputs: NavigatorInputs,
    now_us: int,
    inhibits: list[Inhibit],
    heading_rad: float = 0.0,
    speed_mps: float = 0.0,
    *,
    astern_mps: float = 0.0,
    vetoes: tuple[Inhibit, ...] = (),
    at_station: StationSetpoint | None = None,
    cross_m: float = 0.0,
    leg: str = "",
    obstacle_track_ids: tuple[int, ...] = (),
) -> NavCommand:
    """The order; one with an inhibit is disabled, whatever else is asked for, but for one that keeps the station."""
    advisory = inputs.advisory
    if at_station is not None:
        heading_rad, astern_mps = at_station
        vetoes, inhibits = tuple(inhibits), []
    enable = not inhibits
    return NavCommand(
        source_us=advisory.source_us if advisory is not None else now_us,
        enable=enable,
        heading_rad=heading_rad if enable else 0.0,
        speed_mps=speed_mps if enable else 0.0,
        astern_mps=astern_mps if enable else 0.0,
        vetoes=vetoes,
        keeps_station=at_station is not None,
        echo_us=inputs.clock.stamp_us if inputs.clock is not None else 0,
        inhibits=tuple(inhibits),
        direction=advisory.direction if advisory is not None else Direction.NO_DATA,
        waypoint_index=state.progress.target or 0,
        waypoints_reached=state.progress.waypoints_reached,
        cross_track_m=cross_m,
        advisory_sent_us=advisory.sent_us if advisory is not None else 0,
        leg_index=state.progress.leg_index,
        leg=leg,
        obstacle_track_ids=obstacle_track_ids,
    )
