"""Planners of the literature: each goes round what lies ahead, keeps off what crosses, and holds a free course."""

import math

import numpy as np
import pytest

from paani.geometry import wrap_rad
from paani.motion_planning import HeadingSpeed, MotionPlanner, MovingObstacle, PlanningInputs
from paani_sim.trials.drive import Drive
from paani_sim.trials.ground_truth_evidence import GroundTruthEvidenceSource
from paani_sim.trials.peers.bendy_ruler import LOOKAHEAD_M, plan_bendy_ruler, probe_margin_m, probed_bearings_rad
from paani_sim.trials.peers.dynamic_window import plan_dynamic_window
from paani_sim.trials.peers.obstacle_points import HULL_RADIUS_M
from paani_sim.trials.peers.velocity_obstacles import MARGIN_M, plan_velocity_obstacles, time_to_points_s
from paani_sim.trials.policies import CAMERA_POLICIES, PEERS, Policy, load_policy_config
from paani_sim.worlds.imazu import build_imazu_scenario

CELLS, CELL_M, STEP_S = 100, 0.2, 0.25
SPEED_MPS, TURN_RADPS, ACCEL_MPS2 = 0.6, 0.35, 0.4
PLANNERS = [plan_bendy_ruler, plan_dynamic_window, plan_velocity_obstacles]
# Crosses the boat's way 8.5 m ahead when it is there: x, y and velocity. Only velocities tell the fast one in time.
SLOW_CROSSER, FAST_CROSSER = (8.5, -2.1, 0.0, 0.15), (8.5, -6.6, 0.0, 0.5)
CROSSINGS = [
    (plan_bendy_ruler, SLOW_CROSSER),
    (plan_dynamic_window, SLOW_CROSSER),
    (plan_velocity_obstacles, SLOW_CROSSER),
    (plan_velocity_obstacles, FAST_CROSSER),
]
Disc = tuple[float, float, float]  # x, y and radius
Crosser = tuple[float, float, float, float]  # x, y and velocity


def inputs_at(
    boat: tuple[float, float, float, float, float],
    discs: list[Disc],
    moving: tuple[MovingObstacle, ...] = (),
    previous_rad: float | None = None,
    course_rad: float = 0.0,
) -> PlanningInputs:
    """A boat x, y, yaw, surge, yaw rate on a map about it with discs."""
    west_m, south_m = (math.floor(at_m / CELL_M) * CELL_M - 0.5 * CELLS * CELL_M for at_m in boat[:2])
    middle = (np.arange(CELLS) + 0.5) * CELL_M
    occupied = np.zeros((CELLS, CELLS), np.bool_)
    for x_m, y_m, radius_m in discs:
        occupied |= (west_m + middle - x_m)[None, :] ** 2 + (south_m + middle - y_m)[:, None] ** 2 < radius_m**2
    return PlanningInputs(*boat, course_rad, SPEED_MPS, previous_rad, occupied, west_m, south_m, CELL_M, moving)


def moving_disc(x_m: float, y_m: float, east_mps: float, north_mps: float) -> MovingObstacle:
    angle = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    return MovingObstacle(x_m + 0.7 * np.cos(angle), y_m + 0.7 * np.sin(angle), east_mps, north_mps)


def sail(
    planner: MotionPlanner, discs: list[Disc], crosser: Crosser | None = None, until_s: float = 45.0
) -> tuple[float, float, float, float]:
    """A boat that turns and speeds up as the hull does, ordered to the east along y = 0.

    Returns its end, its largest distance from the line, and its least clearance to discs and crosser.
    """
    x_m = y_m = yaw_rad = speed_mps = rate_radps = 0.0
    widest_m, least_m, previous_rad = 0.0, math.inf, None
    for step in range(round(until_s / STEP_S)):
        moving: tuple[MovingObstacle, ...] = ()
        near = list(discs)
        if crosser is not None:
            east_m, north_m = crosser[0] + step * STEP_S * crosser[2], crosser[1] + step * STEP_S * crosser[3]
            moving, near = (moving_disc(east_m, north_m, *crosser[2:]),), [*discs, (east_m, north_m, 0.7)]
        course_rad = math.atan2(-y_m, 4.0)
        order = planner(inputs_at((x_m, y_m, yaw_rad, speed_mps, rate_radps), discs, moving, previous_rad, course_rad))
        previous_rad = order.heading_rad
        turn_rad = wrap_rad(order.heading_rad - yaw_rad)
        wanted_radps = TURN_RADPS * max(-1.0, min(1.0, turn_rad / 0.5))
        rate_radps += max(-TURN_RADPS * STEP_S, min(TURN_RADPS * STEP_S, wanted_radps - rate_radps))
        yaw_rad += STEP_S * rate_radps
        speed_mps += max(-ACCEL_MPS2 * STEP_S, min(ACCEL_MPS2 * STEP_S, order.speed_mps - speed_mps))
        x_m, y_m = x_m + STEP_S * speed_mps * math.cos(yaw_rad), y_m + STEP_S * speed_mps * math.sin(yaw_rad)
        widest_m = max(widest_m, abs(y_m))
        least_m = min([least_m, *(math.hypot(x_m - x, y_m - y) - radius_m for x, y, radius_m in near)])
    return x_m, y_m, widest_m, least_m


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.slow
def test_a_free_course_is_held(planner: MotionPlanner) -> None:
    x_m, y_m, widest_m, _ = sail(planner, [(10.0, 6.0, 1.0), (14.0, -6.0, 1.0)], until_s=30.0)
    assert x_m > 0.9 * SPEED_MPS * 30.0
    assert max(abs(y_m), widest_m) < 0.1


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.slow
def test_what_lies_ahead_is_passed(planner: MotionPlanner) -> None:
    x_m, y_m, widest_m, least_m = sail(planner, [(8.0, 0.1, 0.6)])
    assert x_m > 12.0
    assert abs(y_m) < 0.5
    assert widest_m > 0.8
    assert least_m > HULL_RADIUS_M - 0.1  # half a cell, as the map has it


@pytest.mark.parametrize(("planner", "crosser"), CROSSINGS)
@pytest.mark.slow
def test_a_crossing_vessel_is_not_met(planner: MotionPlanner, crosser: Crosser) -> None:
    _, _, _, met_m = sail(lambda _: HeadingSpeed(0.0, SPEED_MPS), [], crosser)
    assert met_m < 0.0
    x_m, _, _, least_m = sail(planner, [], crosser)
    assert least_m > HULL_RADIUS_M - 0.1
    assert x_m > 14.0


def test_bendy_ruler_probes_both_sides_and_resists_a_large_change() -> None:
    assert [round(math.degrees(each)) for each in probed_bearings_rad()[:5]] == [0, 5, -5, 10, -10]
    margin_m, end = probe_margin_m(np.array([[3.0, 2.0], [-4.0, 0.0]]), np.zeros(2), 0.0)
    assert (margin_m, *end) == pytest.approx((2.0, LOOKAHEAD_M, 0.0))
    wall = [(4.0, 0.3 * k - 1.5, 0.3) for k in range(11)]
    free = plan_bendy_ruler(inputs_at((0.0, 0.0, 0.0, 0.6, 0.0), wall))
    opposite = plan_bendy_ruler(inputs_at((0.0, 0.0, 0.0, 0.6, 0.0), wall, previous_rad=-free.heading_rad))
    assert abs(free.heading_rad) > math.radians(37.5)
    assert opposite.heading_rad == pytest.approx(-free.heading_rad)


def test_the_dynamic_window_stops_where_no_pair_is_admissible() -> None:
    """0.25 m before a wall, no speed that the hull can reach within a cycle stops in time."""
    wall = [(1.15, 0.2 * k - 2.0, 0.15) for k in range(21)]
    assert plan_dynamic_window(inputs_at((0.0, 0.0, 0.0, 0.6, 0.0), wall)).speed_mps == 0.0
    assert plan_dynamic_window(inputs_at((0.0, 0.0, 0.0, 0.6, 0.0), [])).speed_mps == pytest.approx(0.6)


def test_times_to_collision_by_hand() -> None:
    """A point 4.25 m ahead is met after 3 m: 6 s at 0.5 m/s; never when sailed away from, or past at 2 m."""
    velocities = np.array([[0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, 0.0]])
    times_s = time_to_points_s(np.array([[3.0 + MARGIN_M, 0.0]]), velocities)
    assert times_s[0] == pytest.approx(6.0)
    assert np.isinf(times_s[1:]).all()
    assert np.isinf(time_to_points_s(np.array([[4.0, 2.0]]), velocities[:1])).all()
    assert time_to_points_s(np.array([[1.0, 0.0]]), velocities).tolist() == [0.0, math.inf, math.inf, math.inf]


@pytest.mark.slow
def test_a_peer_steers_in_the_place_of_the_navigators_planner() -> None:
    """It is given map, tracks and course, its order is the navigator's, and no order comes before arming."""
    given: list[PlanningInputs] = []

    def steer(inputs: PlanningInputs) -> HeadingSpeed:
        given.append(inputs)
        return HeadingSpeed(wrap_rad(inputs.course_rad + 0.4), 0.35)

    scenario, config = build_imazu_scenario("imazu-03"), load_policy_config(Policy.DWA)
    drive = Drive(scenario, config, GroundTruthEvidenceSource(scenario.world, (), config), planner=steer)
    orders = []
    while drive.plant.sim_us < 6_000_000:
        drive.step()
        command = drive.autonomy.command
        if command is not None and command.enable:
            orders.append(command)
            assert drive.armed_us
    drive.close()
    assert {order.speed_mps for order in orders} == {0.35}
    assert min(order.heading_rad for order in orders) > 0.2
    assert given[-1].occupied.any()
    assert given[-1].occupied.shape == (CELLS, CELLS)
    assert (given[-1].cell_m, given[-1].speed_mps) == (CELL_M, SPEED_MPS)
    assert given[-1].previous_heading_rad == pytest.approx(orders[-1].heading_rad, abs=0.1)


def test_every_peer_sees_what_paani_sees() -> None:
    paani = load_policy_config(Policy.PAANI)
    assert set(PEERS) == {Policy.BENDY_RULER, Policy.DWA, Policy.VO}
    assert all(policy in CAMERA_POLICIES and load_policy_config(policy) == paani for policy in PEERS)
