"""The guidance chain in lockstep: what it holds, where it stops, and that it repeats bit by bit."""

import math
import statistics

import numpy as np
import pytest

from paani.geometry import wrap_rad
from paani.messages import Direction, Inhibit, ZeroCause
from paani_sim.worlds import load_world
from tests.guidance_loop import Lockstep, off_route_m, open_water
from tests.scenario.conftest import Launch


def test_l4_m3_follows_three_waypoints_of_the_lake(launch: Launch) -> None:
    """Guided by estimates alone: GPS bias of 0.8 m per axis is the error that remains (L4)."""
    boat = launch(load_world("lake"))
    speeds, off_m = [], []
    for _ in boat.run(50.0):
        if boat.plant.sim_us > 10e6:
            speeds.append(boat.plant.velocity[0])
            off_m.append(off_route_m(boat.world, boat.plant.position_m))
    assert boat.nav.progress.waypoints_reached >= 3
    assert boat.plant.collisions == 0
    assert boat.applied.zero_cause is ZeroCause.NONE
    assert statistics.fmean(speeds) == pytest.approx(0.6, abs=0.02)
    assert statistics.pstdev(speeds) < 0.03
    assert max(off_m) < 2.5


@pytest.mark.rotating(cpu_s=10)
@pytest.mark.parametrize("name", ["lake", "river"])
def test_with_perfect_sensors_cruise_is_smooth_and_on_the_line(launch: Launch, name: str) -> None:
    """With a perfect GPS and compass the guidance itself stays within 0.15 m of the route."""
    perfect = ("plant.sensors.gps_bias_std_m=0.0", "plant.sensors.compass_bias_std_rad=0.0")
    boat = launch(open_water(name), "paani", *perfect)
    off_m, steering = [], []
    for _ in boat.run(150.0):
        assert boat.thrust is not None
        if boat.plant.sim_us > 15e6:
            off_m.append(off_route_m(boat.world, boat.plant.position_m))
            steering.append(boat.thrust.right - boat.thrust.left)
    assert boat.nav.progress.waypoints_reached >= 10
    assert max(off_m) < 0.15
    assert statistics.pstdev(steering) < 0.02


def mean_speed_mps(boat: Lockstep, settle_s: float, measure_s: float) -> float:
    boat.settle(settle_s)
    return statistics.fmean(boat.plant.velocity[0] for _ in boat.run(measure_s))


def test_n3_paper_speed_loop_is_70_percent_off(launch: Launch) -> None:
    """N3: with the paper's gains an order of 0.15 m/s gives 0.256 m/s."""
    boat = launch(open_water("lake"), "paper")
    assert mean_speed_mps(boat, 30.0, 40.0) == pytest.approx(0.256, abs=0.006)


@pytest.mark.parametrize("order_mps", [0.15, 0.3, 0.6, 0.9])
def test_paani_holds_the_ordered_speed(launch: Launch, order_mps: float) -> None:
    """With our gains the speed is within 0.02 m/s of the order, with the estimator in the loop."""
    boat = launch(open_water("lake"), "paani", f"navigator.cruise_mps={order_mps}")
    assert mean_speed_mps(boat, 15.0, 40.0) == pytest.approx(order_mps, abs=0.02)


def test_a_constant_left_ends_within_90_degrees_and_stops_the_boat(launch: Launch) -> None:
    """The boat turns by 90 degrees and comes to rest; STRAIGHT lets it go on."""
    boat = launch(open_water("lake"))
    boat.settle(15.0)
    start_rad = boat.plant.attitude.yaw_rad
    boat.direction = Direction.LEFT
    turned = [wrap_rad(boat.plant.attitude.yaw_rad - start_rad) for _ in boat.run(60.0)]
    assert math.degrees(max(turned)) < 97.0
    assert abs(boat.plant.velocity[0]) < 0.02
    assert boat.command is not None
    assert boat.command.inhibits == (Inhibit.TURN_CAPPED,)
    boat.direction = Direction.STRAIGHT
    boat.settle(15.0)
    assert boat.plant.velocity[0] > 0.5


@pytest.mark.rotating(cpu_s=5)
def test_m5_a_constant_left_turns_the_paper_s_boat_in_circles(launch: Launch) -> None:
    """M5: with the paper's profile a constant LEFT turns the boat through more than a full circle."""
    boat = launch(open_water("lake"), "paper")
    boat.settle(15.0)
    boat.direction = Direction.LEFT
    turned_rad = sum(boat.plant.velocity[2] * 0.1 for _ in boat.run(150.0))
    assert turned_rad > 2.0 * math.pi


@pytest.mark.parametrize("advice", [Direction.STOP, Direction.NO_DATA])
def test_m8_advice_that_is_no_direction_stops_within_a_step(launch: Launch, advice: Direction) -> None:
    """M8: zero thrust one guidance step later, and a boat at rest soon after."""
    boat = launch(open_water("lake"))
    boat.settle(15.0)
    assert boat.applied.left_n > 0.0
    boat.direction = advice
    boat.settle(0.2)
    assert (boat.applied.left_n, boat.applied.right_n) == (0.0, 0.0)
    assert boat.applied.zero_cause is ZeroCause.NOT_ENABLED
    boat.settle(15.0)
    assert abs(boat.plant.velocity[0]) < 0.02


def test_thrust_astern_turns_the_boat_within_its_length(launch: Launch) -> None:
    """The reason for `controller.astern`: with fans that only push, the same turn carries the boat on."""
    ahead_m = {}
    for profile in ("paani", "fans"):
        boat = launch(open_water("lake"), profile, "navigator.cruise_mps=0.06")
        boat.settle(15.0)
        start_m, start_rad = boat.plant.position_m, boat.plant.attitude.yaw_rad
        boat.heading_rad = start_rad + math.radians(170.0)
        way_m, turned = [], 0.0
        for _ in boat.run(12.0):
            off_m = np.subtract(boat.plant.position_m, start_m)
            way_m.append(float(off_m @ (math.cos(start_rad), math.sin(start_rad))))
            turned = wrap_rad(boat.plant.attitude.yaw_rad - start_rad)
        assert abs(turned) > math.radians(100.0)
        ahead_m[profile] = max(way_m)
    assert ahead_m["paani"] < 0.5 * 1.3
    assert ahead_m["fans"] > 1.3


def test_thrust_astern_brakes_a_boat_that_is_ordered_to_stand(launch: Launch) -> None:
    """The reason for `planner.brake_s`: with zero thrust only drag stops the boat, twice as far on."""
    way_m = {}
    for is_ordered_to_stand in (True, False):
        boat = launch(open_water("lake"))
        boat.settle(15.0)
        start_m, brake_s = boat.plant.position_m, boat.config.navigator.planner.brake_s
        boat.is_ordered_to_stand = is_ordered_to_stand
        boat.direction = Direction.STRAIGHT if is_ordered_to_stand else Direction.STOP
        boat.settle(brake_s)
        if is_ordered_to_stand:
            assert boat.plant.velocity[0] < 0.1
        boat.direction = Direction.STOP
        boat.settle(10.0)
        way_m[is_ordered_to_stand] = math.dist(start_m, boat.plant.position_m)
    assert way_m[True] < 0.5
    assert way_m[True] < 0.5 * way_m[False]


def test_a_disarmed_boat_does_not_move(launch: Launch) -> None:
    boat = launch(load_world("lake"))
    boat.armed = False
    boat.settle(20.0)
    assert boat.plant.distance_m < 1e-6
    assert boat.applied.zero_cause is ZeroCause.NOT_ARMED


def test_lockstep_repeats_bit_by_bit(launch: Launch) -> None:
    """The same seed gives the same run through the whole chain."""

    def trace(seed: int) -> str:
        boat = launch(load_world("river"), seed=seed)
        boat.settle(12.0)
        return boat.plant.state_hash()

    assert trace(3) == trace(3)
    assert trace(3) != trace(4)
