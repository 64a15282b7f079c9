"""The navigator by the mode ordered: what it may do in each, and that an order in doubt is an order to stand still."""

from __future__ import annotations

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import NavigatorConfig
from paani.messages import Direction, DriveMode, FenceArea, Inhibit, Keep, Mission, NavCommand, OperatorOrder, Waypoint
from paani.missions import mission_of_route
from paani.motion_planning import HeadingSpeed, PlanningInputs
from paani_services.navigator.guidance.ilos import IlosState
from paani_services.navigator.guidance.mission_progress import MissionProgress
from paani_services.navigator.modes import follow_order
from paani_services.navigator.navigate import NavigatorState, navigate
from tests.synthetic_water import CAMERA
from tests.unit.paani_services.navigator.test_navigate import (
    HERE,
    NOW_US,
    PAANI,
    PAPER,
    RUNNING,
    SQUARE,
    inputs,
    pose,
)
from tests.unit.paani_services.navigator.test_navigate import advice as plain_advice

CLEAR = m.LaneRisk(blocked=False)
FAR = tuple(Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in ((-900, -900), (900, -900), (900, 900), (-900, 900)))
POOL = tuple(Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in ((-5, -5), (5, -5), (5, 5), (-5, 5)))


def advice(direction: Direction) -> m.Advisory:
    return msgspec.structs.replace(plain_advice(direction), center=CLEAR)


BLOCKED = msgspec.structs.replace(plain_advice(Direction.LEFT), center=m.LaneRisk(blocked=True))


def ordered(mode: DriveMode, age_s: float = 0.0, **changes: object) -> OperatorOrder:
    order = OperatorOrder(source_us=NOW_US - round(age_s * 1e6), mode=mode, since_us=1)
    return msgspec.structs.replace(order, **changes)


def step(
    order: OperatorOrder | None,
    state: NavigatorState = RUNNING,
    config: NavigatorConfig = PAANI,
    mission: Mission | None = None,
    receipt_age_s: float = 0.0,
    **changes: object,
) -> tuple[NavigatorState, NavCommand]:
    order_us = NOW_US - round(receipt_age_s * 1e6)
    given_inputs = inputs(**{"advisory": advice(Direction.STRAIGHT), "order": order, "order_us": order_us} | changes)
    return follow_order(state, given_inputs, mission or mission_of_route(SQUARE), NOW_US, 43, config)


def manual(surge: float = 0.0, turn: float = 0.0, age_s: float = 0.0, **changes: object) -> OperatorOrder:
    return ordered(DriveMode.MANUAL, age_s, surge=surge, turn=turn, **changes)


@pytest.mark.parametrize("config", [PAPER, PAANI])
@pytest.mark.parametrize("order", [None, ordered(DriveMode.ROUTE)])
@pytest.mark.parametrize("direction", Direction)
def test_route_and_a_boat_without_an_operator_do_as_the_mission_says(
    config: NavigatorConfig, order: OperatorOrder | None, direction: Direction
) -> None:
    state, command = step(order, config=config, advisory=advice(direction))
    plain_state, plain = navigate(
        RUNNING, inputs(advisory=advice(direction)), mission_of_route(SQUARE), NOW_US, 43, config
    )
    assert command == plain
    assert msgspec.structs.replace(state, is_ordered=False) == plain_state


@pytest.mark.parametrize("mode", DriveMode)
def test_an_order_that_is_stale_or_missing_is_no_order_to_follow_the_route(mode: DriveMode) -> None:
    order = ordered(mode, surge=0.5)
    state, _ = step(order)
    _, missing = step(None, state)
    assert (missing.enable, missing.inhibits) == (False, (Inhibit.NO_ORDER,))
    _, stale = step(order, state, receipt_age_s=PAANI.order_max_age_s + 0.01)
    assert (stale.enable, stale.inhibits) == (False, (Inhibit.STALE_ORDER,))
    _, foreign = step(msgspec.structs.replace(order, domain=44), state)
    assert (foreign.enable, foreign.inhibits) == (False, (Inhibit.WRONG_DOMAIN,))


def test_a_navigator_that_begins_under_way_waits_for_the_order_that_an_armed_boat_has() -> None:
    """The word that arms may be heard first; it says that there is an order, so the route is not followed yet."""
    _, command = step(None, arming=m.Arming(source_us=NOW_US, armed=True, mode_ordered=True))
    assert (command.enable, command.inhibits) == (False, (Inhibit.NO_ORDER,))


OTHER = m.Mission(
    source_us=1,
    name="other",
    legs=(m.MissionLeg(kind=m.LegKind.FOLLOW_ROUTE, waypoints=(HERE, Waypoint(x_m=3.0, y_m=-50.0))),),
    accepted_us=7,
    legs_us=7,
)


@pytest.mark.parametrize("mode", [DriveMode.ROUTE, DriveMode.HOLD, DriveMode.RETURN, DriveMode.MANUAL])
def test_nothing_moves_until_the_mission_and_fence_that_the_order_is_for_have_come(mode: DriveMode) -> None:
    order = ordered(mode, surge=0.5, target=(Waypoint(x_m=50.0, y_m=0.0),), mission_us=7)
    for mission in (None, msgspec.structs.replace(OTHER, accepted_us=6)):
        _, command = step(order, mission=mission)
        assert (command.enable, command.inhibits) == (False, (Inhibit.NO_ROUTE,))
    assert step(order, mission=OTHER)[1].enable


def test_other_legs_begin_with_the_first_and_another_fence_begins_none_anew() -> None:
    """Home and what was reached stay; the boat is where it was, and the order of the same mode goes on."""
    route = mission_of_route(SQUARE)
    state = msgspec.structs.replace(
        RUNNING, progress=MissionProgress(target=3, waypoints_reached=9, home=HERE), is_ordered=True
    )
    fenced = msgspec.structs.replace(route, fence=(FenceArea(keep=Keep.IN, corners=FAR),), accepted_us=5)
    after, command = step(ordered(DriveMode.ROUTE, mission_us=5), state, mission=fenced)
    assert (after.progress.target, command.waypoints_reached, after.legs_us) == (3, 9, 0)
    after, command = step(ordered(DriveMode.ROUTE, mission_us=7), state, mission=OTHER)
    assert (after.progress.target, command.waypoints_reached, after.progress.home) == (1, 9, HERE)
    assert after.progress.waypoints_reached_before == 9
    assert after.legs_us == 7
    assert command.heading_rad == pytest.approx(-math.pi / 2)
    again, _ = step(ordered(DriveMode.ROUTE, mission_us=7), after, mission=OTHER)
    assert again.progress == after.progress


def test_a_mission_without_legs_moves_nothing() -> None:
    cleared = msgspec.structs.replace(OTHER, legs=())
    _, command = step(ordered(DriveMode.ROUTE, mission_us=7), mission=cleared)
    assert (command.enable, command.inhibits) == (False, (Inhibit.MISSION_DONE,))


def test_idle_is_no_thrust() -> None:
    _, command = step(ordered(DriveMode.IDLE))
    assert (command.enable, command.inhibits, command.leg) == (False, (Inhibit.IDLE,), "idle")


def test_hold_rests_on_its_station_comes_back_to_it_and_leaves_the_mission_where_it_was() -> None:
    order = ordered(DriveMode.HOLD, target=(Waypoint(x_m=0.0, y_m=0.0),))
    state, command = step(order)
    assert (command.enable, command.inhibits, command.leg) == (False, (Inhibit.HOLDING,), "hold station")
    state, command = step(order, state, odometry=pose(0.0, 4.5))
    assert (command.enable, command.inhibits) == (True, ())
    assert command.heading_rad == pytest.approx(-math.pi / 2)
    assert command.speed_mps == pytest.approx(PAANI.cruise_mps * PAANI.station_speed_frac)
    assert command.waypoint_index == 1
    assert msgspec.structs.replace(state.progress, home=None) == RUNNING.progress


def test_a_station_outlives_a_stop_and_the_arming_after_it() -> None:
    order = ordered(DriveMode.HOLD, target=(HERE,))
    state, _ = step(order)
    state, command = step(order, state, arming=m.Arming(source_us=NOW_US, armed=False, stopped=True))
    assert Inhibit.NOT_ARMED in command.inhibits
    _, command = step(order, state)
    assert (command.inhibits, command.leg) == ((Inhibit.HOLDING,), "hold station")


def test_hold_that_is_ordered_anew_is_a_new_station() -> None:
    state, _ = step(ordered(DriveMode.HOLD, target=(HERE,)))
    there = Waypoint(x_m=HERE.x_m, y_m=30.0)
    _, command = step(ordered(DriveMode.HOLD, target=(there,), since_us=2), state)
    assert command.enable
    assert math.sin(command.heading_rad) > 0.9


def test_return_goes_home_and_keeps_station_there() -> None:
    home = Waypoint(x_m=3.0, y_m=-20.0)
    order = ordered(DriveMode.RETURN, target=(home,))
    state, command = step(order)
    assert (command.enable, command.speed_mps, command.leg) == (True, PAANI.cruise_mps, "return home")
    assert command.heading_rad == pytest.approx(-math.pi / 2)
    state, command = step(order, state, odometry=pose(3.0, -19.0))
    assert (command.inhibits, command.leg) == ((Inhibit.HOLDING,), "hold station")
    assert state.progress.target == RUNNING.progress.target


def test_a_return_ordered_anew_goes_home_anew() -> None:
    state, command = step(ordered(DriveMode.RETURN, target=(HERE,)))
    assert command.leg == "hold station"
    _, command = step(ordered(DriveMode.RETURN, target=(HERE,), since_us=2), state, odometry=pose(3.0, 30.0))
    assert (command.leg, command.speed_mps) == ("return home", PAANI.cruise_mps)


@pytest.mark.parametrize("mode", [DriveMode.HOLD, DriveMode.RETURN])
@pytest.mark.parametrize("direction", [Direction.STOP, Direction.NO_DATA])
def test_an_errand_has_the_vetoes_of_every_mission(mode: DriveMode, direction: Direction) -> None:
    _, command = step(ordered(mode, target=(Waypoint(x_m=50.0, y_m=0.0),)), advisory=advice(direction))
    assert not command.enable
    _, fenced = step(ordered(mode, target=(Waypoint(x_m=50.0, y_m=0.0),)), mission=fenced_pool(), odometry=pose(9, 0))
    assert Inhibit.OUTSIDE_FENCE in fenced.inhibits


def fenced_pool() -> Mission:
    return msgspec.structs.replace(
        mission_of_route(SQUARE), fence=(FenceArea(keep=Keep.IN, corners=POOL, name="pool"),)
    )


@pytest.mark.parametrize(
    ("surge", "turn", "speed_mps", "astern_mps", "off_bow_deg"),
    [
        (1.0, 0.0, PAANI.cruise_mps, 0.0, 0.0),
        (0.5, 1.0, 0.5 * PAANI.cruise_mps, 0.0, PAANI.manual_turn_deg),
        (-0.5, 0.0, 0.0, 0.5 * PAANI.cruise_mps, 0.0),
        (0.0, -1.0, 0.0, 0.0, -PAANI.manual_turn_deg),
    ],
)
def test_a_hand_gets_speed_and_turn(
    surge: float, turn: float, speed_mps: float, astern_mps: float, off_bow_deg: float
) -> None:
    _, command = step(manual(surge, turn), odometry=pose(3.0, 0.0, yaw_rad=1.0))
    assert (command.enable, command.leg, command.vetoes) == (True, "manual", ())
    assert [command.speed_mps, command.astern_mps] == pytest.approx([speed_mps, astern_mps])
    assert command.heading_rad == pytest.approx(1.0 + math.radians(off_bow_deg))


def test_the_advised_speed_limit_holds_for_a_hand_ahead() -> None:
    limited = msgspec.structs.replace(advice(Direction.STRAIGHT), speed_limit_mps=0.2)
    assert step(manual(1.0), advisory=limited)[1].speed_mps == pytest.approx(0.2)
    assert step(manual(-1.0), advisory=limited)[1].astern_mps == pytest.approx(PAANI.cruise_mps)


def test_a_stick_in_neutral_is_no_thrust_however_old_it_is() -> None:
    for order in (manual(), manual(age_s=1.5)):
        _, command = step(order)
        assert (command.enable, command.inhibits) == (False, (Inhibit.NEUTRAL,))


def test_a_set_point_that_is_old_by_its_stamp_or_its_receipt_is_no_thrust() -> None:
    limit_s = PAANI.stick_max_age_s
    assert step(manual(0.5, age_s=limit_s), receipt_age_s=limit_s)[1].enable
    for _, command in (step(manual(0.5, age_s=limit_s + 0.001)), step(manual(0.5), receipt_age_s=limit_s + 0.001)):
        assert (command.enable, command.inhibits) == (False, (Inhibit.STALE_ORDER,))


@pytest.mark.parametrize(
    ("advisory", "veto"),
    [
        (advice(Direction.STOP), Inhibit.ADVISED_STOP),
        (advice(Direction.NO_DATA), Inhibit.ADVISED_NO_DATA),
        (BLOCKED, Inhibit.BLOCKED_AHEAD),
    ],
)
def test_the_advice_vetoes_thrust_ahead_until_it_is_overridden(advisory: m.Advisory, veto: Inhibit) -> None:
    _, ahead = step(manual(1.0), advisory=advisory)
    assert (ahead.enable, ahead.inhibits, ahead.vetoes) == (False, (veto,), (veto,))
    _, turning = step(manual(1.0, 1.0), advisory=advisory)
    assert (turning.enable, turning.speed_mps, turning.vetoes) == (True, 0.0, (veto,))
    _, astern = step(manual(-1.0), advisory=advisory)
    assert (astern.enable, astern.astern_mps) == (True, PAANI.cruise_mps)
    _, overridden = step(manual(1.0, override=True), advisory=advisory)
    assert (overridden.enable, overridden.speed_mps, overridden.vetoes) == (True, PAANI.cruise_mps, ())


@pytest.mark.parametrize(
    ("changes", "inhibit"),
    [
        ({"arming": m.Arming(source_us=NOW_US, armed=True, stopped=True)}, Inhibit.NOT_ARMED),
        ({"arming_us": NOW_US - 2_000_000}, Inhibit.NOT_ARMED),
        ({"clock_us": NOW_US - 2_000_000}, Inhibit.NO_CLOCK),
        ({"odometry_us": NOW_US - 2_000_000}, Inhibit.STALE_ODOMETRY),
        ({"odometry": None}, Inhibit.NO_ODOMETRY),
        ({"advisory_us": NOW_US - 2_000_000}, Inhibit.STALE_ADVISORY),
        ({"advisory": None}, Inhibit.NO_ADVISORY),
        ({"odometry": pose(9.0, 0.0), "mission": fenced_pool()}, Inhibit.OUTSIDE_FENCE),
        ({"odometry": pose(4.9, 0.0), "mission": fenced_pool()}, Inhibit.OUTSIDE_FENCE),
    ],
)
def test_an_override_lifts_nothing_but_the_advice(changes: dict[str, object], inhibit: Inhibit) -> None:
    _, command = step(manual(1.0, override=True), **changes)  # type: ignore[arg-type]
    assert not command.enable
    assert inhibit in command.inhibits


def test_the_fence_holds_a_hand_ahead_and_lets_it_go_back() -> None:
    at_edge = msgspec.structs.replace(pose(4.0, 0.0), surge_mps=0.0)
    assert not step(manual(1.0), odometry=at_edge, mission=fenced_pool())[1].enable
    astern = step(manual(-1.0), odometry=at_edge, mission=fenced_pool())[1]
    assert (astern.enable, astern.speed_mps) == (True, 0.0)
    assert 0.0 < astern.astern_mps <= PAANI.cruise_mps
    stern_out = msgspec.structs.replace(pose(4.0, 0.0, yaw_rad=math.pi), surge_mps=0.0)
    assert not step(manual(-1.0), odometry=stern_out, mission=fenced_pool())[1].enable


def test_home_is_where_a_boat_without_a_mission_was_first_driven() -> None:
    alone = msgspec.structs.replace(RUNNING, progress=MissionProgress())
    given_inputs = inputs(advisory=advice(Direction.STRAIGHT), order=manual(0.5), order_us=NOW_US)
    state, command = follow_order(alone, given_inputs, None, NOW_US, 43, PAANI)
    assert command.enable
    assert state.progress.home == HERE
    later = msgspec.structs.replace(given_inputs, odometry=pose(8.0, 8.0))
    state, _ = follow_order(state, later, None, NOW_US, 43, PAANI)
    assert state.progress.home == HERE


@given(
    st.sampled_from((*DriveMode, None)),
    st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0),
    st.booleans(),
    st.sampled_from(Direction),
    st.sampled_from((0.0, 0.3, 0.45, 1.2)),
    st.booleans(),
)
def test_in_no_mode_an_order_moves_the_boat_that_says_why_it_may_not(
    mode: DriveMode | None,
    surge: float,
    turn: float,
    override: bool,
    direction: Direction,
    age_s: float,
    armed: bool,
) -> None:
    order = None if mode is None else ordered(mode, age_s, surge=surge, turn=turn, override=override, target=(HERE,))
    arming = m.Arming(source_us=NOW_US, armed=armed)
    _, command = step(order, receipt_age_s=age_s, advisory=advice(direction), arming=arming)
    assert command.enable is not bool(command.inhibits)
    assert command.enable or (command.speed_mps, command.astern_mps) == (0.0, 0.0)
    assert not (command.enable and not armed)
    assert not (command.enable and mode is DriveMode.IDLE)
    assert not (command.enable and mode is DriveMode.MANUAL and age_s > PAANI.stick_max_age_s)
    assert not (command.speed_mps and direction in {Direction.STOP, Direction.NO_DATA} and not override)


@pytest.mark.parametrize("mode", [DriveMode.IDLE, DriveMode.MANUAL])
def test_an_order_without_advice_has_the_time_of_its_step(mode: DriveMode) -> None:
    """And the integral is held over it, so that the time in this mode is not integrated later."""
    state, command = step(ordered(mode), advisory=None)
    assert (command.enable, command.source_us) == (False, NOW_US)
    assert state.ilos.updated_us == NOW_US


def test_an_errand_leaves_count_and_integral_of_the_mission_alone_and_has_its_own() -> None:
    under_way = msgspec.structs.replace(
        RUNNING,
        progress=MissionProgress(leg_index=1, target=2, leg_start=HERE, waypoints_reached=5),
        ilos=IlosState(east_m=0.5, north_m=-0.2, updated_us=NOW_US - 100_000),
    )
    order = ordered(DriveMode.RETURN, target=(Waypoint(x_m=60.0, y_m=0.0),))
    state, command = step(order, under_way, odometry=pose(3.0, 2.0))
    assert (command.waypoint_index, command.waypoints_reached, command.leg_index) == (2, 5, 1)
    assert (state.ilos.east_m, state.ilos.north_m, state.ilos.updated_us) == (0.5, -0.2, NOW_US)
    assert state.errand_ilos.updated_us == NOW_US
    assert state.progress.home == Waypoint(x_m=3.0, y_m=2.0)
    held = msgspec.structs.replace(state, progress=msgspec.structs.replace(state.progress, home=HERE))
    assert step(order, held, odometry=pose(30.0, 2.0))[0].progress.home == HERE
    adrift = msgspec.structs.replace(state, errand_ilos=IlosState(east_m=1.0, north_m=2.0, updated_us=NOW_US))
    assert step(order, adrift, odometry=pose(3.0, 2.0))[0].errand_ilos.north_m == pytest.approx(2.0, abs=0.1)
    anew = msgspec.structs.replace(order, since_us=2)
    assert step(anew, adrift, odometry=pose(3.0, 2.0))[0].errand_ilos.north_m == pytest.approx(0.0, abs=0.1)
    fresh = msgspec.structs.replace(RUNNING, progress=MissionProgress())
    assert step(order, fresh)[1].waypoint_index == 0


@pytest.mark.parametrize("order", [None, ordered(DriveMode.RETURN, target=(Waypoint(x_m=50.0, y_m=0.0),))])
def test_another_planner_is_asked_on_the_mission_and_on_an_errand(order: OperatorOrder | None) -> None:
    def aside(given: PlanningInputs) -> HeadingSpeed:
        return HeadingSpeed(given.course_rad + 0.3, 0.2)

    given_inputs = inputs(advisory=advice(Direction.STRAIGHT), order=order, order_us=NOW_US)
    mission = mission_of_route(SQUARE)
    _, command = follow_order(RUNNING, given_inputs, mission, NOW_US, 43, PAANI, CAMERA, aside)
    assert command.heading_rad == pytest.approx(0.3)
    assert command.speed_mps == 0.2


@pytest.mark.parametrize(("surge", "turn"), [(0.3, 0.0), (0.5, 0.0), (1.0, 0.0), (0.0, 1.0)])
def test_the_fence_holds_a_hand_at_any_surge_ahead_and_in_a_turn_which_pushes_ahead_too(
    surge: float, turn: float
) -> None:
    at_edge = msgspec.structs.replace(pose(4.5, 0.0), surge_mps=0.0)
    _, command = step(manual(surge, turn), odometry=at_edge, mission=fenced_pool())
    assert (command.enable, command.inhibits) == (False, (Inhibit.OUTSIDE_FENCE,))


def test_a_hand_in_neutral_outside_the_fence_is_in_neutral_and_no_more() -> None:
    _, command = step(manual(), odometry=pose(9.0, 0.0), mission=fenced_pool())
    assert command.inhibits == (Inhibit.NEUTRAL,)


def test_a_hand_that_is_vetoed_still_names_what_else_forbids_motion() -> None:
    _, command = step(manual(1.0), advisory=BLOCKED, arming=None)
    assert set(command.inhibits) == {Inhibit.NOT_ARMED, Inhibit.BLOCKED_AHEAD}


def test_an_advised_limit_of_nothing_gives_a_hand_no_speed() -> None:
    halted = msgspec.structs.replace(advice(Direction.STRAIGHT), speed_limit_mps=0.0)
    assert step(manual(1.0), advisory=halted)[1].speed_mps == 0.0
    assert step(manual(-1.0), advisory=halted)[1].astern_mps == PAANI.cruise_mps
