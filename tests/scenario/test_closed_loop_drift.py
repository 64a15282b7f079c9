"""The guidance chain in wind and current: plant, sensors, estimator, navigator, controller, thrust adapter."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator

import msgspec
import pytest

from paani.fence_geometry import distance_to_edge_m, is_allowed
from paani.messages import Advisory, Direction, FenceArea, Inhibit, Keep, Reason, Waypoint
from paani.motion_planning import HeadingSpeed, PlanningInputs
from paani_sim.worlds import Current, Wind, World
from tests.guidance_loop import Lockstep, off_route_m, open_water
from tests.scenario.conftest import Launch
from tests.synthetic_water import AT_REST, CAMERA, evidence, water_edge_of

PERFECT = ("plant.sensors.gps_bias_std_m=0.0", "plant.sensors.compass_bias_std_rad=0.0", "plant.vessel=otter")


@pytest.fixture
def windy_lake() -> World:
    """6 m/s of wind and 0.15 m/s of current, across each other."""
    return dataclasses.replace(
        open_water("lake"), wind=Wind(speed_mps=6.0, toward_rad=0.6), current=Current(speed_mps=0.15, toward_rad=2.2)
    )


def cross_track_m(boat: Lockstep) -> Iterator[float]:
    boat.settle(60.0)
    for _ in boat.run(30.0):
        yield off_route_m(boat.world, boat.plant.position_m)


def test_the_true_boat_comes_to_rest_inside_the_fence(launch: Launch, windy_lake: World) -> None:
    """The fence cuts the route: while the boat brakes, its true position stays inside in spite of wind and current."""
    boat = launch(windy_lake, "paani", *PERFECT)
    start = boat.plant.position_m
    corners = [(start[0] + x, start[1] + y) for x, y in ((-18.0, -60.0), (40.0, -60.0), (40.0, 60.0), (-18.0, 60.0))]
    area = FenceArea(keep=Keep.IN, corners=tuple(Waypoint(x_m=x, y_m=y) for x, y in corners))
    boat.mission = msgspec.structs.replace(boat.mission, fence=(area,))
    fastest_mps = 0.0
    for _ in boat.run(90.0):
        fastest_mps = max(fastest_mps, boat.plant.velocity[0])
        assert boat.command is not None
        if Inhibit.OUTSIDE_FENCE in boat.command.inhibits and boat.plant.velocity[0] < 0.1:
            break
    assert fastest_mps > 0.5
    assert is_allowed(boat.mission.fence, boat.plant.position_m)
    assert distance_to_edge_m(boat.mission.fence, boat.plant.position_m) < 6.0


def test_the_integral_holds_the_line_against_wind_and_current(launch: Launch, windy_lake: World) -> None:
    """A minute after the start the boat is on its line; without the integral it is more than a metre off."""
    worst_m = {}
    for gain_mps in (0.0, 0.25):
        boat = launch(windy_lake, "paani", *PERFECT, f"navigator.crab_gain_mps={gain_mps}")
        worst_m[gain_mps] = max(cross_track_m(boat))
    assert worst_m[0.25] < 0.25
    assert worst_m[0.0] > 1.0


def halt(given: PlanningInputs) -> HeadingSpeed:
    """No path."""
    return HeadingSpeed(given.yaw_rad, 0.0)


def stop_by_the_advice(boat: Lockstep) -> Inhibit:
    boat.advisory = Advisory(
        source_us=boat.now_us, direction=Direction.STOP, reason=Reason.NO_SAFE_SIDE, may_keep_station=True
    )
    return Inhibit.ADVISED_STOP


def stop_by_the_planner(boat: Lockstep) -> Inhibit:
    boat.planner, boat.evidence = halt, evidence(boat.now_us, water_edge_of(AT_REST))
    return Inhibit.NO_FREE_PATH


def farthest_while_stopped_m(boat: Lockstep, stop: Callable[[Lockstep], Inhibit]) -> float:
    """How far the boat ever is from where it was [m] in 90 s of a STOP for what lies on the water, or of no path."""
    boat.camera = CAMERA
    from_m, farthest_m, reason = boat.plant.position_m, 0.0, stop(boat)
    for _ in boat.run(90.0):
        stop(boat)
        farthest_m = max(farthest_m, math.dist(from_m, boat.plant.position_m))
    assert boat.command is not None
    assert boat.command.halt_reasons == (reason,)
    return farthest_m


@pytest.mark.parametrize(
    ("stop", "to_the_bow_rad"),
    [
        pytest.param(stop_by_the_advice, 0.0, id="advice, bow first"),
        pytest.param(stop_by_the_advice, math.pi, id="advice, stern first", marks=pytest.mark.long),
        pytest.param(stop_by_the_advice, 0.5 * math.pi, id="advice, abeam"),
        pytest.param(stop_by_the_planner, 0.0, id="planner, bow first", marks=pytest.mark.long),
        pytest.param(stop_by_the_planner, math.pi, id="planner, stern first"),
        pytest.param(stop_by_the_planner, 0.5 * math.pi, id="planner, abeam", marks=pytest.mark.long),
    ],
)
def test_a_stopped_boat_does_not_drift_on_to_what_it_stopped_for(
    launch: Launch, stop: Callable[[Lockstep], Inhibit], to_the_bow_rad: float
) -> None:
    """0.2 m/s of current from any side: in 90 s it is never as far away as one that drifts is in 10 s."""
    lake = open_water("lake")
    current = Current(speed_mps=0.2, toward_rad=lake.start.yaw_rad + to_the_bow_rad)
    streaming = dataclasses.replace(lake, current=current)
    adrift_m, kept_m = (
        farthest_while_stopped_m(launch(streaming, "paani", *PERFECT, f"navigator.keep_station={keeps}"), stop)
        for keeps in ("false", "true")
    )
    assert adrift_m > 10.0
    assert kept_m < 10.0 / 90.0 * adrift_m


@pytest.mark.parametrize("to_the_bow_rad", [0.0, math.pi, 0.5 * math.pi], ids=["bow first", "stern first", "abeam"])
def test_a_boat_that_stopped_under_way_notices_that_it_is_carried_slowly(launch: Launch, to_the_bow_rad: float) -> None:
    """0.04 m/s of current, with the simulator's receiver and IMU: it is kept within a metre for 90 s."""
    lake = open_water("lake")
    current = Current(speed_mps=0.04, toward_rad=lake.start.yaw_rad + to_the_bow_rad)
    boat = launch(dataclasses.replace(lake, current=current))
    boat.settle(15.0)
    assert boat.plant.velocity[0] > 0.3
    boat.camera = CAMERA
    for _ in boat.run(10.0):
        stop_by_the_advice(boat)
    from_m = boat.plant.position_m
    for _ in boat.run(90.0):
        stop_by_the_advice(boat)
    assert math.dist(from_m, boat.plant.position_m) < 1.0
