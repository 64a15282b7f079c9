"""From advice, mission and estimate to one order. Pure: no clock, no bus, no logging.

Every gate that is shut is named in the order's `inhibits`; an order that moves has none.
"""

import math

import msgspec

from paani.config import NavigatorConfig
from paani.geometry import wrap_rad
from paani.messages import (
    Advisory,
    Arming,
    Direction,
    Evidence,
    Inhibit,
    Mission,
    NavCommand,
    Odometry,
    SimTime,
)
from paani_services.navigator.avoidance.fence import bounded_speed, is_allowed
from paani_services.navigator.avoidance.replanning import SAME_COURSE_RAD, Pilot, brakes, looked, steered
from paani_services.navigator.avoidance.rollout import Wish
from paani_services.navigator.guidance.ilos import Crab, learned, paused
from paani_services.navigator.guidance.mission import Aim, Progress, Scene, aim, follow, words
from paani_services.navigator.guidance.passed_obstacles import Guards, guarded_course, watch
from paani_services.navigator.guidance.visual_turns import SIDE, TURNS, Turn, continuous_heading, latched
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.mapping.occupancy_grid import UNCALIBRATED


class NavState(msgspec.Struct, frozen=True):
    """What one call leaves for the next."""

    progress: Progress = Progress()
    crab: Crab = Crab()
    turn: Turn | None = None
    guards: Guards = Guards()
    pilot: Pilot = Pilot()
    sim_us: int = -1
    advanced_us: int | None = None


class Heard(msgspec.Struct, frozen=True):
    """The newest message of each kind, and when it came [us]."""

    advisory: Advisory | None = None
    advisory_us: int = 0
    odometry: Odometry | None = None
    odometry_us: int = 0
    clock: SimTime | None = None
    clock_us: int = 0
    arming: Arming | None = None
    arming_us: int = 0
    evidence: Evidence | None = None


def navigate(
    state: NavState,
    heard: Heard,
    mission: Mission | None,
    now_us: int,
    domain: int,
    config: NavigatorConfig,
    camera: Camera = UNCALIBRATED,
) -> tuple[NavState, NavCommand]:
    """One step. The order carries the advisory's `source_us` and the plant's newest stamp.

    With a valid calibration the metric planner has the last word on heading and speed; it never overrides a gate.
    """
    state = _watch_clock(state, heard, now_us)
    inhibits = _gates(state, heard, now_us, domain, config)
    if mission is None:
        inhibits.append(Inhibit.NO_ROUTE)
    state = _forget_turn(state, heard)
    plans = config.planner.acts_on(camera.calibration)
    if plans:
        pilot = looked(state.pilot, heard.odometry, heard.evidence, config.planner)
        state = msgspec.structs.replace(state, pilot=pilot)
    odometry, advisory = heard.odometry, heard.advisory
    if odometry is None or Inhibit.UNHEALTHY_ODOMETRY in inhibits or mission is None:
        return state, _order(state, heard, now_us, inhibits)

    position_m = (odometry.x_m, odometry.y_m)
    direction = advisory.direction if advisory is not None else Direction.NO_DATA
    if advisory is not None and config.clear_m > 0.0:
        state = msgspec.structs.replace(state, guards=watch(state.guards, advisory, odometry, config.clear_m))
    # M1, M3: a turn by the picture keeps its waypoint. The planner steers for the route whatever is advised.
    straight = not inhibits and (plans or direction is Direction.STRAIGHT)
    scene = Scene(odometry, heard.arming, state.sim_us, free=not inhibits, straight=straight)
    state = _pursue(state, mission, scene, config)
    wanted = aim(state.progress, mission, state.crab, position_m, config)
    if wanted.inhibit is not None:
        inhibits.append(wanted.inhibit)
    if not is_allowed(mission.fence, position_m) and not config.fence_return:
        inhibits.append(Inhibit.OUTSIDE_FENCE)
    leg = words(state.progress, mission)
    if inhibits:
        return _paused(state, now_us), _order(state, heard, now_us, inhibits, cross_m=wanted.cross_track_m, leg=leg)
    speed_mps, heading_rad = wanted.speed_mps, odometry.yaw_rad
    if direction in TURNS:
        state = _paused(state, now_us)
        speed_mps *= config.turn_speed_frac
    if plans:
        # The planner weighs the advised side against what the map shows, and remembers where things are.
        heading_rad = wanted.course_rad
    elif direction in TURNS:
        if config.latch_turns:
            turn, capped = latched(state.turn, direction, odometry.yaw_rad, now_us, config)
            state = msgspec.structs.replace(state, turn=turn)
            heading_rad = turn.heading_rad
            if capped:
                inhibits.append(Inhibit.TURN_CAPPED)
        else:
            heading_rad = continuous_heading(direction, odometry.yaw_rad, config)
    else:
        heading_rad = guarded_course(wanted.course_rad, state.guards)
    if plans and not inhibits and speed_mps > 0.0:
        wish = Wish(heading_rad, speed_mps, SIDE.get(direction, 0.0), turns=_only_looks(advisory))
        pilot, plan = steered(state.pilot, odometry, wish, now_us, camera, config.planner, mission.fence)
        state = msgspec.structs.replace(state, pilot=pilot)
        heading_rad, speed_mps = plan.heading_rad, plan.speed_mps
        if speed_mps <= 0.0 and not brakes(pilot, odometry, now_us, config.planner):
            inhibits.append(Inhibit.NO_FREE_PATH)
    if direction not in TURNS:
        on_course = abs(wrap_rad(heading_rad - wanted.course_rad)) <= SAME_COURSE_RAD
        state = _learned(state, wanted, odometry, now_us, config, on_course=on_course)
    bounded_mps = bounded_speed(mission.fence, odometry, heading_rad, speed_mps, config)
    if bounded_mps is None:
        inhibits.append(Inhibit.OUTSIDE_FENCE)
    return state, _order(
        state, heard, now_us, inhibits, heading_rad, bounded_mps or 0.0, cross_m=wanted.cross_track_m, leg=leg
    )


def _pursue(state: NavState, mission: Mission, scene: Scene, config: NavigatorConfig) -> NavState:
    """The mission's step; another leg learns anew what pushes the boat."""
    progress = follow(state.progress, mission, scene, config)
    crab = state.crab if progress.leg == state.progress.leg else Crab()
    return msgspec.structs.replace(state, progress=progress, crab=crab)


def _only_looks(advisory: Advisory | None) -> bool:
    """A turn is advised to a side that is blocked: to look there, and not to go."""
    side = SIDE.get(advisory.direction, 0.0) if advisory is not None else 0.0
    return advisory is not None and ((side > 0.0 and advisory.left.blocked) or (side < 0.0 and advisory.right.blocked))


def _learned(
    state: NavState, wanted: Aim, odometry: Odometry, now_us: int, config: NavigatorConfig, *, on_course: bool
) -> NavState:
    if wanted.track is None or config.lookahead_m <= 0.0 or not on_course:
        return _paused(state, now_us)
    crab = learned(state.crab, wanted.track, wanted.target, wanted.cross_track_m, odometry, now_us, config)
    return msgspec.structs.replace(state, crab=crab)


def _paused(state: NavState, now_us: int) -> NavState:
    return msgspec.structs.replace(state, crab=paused(state.crab, now_us))


def _watch_clock(state: NavState, heard: Heard, now_us: int) -> NavState:
    """Note when simulated time last moved forward.

    After a reset the boat may be anywhere: it joins the route anew, once time moves on again.
    """
    if heard.clock is None or heard.clock.sim_us == state.sim_us:
        return state
    sim_us = heard.clock.sim_us
    if state.sim_us < 0:
        return msgspec.structs.replace(state, sim_us=sim_us)
    if sim_us < state.sim_us:
        return NavState(progress=Progress(reached=state.progress.reached), sim_us=sim_us)
    return msgspec.structs.replace(state, sim_us=sim_us, advanced_us=now_us)


def _gates(state: NavState, heard: Heard, now_us: int, domain: int, config: NavigatorConfig) -> list[Inhibit]:
    """Every gate that is shut (M8-M11)."""

    def is_old(stamp_us: int, limit_s: float) -> bool:
        return not -config.max_future_s <= (now_us - stamp_us) * 1e-6 <= limit_s

    found: list[Inhibit] = []
    advisory, odometry, clock, arming = heard.advisory, heard.odometry, heard.clock, heard.arming
    messages = (advisory, odometry, clock, arming, heard.evidence)
    if any(message is not None and message.domain != domain for message in messages):
        found.append(Inhibit.WRONG_DOMAIN)
    if arming is None or not arming.armed or arming.stopped or is_old(heard.arming_us, config.arming_max_age_s):
        found.append(Inhibit.NOT_ARMED)
    if clock is None or is_old(heard.clock_us, config.clock_max_age_s):
        found.append(Inhibit.NO_CLOCK)
    elif not clock.running or state.advanced_us is None or is_old(state.advanced_us, config.clock_max_age_s):
        found.append(Inhibit.CLOCK_STOPPED)
    if odometry is None:
        found.append(Inhibit.NO_ODOMETRY)
    else:
        if is_old(heard.odometry_us, config.odometry_max_age_s) or is_old(
            odometry.source_us, config.odometry_max_age_s
        ):
            found.append(Inhibit.STALE_ODOMETRY)
        numbers = (odometry.x_m, odometry.y_m, odometry.yaw_rad)
        if not odometry.healthy or not all(map(math.isfinite, numbers)):
            found.append(Inhibit.UNHEALTHY_ODOMETRY)
    if advisory is None:
        found.append(Inhibit.NO_ADVISORY)
    else:
        if is_old(heard.advisory_us, config.advisory_max_receipt_s) or is_old(
            advisory.source_us, config.advisory_max_age_s
        ):
            found.append(Inhibit.STALE_ADVISORY)
        if advisory.direction is Direction.STOP:
            found.append(Inhibit.ADVISED_STOP)
        elif advisory.direction is Direction.NO_DATA:
            found.append(Inhibit.ADVISED_NO_DATA)
    return found


def _forget_turn(state: NavState, heard: Heard) -> NavState:
    """Going straight ends a run of turns, and so does disarming; a STOP between two turns does not."""
    straight = heard.advisory is not None and heard.advisory.direction is Direction.STRAIGHT
    armed = heard.arming is not None and heard.arming.armed and not heard.arming.stopped
    if state.turn is not None and (straight or not armed):
        return msgspec.structs.replace(state, turn=None)
    return state


def _order(
    state: NavState,
    heard: Heard,
    now_us: int,
    inhibits: list[Inhibit],
    heading_rad: float = 0.0,
    speed_mps: float = 0.0,
    *,
    cross_m: float = 0.0,
    leg: str = "",
) -> NavCommand:
    advisory = heard.advisory
    enable = not inhibits
    return NavCommand(
        source_us=advisory.source_us if advisory is not None else now_us,
        enable=enable,
        heading_rad=heading_rad if enable else 0.0,
        speed_mps=speed_mps if enable else 0.0,
        echo_us=heard.clock.stamp_us if heard.clock is not None else 0,
        inhibits=tuple(inhibits),
        direction=advisory.direction if advisory is not None else Direction.NO_DATA,
        waypoint_index=state.progress.target or 0,
        waypoints_reached=state.progress.reached,
        cross_track_m=cross_m,
        advisory_sent_us=advisory.sent_us if advisory is not None else 0,
        leg_index=state.progress.leg,
        leg=leg,
    )
