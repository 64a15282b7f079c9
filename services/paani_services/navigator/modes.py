"""The modes: what the operator has ordered, to one order to the controller. Pure, as the step along a mission is.

ROUTE is the mission. HOLD and RETURN are errands: short missions of their own, with the fence, the vetoes and the
planner of every mission, while the progress of the boat's own waits. In MANUAL a hand asks for speed and turn; what
forbids motion forbids it there too, and the advice vetoes thrust ahead unless the hand overrides it on purpose. In
IDLE, and where the order is missing or stale, there is no thrust.
"""

import math

import msgspec

from paani.config import NavigatorConfig
from paani.fence_geometry import Fence
from paani.geometry import wrap_rad
from paani.map_origin import is_map_moved, map_place_of, map_place_of_order
from paani.messages import (
    DriveMode,
    Inhibit,
    LegKind,
    Mission,
    MissionLeg,
    NavCommand,
    Odometry,
    OperatorOrder,
    Waypoint,
)
from paani.motion_planning import MotionPlanner
from paani_services.navigator.avoidance.fence import limit_speed
from paani_services.navigator.guidance.ilos import IlosState
from paani_services.navigator.guidance.mission_progress import MissionProgress
from paani_services.navigator.interlocks import NavigatorInputs, is_out_of_date
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.mapping.occupancy_grid import UNCALIBRATED_CAMERA
from paani_services.navigator.navigate import (
    NavigatorState,
    begin_step,
    build_command,
    hold_cross_track,
    navigate,
    note_clock_advance,
    speed_limit_mps,
)

ENDLESS_S = 1e9  # on station, until another mode is ordered
VETOES = (Inhibit.ADVISED_STOP, Inhibit.ADVISED_NO_DATA)  # of the advice; every other inhibit holds for a hand too


def follow_order(
    state: NavigatorState,
    inputs: NavigatorInputs,
    mission: Mission | None,
    now_us: int,
    domain: int,
    config: NavigatorConfig,
    camera: Camera = UNCALIBRATED_CAMERA,
    planner: MotionPlanner | None = None,
) -> tuple[NavigatorState, NavCommand]:
    """One step in the mode that is ordered; ROUTE where nobody orders modes, as in a trial without an operator."""
    state = _begin_legs(note_clock_advance(state, inputs, now_us), mission)
    order = inputs.order
    if order is not None and not state.is_ordered:
        state = msgspec.structs.replace(state, is_ordered=True)
    faults = _find_faults(state, inputs, mission, now_us, domain, config)
    if faults or (order is not None and order.mode is DriveMode.IDLE):
        leg = "idle" if order is not None and order.mode is DriveMode.IDLE else ""
        return _stand(state, inputs, now_us, domain, config, camera, faults or [Inhibit.IDLE], leg)
    if order is None or order.mode is DriveMode.ROUTE:
        return navigate(state, inputs, mission, now_us, domain, config, camera, planner)
    fence = mission.bounds if mission is not None else ()
    if order.mode is DriveMode.MANUAL:
        return _steer_by_hand(state, inputs, order, fence, now_us, domain, config, camera)
    return _run_errand(state, inputs, order, fence, now_us, domain, config, camera, planner)


def _begin_legs(state: NavigatorState, mission: Mission | None) -> NavigatorState:
    """Other legs than before begin with the first of them. Home, and what was reached before, stay."""
    legs_us = 0 if mission is None else mission.legs_us
    if legs_us == state.legs_us:
        return state
    reached = state.progress.waypoints_reached
    progress = MissionProgress(waypoints_reached=reached, waypoints_reached_before=reached, home=state.progress.home)
    return msgspec.structs.replace(state, progress=progress, ilos=IlosState(), legs_us=legs_us)


def _find_faults(
    state: NavigatorState,
    inputs: NavigatorInputs,
    mission: Mission | None,
    now_us: int,
    domain: int,
    config: NavigatorConfig,
) -> list[Inhibit]:
    """Why the order may not be followed. None is heard where none is due: no operator who orders modes has armed."""
    order, arming = inputs.order, inputs.arming
    if order is None:
        is_due = state.is_ordered or (arming is not None and arming.mode_ordered)
        return [Inhibit.NO_ORDER] if is_due else []
    if order.domain != domain:
        return [Inhibit.WRONG_DOMAIN]
    is_by_hand = order.mode is DriveMode.MANUAL
    limit_s = min(config.order_max_age_s, config.stick_max_age_s) if is_by_hand else config.order_max_age_s
    if is_by_hand and _is_neutral(order):  # no thrust, however long ago the stick came to rest
        is_old = is_out_of_date(inputs.order_us, config.order_max_age_s, now_us, config)
    else:
        is_old = any(is_out_of_date(each, limit_s, now_us, config) for each in (inputs.order_us, order.source_us))
    # Neither the mission nor the fence that the order is for has come yet.
    is_for_other = order.mission_us not in {0, 0 if mission is None else mission.accepted_us}
    is_elsewhere = is_map_moved(map_place_of_order(order), map_place_of(inputs.odometry))
    return [Inhibit.STALE_ORDER] * is_old + [Inhibit.NO_ROUTE] * is_for_other + [Inhibit.MAP_MOVED] * is_elsewhere


def _stand(
    state: NavigatorState,
    inputs: NavigatorInputs,
    now_us: int,
    domain: int,
    config: NavigatorConfig,
    camera: Camera,
    reasons: list[Inhibit],
    leg: str,
) -> tuple[NavigatorState, NavCommand]:
    """No thrust, for these reasons and those that there would be anyway."""
    state, inhibits = begin_step(state, inputs, now_us, domain, config, camera)
    state = hold_cross_track(state, now_us)
    return state, build_command(state, inputs, now_us, list(dict.fromkeys([*inhibits, *reasons])), leg=leg)


def _run_errand(
    state: NavigatorState,
    inputs: NavigatorInputs,
    order: OperatorOrder,
    fence: Fence,
    now_us: int,
    domain: int,
    config: NavigatorConfig,
    camera: Camera,
    planner: MotionPlanner | None,
) -> tuple[NavigatorState, NavCommand]:
    """One step of HOLD or RETURN, which begins anew where it is ordered anew."""
    if order.since_us != state.errand_since_us:
        state = msgspec.structs.replace(
            state, errand=MissionProgress(), errand_ilos=IlosState(), errand_since_us=order.since_us
        )
    away = msgspec.structs.replace(state, progress=state.errand, ilos=state.errand_ilos)
    away, command = navigate(away, inputs, _make_errand(order, fence, config), now_us, domain, config, camera, planner)
    progress = state.progress
    if progress.home is None:
        progress = msgspec.structs.replace(progress, home=away.progress.home)
    after = msgspec.structs.replace(
        away, progress=progress, ilos=state.ilos, errand=away.progress, errand_ilos=away.ilos
    )
    command = msgspec.structs.replace(
        command,
        waypoint_index=progress.target or 0,
        waypoints_reached=progress.waypoints_reached,
        leg_index=progress.leg_index,
    )
    return hold_cross_track(after, now_us), command


def _make_errand(order: OperatorOrder, fence: Fence, config: NavigatorConfig) -> Mission:
    """The errand as a mission: to the target, and there on station."""
    station = MissionLeg(
        kind=LegKind.HOLD_STATION, waypoints=order.target, radius_m=config.hold_radius_m, duration_s=ENDLESS_S
    )
    way_home = MissionLeg(kind=LegKind.RETURN_HOME, waypoints=order.target)
    legs = (way_home, station) if order.mode is DriveMode.RETURN else (station,)
    return Mission(source_us=order.source_us, name=order.mode.lower(), legs=legs, fence=fence)


def _steer_by_hand(
    state: NavigatorState,
    inputs: NavigatorInputs,
    order: OperatorOrder,
    fence: Fence,
    now_us: int,
    domain: int,
    config: NavigatorConfig,
    camera: Camera,
) -> tuple[NavigatorState, NavCommand]:
    """One step of MANUAL. A hand that asks for nothing gets no thrust; one that may not go ahead may turn and back."""
    state, inhibits = begin_step(state, inputs, now_us, domain, config, camera)
    state = hold_cross_track(state, now_us)
    vetoes = [] if order.override else _find_vetoes(inputs, inhibits)
    inhibits = [each for each in inhibits if each not in VETOES]
    odometry = inputs.odometry
    surge = 0.0 if vetoes and order.surge > 0.0 else order.surge
    if _is_neutral(order):
        inhibits.append(Inhibit.NEUTRAL)
    elif surge == 0.0 and order.turn == 0.0:
        inhibits += vetoes
    heading_rad = speed_mps = 0.0
    if odometry is not None and not inhibits:
        heading_rad = wrap_rad(odometry.yaw_rad + order.turn * math.radians(config.manual_turn_deg))
        bows_rad = (odometry.yaw_rad, heading_rad) if surge and order.turn else (odometry.yaw_rad,)
        bounded_mps = _bound_speed(surge, bows_rad, inputs, odometry, fence, config)
        if bounded_mps is None:
            inhibits.append(Inhibit.OUTSIDE_FENCE)
        speed_mps = bounded_mps or 0.0
        if not inhibits and state.progress.home is None:
            here = Waypoint(x_m=odometry.x_m, y_m=odometry.y_m)
            state = msgspec.structs.replace(state, progress=msgspec.structs.replace(state.progress, home=here))
    return state, build_command(
        state,
        inputs,
        now_us,
        inhibits,
        heading_rad,
        speed_mps if surge > 0.0 else 0.0,
        astern_mps=speed_mps if surge < 0.0 else 0.0,
        vetoes=tuple(vetoes),
        leg="manual",
    )


def _find_vetoes(inputs: NavigatorInputs, inhibits: list[Inhibit]) -> list[Inhibit]:
    """Why the advice gives a hand no thrust ahead."""
    vetoes = [each for each in inhibits if each in VETOES]
    if inputs.advisory is not None and inputs.advisory.center.blocked:
        vetoes.append(Inhibit.BLOCKED_AHEAD)
    return vetoes


def _bound_speed(
    surge: float,
    bows_rad: tuple[float, ...],
    inputs: NavigatorInputs,
    odometry: Odometry,
    fence: Fence,
    config: NavigatorConfig,
) -> float | None:
    """The speed ahead or astern that the hand gets [m/s] with all these bows; None where the fence gives it none."""
    speed_mps = abs(surge) * config.cruise_mps
    if surge > 0.0:
        speed_mps = min(speed_mps, speed_limit_mps(inputs.advisory))
    for bow_rad in bows_rad:
        course_rad = bow_rad if surge >= 0.0 else wrap_rad(bow_rad + math.pi)
        bounded_mps = limit_speed(fence, odometry, course_rad, speed_mps, config, is_astern=surge < 0.0)
        if bounded_mps is None:
            return None
        speed_mps = bounded_mps
    return speed_mps


def _is_neutral(order: OperatorOrder) -> bool:
    return order.surge == 0.0 and order.turn == 0.0
