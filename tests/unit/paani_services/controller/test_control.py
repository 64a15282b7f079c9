"""From heading and speed to thrust (N1-N8): order of operations, signs, limits, and the reasons for zero."""

import itertools
import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.config import ControllerConfig, load_config
from paani.geometry import wrap_rad
from paani.messages import Direction, Inhibit, NavCommand, Odometry, Route, Thrust, Waypoint
from paani.missions import mission_of_route
from paani_services.controller.control import ControllerInputs, ControllerState, compute_thrust
from paani_services.navigator.navigate import navigate
from tests.unit.paani_services.navigator.test_navigate import NOW_US as GUIDANCE_US
from tests.unit.paani_services.navigator.test_navigate import PAPER as PAPER_NAVIGATOR
from tests.unit.paani_services.navigator.test_navigate import advice, at_waypoint, inputs, pose

NOW_US = 9_000_000
REST = ControllerState()
PAPER = load_config(profile="paper").controller
PAANI = load_config().controller


def command(**changes: object) -> NavCommand:
    message = NavCommand(
        source_us=NOW_US - 300_000,
        enable=True,
        heading_rad=0.0,
        speed_mps=0.15,
        echo_us=123,
        sent_us=NOW_US - 20_000,
        direction=Direction.STRAIGHT,
    )
    return msgspec.structs.replace(message, **changes)


def odometry(**changes: object) -> Odometry:
    message = Odometry(source_us=NOW_US, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.15, healthy=True)
    return msgspec.structs.replace(message, **changes)


def run(
    config: ControllerConfig,
    given_command: NavCommand | None,
    given_odometry: Odometry | None,
    state: ControllerState = REST,
    now_us: int = NOW_US,
    odometry_us: int = NOW_US,
) -> tuple[ControllerState, Thrust]:
    return compute_thrust(
        state, ControllerInputs(given_command, NOW_US, given_odometry, odometry_us), now_us, 43, config
    )


def settle(config: ControllerConfig, order: NavCommand, pose: Odometry, steps: int = 60) -> Thrust:
    """The thrust after the same inputs for so many steps that the slew limit no longer matters."""
    state, message = run(config, order, pose)
    for n in range(1, steps):
        now_us = NOW_US + n * 100_000
        state, message = compute_thrust(state, ControllerInputs(order, now_us, pose, now_us), now_us, 43, config)
    return message


def test_n8_recorded_snapshot() -> None:
    """N8: SLIGHT_LEFT at half of 0.15 m/s, v = 0.0732 m/s gives fans 0.00000 / 0.02611."""
    order = command(heading_rad=math.radians(10.0), speed_mps=0.075)
    thrust = settle(PAPER, order, odometry(surge_mps=0.0732))
    assert f"{thrust.left:.5f} {thrust.right:.5f}" == "0.00000 0.02611"
    assert thrust.enabled


def test_n3_n5_n7_forward_is_p_plus_feed_forward() -> None:
    """N3: 0.16 v_ref + 0.08 (v_ref - v); N2: the order is capped at 0.30 m/s; N5: at 0.08."""
    assert settle(PAPER, command(), odometry(surge_mps=0.1)).left == pytest.approx(0.024 + 0.004)
    capped = settle(PAPER, command(speed_mps=0.9), odometry(surge_mps=0.30))
    assert capped.left == pytest.approx(0.16 * 0.30)
    assert settle(PAPER, command(speed_mps=0.30), odometry(surge_mps=-2.0)).left == pytest.approx(0.08)


def test_n4_n5_heading_pd_and_its_limit() -> None:
    """N4: 0.08 e - 0.05 r in radians; N5: no more than 0.04; a left turn needs the right fan."""
    thrust = settle(PAPER, command(heading_rad=0.2), odometry(yaw_rate_radps=0.1))
    assert (thrust.right - thrust.left) / 2.0 == pytest.approx(0.08 * 0.2 - 0.05 * 0.1)
    hard = settle(PAPER, command(heading_rad=2.0, speed_mps=0.30), odometry(surge_mps=0.1))
    assert (hard.right - hard.left) / 2.0 == pytest.approx(0.04)


@pytest.mark.parametrize("config", [PAPER, PAANI])
def test_b12_thrust_is_normalised(config: ControllerConfig) -> None:
    """B12: no fan is asked for more than its full force, whatever the limits of speed and steering add up to."""
    changes = {"max_forward": 1.0, "max_steer": 1.0, "speed_kp": 9.0, "heading_kp": 9.0, "slew_per_s": 1.0}
    strong = msgspec.structs.replace(config, **changes)
    thrust = settle(strong, command(heading_rad=1.0, speed_mps=0.3), odometry(surge_mps=0.0))
    assert (thrust.right, -config.astern <= thrust.left <= 1.0) == (1.0, True)


def test_heading_error_goes_the_short_way_round() -> None:
    thrust = settle(PAPER, command(heading_rad=math.pi - 0.1), odometry(yaw_rad=-math.pi + 0.1))
    assert thrust.heading_error_rad == pytest.approx(-0.2)
    assert thrust.left > thrust.right


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_turn_goes_on_past_a_heading_astern(side: float) -> None:
    """An order that swings about astern leaves a boat turning the way it turns; one at rest turns either way."""
    turning = odometry(yaw_rate_radps=0.3 * side)
    for astern_deg in (151.0, 179.0, 181.0, 209.0):
        thrust = settle(ControllerConfig(), command(heading_rad=wrap_rad(side * math.radians(astern_deg))), turning)
        assert (thrust.right - thrust.left) * side > 0.0
        assert abs(thrust.heading_error_rad) == pytest.approx(math.radians(astern_deg))
    for astern_deg in (149.0, 179.0, -179.0, -149.0):
        rad = math.radians(astern_deg)
        assert settle(ControllerConfig(), command(heading_rad=rad), odometry()).heading_error_rad == pytest.approx(rad)
        if abs(astern_deg) < 150.0:
            assert settle(ControllerConfig(), command(heading_rad=rad), turning).heading_error_rad == pytest.approx(rad)
        assert settle(PAPER, command(heading_rad=rad), turning).heading_error_rad == pytest.approx(rad)


def test_n6_slew_limits_each_fan_both_ways() -> None:
    """N6: 0.15 per second; at 10 Hz 0.015 per step."""
    start = ControllerState(left=0.05, right=0.0, last_us=NOW_US - 100_000)
    _, thrust = run(PAPER, command(heading_rad=0.5), odometry(), start)
    assert (thrust.left, thrust.right) == pytest.approx((0.035, 0.015))


def test_a_step_after_a_pause_is_no_larger_than_after_0_3_s() -> None:
    """A controller that did not run for long does not make up for it at once."""
    start = ControllerState(last_us=NOW_US - 10_000_000)
    _, thrust = run(PAPER, command(speed_mps=0.30), odometry(surge_mps=-2.0), start)
    assert (thrust.left, thrust.right) == pytest.approx((0.045, 0.045))


@pytest.mark.parametrize(
    ("command_us", "odometry_us", "inhibit"),
    [(NOW_US + 1, NOW_US, Inhibit.STALE_COMMAND), (NOW_US, NOW_US + 1, Inhibit.STALE_ODOMETRY)],
)
def test_what_came_after_now_gives_zero_thrust(command_us: int, odometry_us: int, inhibit: Inhibit) -> None:
    """A clock that was set back tells no age."""
    inputs = ControllerInputs(command(), command_us, odometry(), odometry_us)
    _, thrust = compute_thrust(REST, inputs, NOW_US, 43, PAANI)
    assert (thrust.left, thrust.right, thrust.enabled, thrust.inhibits) == (0.0, 0.0, False, (inhibit,))


def test_a_stop_is_zero_at_once_without_slew_limit() -> None:
    start = ControllerState(left=0.08, right=0.08, integral=0.01, last_us=NOW_US - 100_000)
    state, thrust = run(PAPER, command(enable=False, inhibits=(Inhibit.ADVISED_STOP,)), odometry(), start)
    assert (thrust.left, thrust.right, thrust.enabled) == (0.0, 0.0, False)
    assert thrust.inhibits == (Inhibit.ADVISED_STOP,)
    assert state == ControllerState()


@pytest.mark.parametrize(
    ("given_command", "given_odometry", "inhibit"),
    [
        (None, odometry(), Inhibit.NO_COMMAND),
        (command(), None, Inhibit.NO_ODOMETRY),
        (command(), odometry(healthy=False), Inhibit.UNHEALTHY_ODOMETRY),
        (command(), odometry(surge_mps=math.nan), Inhibit.UNHEALTHY_ODOMETRY),
        (command(), odometry(yaw_rate_radps=math.nan), Inhibit.UNHEALTHY_ODOMETRY),
        (command(), odometry(yaw_rad=math.nan), Inhibit.UNHEALTHY_ODOMETRY),
        (command(heading_rad=math.nan), odometry(), Inhibit.COMMAND_INVALID),
        (command(heading_rad=math.inf), odometry(), Inhibit.COMMAND_INVALID),
        (command(speed_mps=math.inf), odometry(), Inhibit.COMMAND_INVALID),
        (command(speed_mps=-0.1), odometry(), Inhibit.COMMAND_INVALID),
        (command(frame="odom"), odometry(), Inhibit.COMMAND_INVALID),
        (command(frame="base_link"), odometry(), Inhibit.COMMAND_INVALID),
        (command(enable=False), odometry(), Inhibit.COMMAND_INVALID),
        (command(inhibits=(Inhibit.NO_ROUTE,)), odometry(), Inhibit.COMMAND_INVALID),
        (command(domain=44), odometry(), Inhibit.WRONG_DOMAIN),
        (command(domain=42), odometry(), Inhibit.WRONG_DOMAIN),
    ],
)
def test_b11_an_invalid_order_or_estimate_gives_zero_thrust(
    given_command: NavCommand | None, given_odometry: Odometry | None, inhibit: Inhibit
) -> None:
    """B11: heading, speed, enable, frame and validity are checked together."""
    _, thrust = run(PAANI, given_command, given_odometry)
    assert inhibit in thrust.inhibits
    assert (thrust.left, thrust.right, thrust.enabled) == (0.0, 0.0, False)


def test_receipt_ages_are_bounded() -> None:
    late_us = NOW_US + round(PAANI.command_max_receipt_s * 1e6) + 1
    _, thrust = run(PAANI, command(), odometry(), now_us=late_us, odometry_us=late_us)
    assert thrust.inhibits == (Inhibit.STALE_COMMAND,)
    _, thrust = run(PAANI, command(), odometry(), odometry_us=NOW_US - 400_001)
    assert thrust.inhibits == (Inhibit.STALE_ODOMETRY,)


def test_the_order_s_stamps_pass_through() -> None:
    """The plant judges age by its own stamp; latency is measured from the evidence."""
    _, thrust = run(PAANI, command(), odometry())
    assert (thrust.echo_us, thrust.source_us) == (123, NOW_US - 300_000)
    assert thrust.command_sent_us == NOW_US - 20_000


def test_l5_speed_noise_at_rest_turns_no_fan() -> None:
    """L5: a boat that is stopped gets no thrust against the noise of its speed."""
    still = command(speed_mps=0.0)
    guarded = settle(PAPER, still, odometry(surge_mps=-0.04, stopped=True))
    unguarded = settle(PAPER, still, odometry(surge_mps=-0.04, stopped=False))
    assert guarded.left == guarded.right == 0.0
    assert unguarded.left > 0.0
    state, thrust = run(PAANI, still, odometry(surge_mps=0.0, stopped=True), ControllerState(integral=0.05))
    assert (thrust.left, thrust.right, state.integral) == (0.0, 0.0, 0.0), "nor for what was summed before"


@pytest.mark.parametrize("speed_mps", [0.15, 0.3, 0.6, 0.9])
def test_drag_inverse_feed_forward(speed_mps: float) -> None:
    """At the ordered speed the fans give exactly the drag of the hull, (4 v + 20 v^2) / 150."""
    thrust = settle(PAANI, command(speed_mps=speed_mps), odometry(surge_mps=speed_mps))
    assert thrust.left == pytest.approx((4.0 * speed_mps + 20.0 * speed_mps**2) / 150.0)


def test_the_integral_does_not_wind_up_while_saturated() -> None:
    """A boat held fast for a minute has full forward thrust and an integral of zero."""
    state = REST
    for n in range(600):
        now_us = NOW_US + n * 100_000
        held = ControllerInputs(command(speed_mps=0.6), now_us, odometry(surge_mps=0.0), now_us)
        state, _ = compute_thrust(state, held, now_us, 43, PAANI)
    assert state.left == PAANI.max_forward
    assert state.integral == 0.0


@given(
    heading=st.floats(-10, 10),
    speed=st.floats(0, 5),
    yaw=st.floats(-4, 4),
    surge=st.floats(-3, 3),
    rate=st.floats(-3, 3),
    left=st.floats(-1, 1),
    right=st.floats(-1, 1),
    step_us=st.integers(20_000, 300_000),
    profile=st.sampled_from([PAPER, PAANI]),
)
@pytest.mark.slow
def test_thrust_is_bounded_and_in_the_paper_never_astern(
    heading: float,
    speed: float,
    yaw: float,
    surge: float,
    rate: float,
    left: float,
    right: float,
    step_us: int,
    profile: ControllerConfig,
) -> None:
    """N7: whatever the inputs, both fans stay in range, in the paper never astern, and are slewed."""
    left, right = max(left, -profile.astern), max(right, -profile.astern)
    start = ControllerState(left=left, right=right, last_us=NOW_US - step_us)
    pose = odometry(yaw_rad=yaw, surge_mps=surge, yaw_rate_radps=rate)
    _, thrust = run(profile, command(heading_rad=heading, speed_mps=speed), pose, start)
    assert PAPER.astern == 0.0
    assert -profile.astern <= thrust.left <= 1.0
    assert -profile.astern <= thrust.right <= 1.0
    assert abs(thrust.left - left) <= profile.slew_per_s * step_us * 1e-6 + 1e-9
    assert abs(thrust.right - right) <= profile.slew_per_s * step_us * 1e-6 + 1e-9


@pytest.mark.parametrize(("heading_rad", "fans"), [(1.5, (-0.10, 0.10)), (-1.5, (0.10, -0.10))])
def test_a_turn_at_rest_is_a_pure_couple(heading_rad: float, fans: tuple[float, float]) -> None:
    """One fan pushes as much astern as the other ahead: the boat turns on the spot."""
    thrust = settle(PAANI, command(heading_rad=heading_rad, speed_mps=0.0), odometry(surge_mps=0.0))
    assert (thrust.left, thrust.right) == pytest.approx(fans)


def test_a_boat_faster_than_ordered_brakes() -> None:
    """Both fans push astern, at most `astern`; fans that only push are off."""
    fast = odometry(surge_mps=0.9)
    braking = settle(PAANI, command(speed_mps=0.06), fast)
    assert -PAANI.astern <= braking.left == braking.right < 0.0
    pushing = settle(load_config(profile="fans").controller, command(speed_mps=0.06), fast)
    assert (pushing.left, pushing.right) == (0.0, 0.0)


def test_a_disabled_order_is_not_driven_astern() -> None:
    """A disabled order is zero thrust at once, whatever the fans did and however fast the boat is."""
    start = ControllerState(integral=-0.03, left=-0.1, right=-0.1, last_us=NOW_US - 100_000)
    _, thrust = run(PAANI, command(enable=False, speed_mps=0.0), odometry(surge_mps=0.9), start)
    assert (thrust.left, thrust.right, thrust.enabled) == (0.0, 0.0, False)


def test_a_hand_may_go_astern_and_the_papers_fans_still_only_push() -> None:
    """Astern the drag is held against as ahead; a boat that still goes ahead brakes as hard as it may."""
    astern = command(speed_mps=0.0, astern_mps=0.3)
    at_rest = settle(PAANI, astern, odometry(surge_mps=0.0, stopped=True), steps=10)
    assert at_rest.enabled
    assert -PAANI.astern <= at_rest.left < 0.0
    steady, ahead = (
        settle(PAANI, order, odometry(surge_mps=surge_mps), steps=10)
        for order, surge_mps in ((astern, -0.3), (command(speed_mps=0.3), 0.3))
    )
    assert steady.left == pytest.approx(-ahead.left)
    assert settle(PAANI, astern, odometry(surge_mps=0.8)).left == -PAANI.astern
    paper = settle(PAPER, astern, odometry(surge_mps=0.0))
    assert (paper.left, paper.right) == (0.0, 0.0)


@pytest.mark.parametrize("astern_mps", [-0.1, math.nan, math.inf])
def test_an_order_astern_that_makes_no_sense_is_invalid(astern_mps: float) -> None:
    for speed_mps in (0.0, 0.2):
        _, thrust = run(PAANI, command(speed_mps=speed_mps, astern_mps=astern_mps), odometry())
        assert thrust.inhibits == (Inhibit.COMMAND_INVALID,)
    _, both = run(PAANI, command(speed_mps=0.2, astern_mps=0.2), odometry())
    assert both.inhibits == (Inhibit.COMMAND_INVALID,)


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["left", "right"])
def test_n4_n5_n7_steering_to_either_side(side: float) -> None:
    """P and D of a small error; of a large one the limit, which the rate of a turn back does not pass."""
    thrust = settle(PAPER, command(heading_rad=side * 0.2), odometry(yaw_rate_radps=side * 0.1))
    assert (thrust.right - thrust.left) / 2.0 == pytest.approx(side * (0.08 * 0.2 - 0.05 * 0.1))
    order = command(heading_rad=side * 2.0, speed_mps=0.30)
    thrust = settle(PAPER, order, odometry(surge_mps=0.1, yaw_rate_radps=-side * 0.5))
    assert (thrust.left, thrust.right) == pytest.approx((0.064 - side * 0.04, 0.064 + side * 0.04))


def test_n7_no_fan_is_asked_for_more_than_all_it_has() -> None:
    strong = msgspec.structs.replace(
        PAPER, max_forward=1.0, max_steer=0.5, speed_feed_forward=4.0, heading_kp=1.0, slew_per_s=10.0
    )
    thrust = settle(strong, command(heading_rad=2.0, speed_mps=0.30), odometry(surge_mps=0.30))
    assert (thrust.left, thrust.right) == (0.5, 1.0)


def test_n8_slight_left_towards_waypoint_12_gives_the_recorded_thrust() -> None:
    """N8: from the advice on, with the paper's turn, speed and gains."""
    waypoints = tuple(Waypoint(x_m=10.0 * number, y_m=0.0) for number in range(20))
    mission = mission_of_route(Route(source_us=0, name="line", waypoints=waypoints))
    given_inputs = inputs(odometry=pose(115.0, 0.0), advisory=advice(Direction.SLIGHT_LEFT))
    _, order = navigate(at_waypoint(12), given_inputs, mission, GUIDANCE_US, 43, PAPER_NAVIGATOR)
    assert (order.enable, order.waypoint_index, order.direction) == (True, 12, Direction.SLIGHT_LEFT)
    thrust = settle(PAPER, order, odometry(surge_mps=0.0732))
    assert (f"{thrust.left:.5f} {thrust.right:.5f}", thrust.enabled) == ("0.00000 0.02611", True)


@pytest.mark.parametrize(("ordered_mps", "target_mps"), [(0.29, 0.29), (0.30, 0.30), (0.31, 0.30), (5.0, 0.30)])
def test_n2_no_order_asks_for_more_than_0_30_mps_ahead_or_astern(ordered_mps: float, target_mps: float) -> None:
    for stopped in (False, True):
        at_rest = odometry(surge_mps=0.0, stopped=stopped)
        ahead = settle(PAPER, command(speed_mps=ordered_mps), at_rest)
        astern = settle(PAPER, command(speed_mps=0.0, astern_mps=ordered_mps), at_rest)
        assert (ahead.speed_error_mps, astern.speed_error_mps) == pytest.approx((target_mps, -target_mps))


@pytest.mark.parametrize("period_us", [20_000, 50_000, 100_000])
def test_n6_no_fan_changes_faster_however_often_orders_come(period_us: int) -> None:
    """N6: from the first step on, which counts as one at 10 Hz."""
    state, fans = REST, [(0.0, 0.0)]
    for number in range(30):
        now_us, heading_rad = NOW_US + number * period_us, 2.0 if number < 15 else -2.0
        order = command(heading_rad=heading_rad, speed_mps=0.30)
        given_inputs = ControllerInputs(order, now_us, odometry(surge_mps=0.0), now_us)
        state, thrust = compute_thrust(state, given_inputs, now_us, 43, PAPER)
        fans.append((thrust.left, thrust.right))
    changes = [max(abs(b - a) for a, b in zip(*pair, strict=True)) for pair in itertools.pairwise(fans)]
    assert changes[0] <= 0.015 + 1e-9
    assert max(changes[1:]) == pytest.approx(0.15 * period_us * 1e-6)


@pytest.mark.parametrize("config", [PAPER, PAANI])
def test_l5_a_stopped_boat_that_is_ordered_ahead_is_driven_as_one_at_rest(config: ControllerConfig) -> None:
    """L5: the guard holds for hardly any order ahead; under a larger one its speed still counts as none."""
    order = command(speed_mps=0.05)
    at_rest, *noisy = (settle(config, order, odometry(surge_mps=v, stopped=True)) for v in (0.0, -0.04, 0.04))
    assert at_rest.left == at_rest.right > 0.0
    assert [(each.left, each.right) for each in noisy] == [(at_rest.left, at_rest.right)] * 2
