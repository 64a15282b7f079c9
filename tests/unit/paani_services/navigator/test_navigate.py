"""From advice and route to one order (M1-M11)."""

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.config import NavigatorConfig, load_config
from paani.messages import (
    Advisory,
    Arming,
    Direction,
    Inhibit,
    LaneRisk,
    NavCommand,
    Odometry,
    Reason,
    Route,
    SimTime,
    Waypoint,
)
from paani.missions import mission_of_route
from paani_services.navigator.guidance.mission_progress import MissionProgress
from paani_services.navigator.interlocks import NavigatorInputs
from paani_services.navigator.navigate import NavigatorState, navigate

NOW_US = 20_000_000
PAPER = load_config(profile="paper").navigator
PAANI = load_config().navigator
SQUARE = Route(
    source_us=0,
    name="square",
    waypoints=tuple(Waypoint(x_m=x, y_m=y) for x, y in ((0, 0), (10, 0), (10, 10), (0, 10))),
)
HERE = Waypoint(x_m=3.0, y_m=0.0)
RUNNING = NavigatorState(
    progress=MissionProgress(target=1, leg_start=HERE), sim_us=1000, clock_advanced_us=NOW_US - 50_000
)


def at_waypoint(target: int, reached: int = 0) -> NavigatorState:
    return msgspec.structs.replace(
        RUNNING, progress=MissionProgress(target=target, leg_start=HERE, waypoints_reached=reached)
    )


def inputs(now_us: int = NOW_US, /, **changes: object) -> NavigatorInputs:
    message = NavigatorInputs(
        advisory=advice(Direction.STRAIGHT, now_us),
        advisory_us=now_us,
        odometry=pose(3.0, 0.0, source_us=now_us),
        odometry_us=now_us,
        clock=SimTime(source_us=now_us, sim_us=now_us, stamp_us=777),
        clock_us=now_us,
        arming=Arming(source_us=now_us, armed=True),
        arming_us=now_us,
    )
    return msgspec.structs.replace(message, **changes)


def advice(direction: Direction, source_us: int = NOW_US) -> Advisory:
    return Advisory(source_us=source_us, direction=direction, reason=Reason.CENTER_CLEAR)


def pose(x_m: float, y_m: float, yaw_rad: float = 0.0, source_us: int = NOW_US) -> Odometry:
    return Odometry(source_us=source_us, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, surge_mps=0.3, healthy=True)


def run(
    config: NavigatorConfig, given_inputs: NavigatorInputs, state: NavigatorState = RUNNING, now_us: int = NOW_US
) -> tuple[NavigatorState, NavCommand]:
    return navigate(state, given_inputs, mission_of_route(SQUARE), now_us, 43, config)


class GuidanceRun:
    """Calls `navigate` at 10 Hz while the simulated clock runs."""

    def __init__(self, config: NavigatorConfig, state: NavigatorState = RUNNING) -> None:
        self.config, self.state, self.now_us = config, state, NOW_US

    def order(self, direction: Direction, at: Odometry, route: Route = SQUARE) -> NavCommand:
        self.now_us += 100_000
        given_inputs = inputs(
            self.now_us,
            advisory=advice(direction, self.now_us),
            odometry=msgspec.structs.replace(at, source_us=self.now_us),
        )
        self.state, command = navigate(self.state, given_inputs, mission_of_route(route), self.now_us, 43, self.config)
        return command


def test_m4_straight_is_the_waypoint_bearing() -> None:
    """M4: atan2(y_w - y, x_w - x), at cruise speed."""
    _, order = run(PAPER, inputs(odometry=pose(3.0, -2.0)))
    assert order.heading_rad == pytest.approx(math.atan2(2.0, 7.0))
    assert (order.enable, order.speed_mps, order.inhibits) == (True, 0.15, ())


def test_m4_the_papers_bearing_has_no_memory_of_drift() -> None:
    """M4: half a minute 2 m off the leg adds nothing to the bearing in the paper; here it is read as drift."""
    adrift = pose(3.0, -2.0)
    paper, paani = GuidanceRun(PAPER), GuidanceRun(PAANI)
    for _ in range(300):
        assert paper.order(Direction.STRAIGHT, adrift).heading_rad == pytest.approx(math.atan2(2.0, 7.0))
    orders = [paani.order(Direction.STRAIGHT, adrift).heading_rad for _ in range(300)]
    assert orders[-1] > orders[0] + math.radians(5.0)


def test_line_of_sight_steers_back_onto_the_leg() -> None:
    """Line of sight: 2 m right of the leg with 4 m look-ahead steers atan(2/4) to the left."""
    _, order = run(PAANI, inputs(odometry=pose(3.0, -2.0)))
    assert order.heading_rad == pytest.approx(math.atan2(2.0, 4.0))
    assert order.cross_track_m == pytest.approx(-2.0)
    assert order.speed_mps == 0.6


@pytest.mark.parametrize(
    ("direction", "turn_deg"),
    [
        (Direction.LEFT, 25.0),
        (Direction.RIGHT, -25.0),
        (Direction.SLIGHT_LEFT, 10.0),
        (Direction.SLIGHT_RIGHT, -10.0),
    ],
)
@pytest.mark.parametrize("yaw_rad", [3.1, 0.3, -0.3, -2.0])
@pytest.mark.parametrize("config", [PAPER, PAANI])
def test_m5_m6_m7_visual_turns(config: NavigatorConfig, yaw_rad: float, direction: Direction, turn_deg: float) -> None:
    """M5, M6: current yaw +/- 25 or 10 deg; M7: half of cruise, in slight turns too."""
    at = pose(3.0, 0.0, yaw_rad)
    _, order = run(config, inputs(odometry=at, advisory=advice(direction)))
    wanted = yaw_rad + math.radians(turn_deg)
    assert math.cos(order.heading_rad - wanted) == pytest.approx(1.0)
    assert -math.pi <= order.heading_rad < math.pi
    assert order.speed_mps == pytest.approx(0.5 * config.cruise_mps)


def test_m5_paper_turns_are_continuous() -> None:
    """M5: in the paper's profile the ordered heading moves on with the boat's yaw, without end."""
    run_10_hz = GuidanceRun(PAPER)
    for step in range(40):
        yaw_rad = 0.1 * step
        order = run_10_hz.order(Direction.LEFT, pose(3.0, 0.0, yaw_rad))
        assert math.cos(order.heading_rad - yaw_rad) == pytest.approx(math.cos(math.radians(25.0)))
        assert (order.enable, order.speed_mps) == (True, 0.075)


def test_latched_turns_keep_their_heading() -> None:
    """M5, M7: the ordered heading stays while the boat turns towards it, at half of cruise throughout."""
    run_10_hz = GuidanceRun(PAANI)
    for step in range(4):
        order = run_10_hz.order(Direction.LEFT, pose(3.0, 0.0, yaw_rad=0.08 * step))
        assert order.heading_rad == pytest.approx(math.radians(25.0))
        assert order.speed_mps == pytest.approx(0.5 * PAANI.cruise_mps)


def test_latched_turns_add_the_next_turn_only_after_holding_the_first() -> None:
    run_10_hz = GuidanceRun(PAANI)
    run_10_hz.order(Direction.LEFT, pose(3.0, 0.0))
    on_heading = pose(3.0, 0.0, yaw_rad=math.radians(25.0))
    orders = [run_10_hz.order(Direction.LEFT, on_heading) for _ in range(18)]
    assert orders[14].heading_rad == pytest.approx(math.radians(25.0))
    assert orders[17].heading_rad == pytest.approx(math.radians(50.0))


@pytest.mark.parametrize("direction", [Direction.LEFT, Direction.RIGHT, Direction.SLIGHT_RIGHT])
def test_a_stuck_detection_cannot_spin_the_boat(direction: Direction) -> None:
    """No order lies more than 90 deg from the yaw at which the turn began; then TURN_CAPPED."""
    run_10_hz, yaw_rad, steps = GuidanceRun(PAANI), 2.0, 0
    while (order := run_10_hz.order(direction, pose(3.0, 0.0, yaw_rad))).enable:
        steps += 1
        assert steps < 600
        off = (order.heading_rad - 2.0 + math.pi) % (2.0 * math.pi) - math.pi
        assert abs(off) <= math.radians(90.0) + 1e-9
        yaw_rad = order.heading_rad
    assert order.inhibits == (Inhibit.TURN_CAPPED,)
    assert run_10_hz.order(Direction.STOP, pose(3.0, 0.0, yaw_rad)).inhibits == (Inhibit.ADVISED_STOP,)
    assert run_10_hz.order(direction, pose(3.0, 0.0, yaw_rad)).inhibits == (Inhibit.TURN_CAPPED,)
    assert run_10_hz.order(Direction.STRAIGHT, pose(3.0, 0.0, yaw_rad)).enable
    assert run_10_hz.order(direction, pose(3.0, 0.0, yaw_rad)).enable


def test_a_turn_back_is_allowed_at_the_limit_of_the_turn() -> None:
    run_10_hz = GuidanceRun(PAANI)
    run_10_hz.order(Direction.LEFT, pose(3.0, 0.0))
    order = run_10_hz.order(Direction.RIGHT, pose(3.0, 0.0, yaw_rad=math.radians(88.0)))
    assert order.enable
    assert order.heading_rad == pytest.approx(math.radians(63.0))


@pytest.mark.parametrize("direction", [Direction.LEFT, Direction.SLIGHT_LEFT])
def test_the_course_does_not_turn_back_towards_a_passed_obstacle(direction: Direction) -> None:
    """After a turn to the left, away from an obstacle, the course turns right again only `clear_m` further on."""
    run_10_hz, yaw_rad = GuidanceRun(PAANI), math.radians(30.0)
    run_10_hz.order(direction, pose(3.0, 1.0, yaw_rad))
    beside = run_10_hz.order(Direction.STRAIGHT, pose(4.0, 1.5, yaw_rad))
    assert beside.heading_rad == pytest.approx(yaw_rad)
    past = run_10_hz.order(Direction.STRAIGHT, pose(3.0 + PAANI.clear_m, 3.0, yaw_rad))
    assert past.heading_rad < 0.0


def test_the_course_does_not_turn_towards_an_occupied_side() -> None:
    run_10_hz = GuidanceRun(PAANI)
    occupied = msgspec.structs.replace(advice(Direction.STRAIGHT), right=LaneRisk(occupied=True))
    at = pose(3.0, 2.0)
    given_inputs = inputs(run_10_hz.now_us, advisory=occupied, odometry=at)
    _, command = navigate(RUNNING, given_inputs, mission_of_route(SQUARE), run_10_hz.now_us, 43, PAANI)
    assert command.heading_rad == 0.0
    open_water = inputs(run_10_hz.now_us, advisory=advice(Direction.STRAIGHT), odometry=at)
    assert navigate(RUNNING, open_water, mission_of_route(SQUARE), run_10_hz.now_us, 43, PAANI)[1].heading_rad < 0.0
    assert navigate(RUNNING, given_inputs, mission_of_route(SQUARE), run_10_hz.now_us, 43, PAPER)[1].heading_rad < 0.0


def test_m2_acceptance_radius_and_m3_repeat() -> None:
    """M2: 1 m; M3: after the last waypoint comes the first, lap after lap."""
    run_10_hz = GuidanceRun(PAPER)
    assert run_10_hz.order(Direction.STRAIGHT, pose(8.9, 0.0)).waypoint_index == 1
    assert run_10_hz.order(Direction.STRAIGHT, pose(9.1, 0.0)).waypoint_index == 2
    order = run_10_hz.order(Direction.STRAIGHT, pose(9.8, 9.8))
    assert (order.waypoint_index, order.waypoints_reached) == (3, 2)
    order = run_10_hz.order(Direction.STRAIGHT, pose(0.5, 10.0))
    assert (order.waypoint_index, order.waypoints_reached) == (0, 3)
    for reached, (x_m, y_m) in enumerate(20 * [(0.2, 0.2), (9.8, 0.2), (9.8, 9.8), (0.2, 9.8)], start=4):
        order = run_10_hz.order(Direction.STRAIGHT, pose(x_m, y_m))
        assert (order.enable, order.inhibits) == (True, ())
        assert (order.waypoint_index, order.waypoints_reached) == ((reached + 1) % 4, reached)


@pytest.mark.parametrize(("distance_m", "waypoint_index"), [(0.99, 2), (1.01, 1)])
@pytest.mark.parametrize("bearing_deg", range(0, 360, 45))
def test_m2_a_waypoint_is_reached_within_1_m_on_whatever_side(
    bearing_deg: int, distance_m: float, waypoint_index: int
) -> None:
    bearing_rad = math.radians(bearing_deg)
    at = pose(10.0 + distance_m * math.cos(bearing_rad), distance_m * math.sin(bearing_rad))
    assert GuidanceRun(PAPER).order(Direction.STRAIGHT, at).waypoint_index == waypoint_index


def test_m1_the_target_waypoint_is_kept_during_visual_turns() -> None:
    """M1: passing through the waypoint in a turn does not change the target."""
    run_10_hz = GuidanceRun(PAANI)
    assert run_10_hz.order(Direction.LEFT, pose(10.0, 0.0)).waypoint_index == 1
    assert run_10_hz.order(Direction.STOP, pose(10.0, 0.0)).waypoint_index == 1
    assert run_10_hz.order(Direction.STRAIGHT, pose(10.0, 0.0)).waypoint_index == 2


def test_a_waypoint_left_abeam_counts_as_reached_but_not_in_the_paper() -> None:
    """A waypoint that an obstacle covers is passed, not circled."""
    assert GuidanceRun(PAANI).order(Direction.STRAIGHT, pose(8.0, 1.0)).waypoint_index == 1
    past = pose(10.5, 3.0)
    assert GuidanceRun(PAANI).order(Direction.STRAIGHT, past).waypoint_index == 2
    assert GuidanceRun(PAPER).order(Direction.STRAIGHT, past).waypoint_index == 1
    far = pose(10.5, -7.0)
    assert GuidanceRun(PAANI).order(Direction.STRAIGHT, far).waypoint_index == 1


def test_past_the_end_of_a_leg_the_course_is_the_bearing_of_its_waypoint() -> None:
    """Far past the last waypoint of an open route the boat turns back to it."""
    route = msgspec.structs.replace(SQUARE, waypoints=SQUARE.waypoints[:2], repeat=False)
    run_10_hz = GuidanceRun(PAANI, msgspec.structs.replace(RUNNING, progress=MissionProgress()))
    order = run_10_hz.order(Direction.STRAIGHT, pose(30.0, 0.0), route)
    assert (order.enable, order.waypoints_reached) == (True, 0)
    assert abs(order.heading_rad) == pytest.approx(math.pi)


def test_joins_the_route_at_the_nearest_leg() -> None:
    """A navigator that restarts goes on where the boat is; nothing counts as reached."""
    run_10_hz = GuidanceRun(PAANI, msgspec.structs.replace(RUNNING, progress=MissionProgress()))
    order = run_10_hz.order(Direction.STRAIGHT, pose(6.0, 9.5))
    assert (order.waypoint_index, order.waypoints_reached) == (3, 0)


def test_route_without_repeat_ends() -> None:
    route = msgspec.structs.replace(SQUARE, repeat=False)
    run_10_hz = GuidanceRun(PAPER, at_waypoint(3))
    order = run_10_hz.order(Direction.STRAIGHT, pose(0.2, 10.0), route)
    assert (order.inhibits, order.waypoints_reached) == ((Inhibit.ROUTE_FINISHED,), 1)
    assert not run_10_hz.order(Direction.STRAIGHT, pose(5.0, 5.0), route).enable


@pytest.mark.parametrize(
    ("changes", "inhibit"),
    [
        ({"arming": None}, Inhibit.NOT_ARMED),
        ({"arming": Arming(source_us=NOW_US, armed=False)}, Inhibit.NOT_ARMED),
        ({"arming": Arming(source_us=NOW_US, armed=True, stopped=True)}, Inhibit.NOT_ARMED),
        ({"arming_us": NOW_US - 1_000_001}, Inhibit.NOT_ARMED),
        ({"arming": Arming(source_us=NOW_US - 1_000_001, armed=True)}, Inhibit.NOT_ARMED),
        ({"clock": None}, Inhibit.NO_CLOCK),
        ({"clock_us": NOW_US - 400_001}, Inhibit.NO_CLOCK),
        ({"clock": SimTime(source_us=1, sim_us=NOW_US, stamp_us=1, running=False)}, Inhibit.CLOCK_STOPPED),
        ({"odometry": None}, Inhibit.NO_ODOMETRY),
        ({"odometry_us": NOW_US - 400_001}, Inhibit.STALE_ODOMETRY),
        ({"odometry": pose(3.0, 0.0, source_us=NOW_US - 400_001)}, Inhibit.STALE_ODOMETRY),
        ({"odometry": pose(3.0, 0.0, source_us=NOW_US + 200_000)}, Inhibit.STALE_ODOMETRY),
        ({"odometry": pose(math.nan, 0.0)}, Inhibit.UNHEALTHY_ODOMETRY),
        ({"odometry": msgspec.structs.replace(pose(0, 0), healthy=False)}, Inhibit.UNHEALTHY_ODOMETRY),
        ({"advisory": None}, Inhibit.NO_ADVISORY),
        ({"advisory_us": NOW_US - 600_001}, Inhibit.STALE_ADVISORY),
        ({"advisory": advice(Direction.STRAIGHT, NOW_US - 3_500_001)}, Inhibit.STALE_ADVISORY),
        ({"advisory": advice(Direction.STRAIGHT, NOW_US + 200_000)}, Inhibit.STALE_ADVISORY),
        ({"advisory": advice(Direction.STOP)}, Inhibit.ADVISED_STOP),
        ({"advisory": advice(Direction.NO_DATA)}, Inhibit.ADVISED_NO_DATA),
        ({"odometry": msgspec.structs.replace(pose(3, 0), domain=42)}, Inhibit.WRONG_DOMAIN),
    ],
)
@pytest.mark.parametrize("config", [PAPER, PAANI])
def test_m8_m9_m10_m11_every_inhibit_is_named(
    config: NavigatorConfig, changes: dict[str, object], inhibit: Inhibit
) -> None:
    _, order = run(config, inputs(**changes))
    assert inhibit in order.inhibits
    assert (order.enable, order.speed_mps) == (False, 0.0)


def test_m10_advice_may_be_3_5_s_old_but_must_keep_coming() -> None:
    """M10: the age counts from the picture; the time since receipt is bounded separately."""
    old = inputs(advisory=advice(Direction.STRAIGHT, NOW_US - 3_400_000))
    assert run(PAPER, old)[1].enable


def test_without_a_route_the_boat_does_not_move() -> None:
    _, order = navigate(RUNNING, inputs(), None, NOW_US, 43, PAANI)
    assert order.inhibits == (Inhibit.NO_ROUTE,)


def test_m9_m11_clock_must_advance_and_a_reset_must_advance_again() -> None:
    """M9, M11: a paused clock stops the boat, and so does one that is set back, until it advances again."""
    state, now_us = NavigatorState(), NOW_US
    enabled = []
    for sim_us in (100, 150, 150, 150, 150, 150, 200, 10, 60):
        clock = SimTime(source_us=now_us, sim_us=sim_us, stamp_us=1)
        state, order = run(PAANI, inputs(now_us, clock=clock), state, now_us)
        enabled.append(order.enable)
        now_us += 110_000
    assert enabled == [False, True, True, True, True, False, True, False, True]


def test_after_a_reset_the_boat_joins_the_route_anew() -> None:
    run_10_hz = GuidanceRun(PAANI, at_waypoint(3, reached=8))
    back = inputs(clock=SimTime(source_us=NOW_US, sim_us=5, stamp_us=1))
    run_10_hz.state, order = run(PAANI, back, run_10_hz.state)
    assert order.inhibits == (Inhibit.CLOCK_STOPPED,)
    order = run_10_hz.order(Direction.STRAIGHT, pose(3.0, 0.0))
    assert (order.waypoint_index, order.waypoints_reached, order.enable) == (1, 8, True)


def test_evidence_and_plant_stamps_pass_through() -> None:
    stamped = msgspec.structs.replace(advice(Direction.STRAIGHT, NOW_US - 400_000), sent_us=NOW_US - 5)
    _, order = run(PAANI, inputs(advisory=stamped))
    assert (order.source_us, order.echo_us, order.advisory_sent_us) == (NOW_US - 400_000, 777, NOW_US - 5)


@given(
    x=st.floats(-50, 50),
    y=st.floats(-50, 50),
    yaw=st.floats(-3.14, 3.14),
    direction=st.sampled_from(Direction),
    profile=st.sampled_from([PAPER, PAANI]),
)
def test_an_order_that_moves_has_no_inhibits_and_is_finite(
    x: float, y: float, yaw: float, direction: Direction, profile: NavigatorConfig
) -> None:
    _, order = run(profile, inputs(odometry=pose(x, y, yaw), advisory=advice(direction)))
    assert order.enable == (not order.inhibits)
    assert order.enable == (direction not in {Direction.STOP, Direction.NO_DATA})
    assert -math.pi <= order.heading_rad <= math.pi
    assert 0.0 <= order.speed_mps <= profile.cruise_mps
