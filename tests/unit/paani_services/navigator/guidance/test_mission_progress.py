"""Missions under way: legs in order, what each asks for, and when the next is due."""

from __future__ import annotations

import math

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import keys
from paani.config import load_config
from paani.decider import Input
from paani.messages import Arming, Direction, Inhibit, LegKind, Mission, MissionLeg, Odometry, Route, Waypoint
from paani_services.navigator.decide import DECIDER
from paani_services.navigator.guidance.mission_progress import MissionInputs, MissionProgress, advance_mission
from paani_services.navigator.navigate import NavigatorState
from tests.unit.paani_services.navigator.drifting_boat import DriftingBoat

PAANI = load_config().navigator


def at(x_m: float, y_m: float) -> tuple[Waypoint, ...]:
    return (Waypoint(x_m=x_m, y_m=y_m),)


def follow(*points: tuple[float, float], repeat: bool = False, laps: int = 1) -> MissionLeg:
    waypoints = tuple(Waypoint(x_m=x, y_m=y) for x, y in points)
    return MissionLeg(kind=LegKind.FOLLOW_ROUTE, waypoints=waypoints, repeat=repeat, laps=laps)


def hold(place: tuple[Waypoint, ...] = (), radius_m: float = 4.0, duration_s: float = 0.0) -> MissionLeg:
    return MissionLeg(kind=LegKind.HOLD_STATION, waypoints=place, radius_m=radius_m, duration_s=duration_s)


HOME = MissionLeg(kind=LegKind.RETURN_HOME)
STOP = MissionLeg(kind=LegKind.STOP)
SQUARE = ((0.0, 0.0), (12.0, 0.0), (12.0, 12.0), (0.0, 12.0))


def boat(*legs: MissionLeg, **start: object) -> DriftingBoat:
    return DriftingBoat(Mission(source_us=0, name="m", legs=legs), PAANI, **start)  # type: ignore[arg-type]


def until(ship: DriftingBoat, leg: int, limit_s: float = 300.0) -> float:
    """Seconds until the leg is due."""
    for number, order in enumerate(ship.run(limit_s)):
        if order.leg_index >= leg:
            return number * 0.1
    raise AssertionError(f"leg {leg} was not reached in {limit_s} s")


@pytest.mark.slow
def test_a_mission_of_route_station_and_home_is_done_at_home() -> None:
    """A route, half a minute on station, then home, which is where the boat was first armed; then nothing is left."""
    ship = boat(follow((0, 0), (20, 0)), hold(at(20, 10), duration_s=30.0), HOME, at_m=(-3.0, 1.0))
    until(ship, 1)
    assert math.dist(ship.position_m, (20.0, 0.0)) < 2.0
    assert until(ship, 2) > 30.0
    assert math.dist(ship.position_m, (20.0, 10.0)) < 4.0
    until(ship, 3)
    order = ship.settle(10.0)
    assert order.inhibits == (Inhibit.MISSION_DONE,)
    assert math.dist(ship.position_m, (-3.0, 1.0)) < 2.0
    assert (order.leg, order.leg_index) == ("done", 3)


@pytest.mark.parametrize("direction", list(Direction))
def test_a_mission_that_is_done_stays_done_whatever_is_advised(direction: Direction) -> None:
    ship = boat(HOME)
    ship.settle(1.0)
    ship.direction = direction
    assert Inhibit.MISSION_DONE in ship.settle(0.1).inhibits


@pytest.mark.slow
def test_m3_laps_of_a_route_that_repeats() -> None:
    """M3: two laps reach as many waypoints as two laps have; then the next leg is due."""
    ship = boat(follow(*SQUARE, repeat=True, laps=2), STOP, at_m=(5.0, 0.0))
    ship.settle(1.0)
    assert ship.state.progress.leg_index == 0
    until(ship, 1)
    assert ship.state.progress.waypoints_reached == 8
    assert ship.settle(0.1).inhibits == (Inhibit.HOLDING,)


@pytest.mark.slow
def test_the_order_names_the_lap() -> None:
    ship = boat(follow(*SQUARE, repeat=True, laps=3), at_m=(5.0, 0.0))
    assert ship.settle(1.0).leg == "follow route, lap 1 of 3"
    ship.settle(100.0)
    assert ship.order is not None
    assert ship.order.leg == "follow route, lap 2 of 3"


@pytest.mark.slow
def test_on_station_there_is_no_thrust_until_the_boat_leaves_the_radius() -> None:
    """Beyond the radius the boat comes back at half its speed until half the radius, then has no thrust again."""
    ship = boat(hold(radius_m=4.0), drift_mps=(0.1, 0.05))
    ship.settle(0.2)
    moving, away_m = [], []
    for order in ship.run(240.0):
        away_m.append(math.dist(ship.position_m, (0.0, 0.0)))
        moving.append(order.enable)
        if order.enable:
            assert order.speed_mps == pytest.approx(0.3)
        else:
            assert order.inhibits == (Inhibit.HOLDING,)
    assert max(away_m) < 6.0
    assert not any(moving[:300])
    assert moving.count(True) > 50
    assert moving.count(False) > moving.count(True)


@pytest.mark.parametrize("direction", [Direction.STOP, Direction.NO_DATA])
def test_advice_is_a_veto_on_station_too(direction: Direction) -> None:
    ship = boat(hold(radius_m=4.0), drift_mps=(0.2, 0.0))
    ship.settle(1.0)
    ship.direction = direction
    assert not any(order.enable for order in ship.run(60.0))


def test_a_stop_leg_ends_when_the_boat_is_stopped_and_armed_again() -> None:
    ship = boat(STOP, follow((0, 0), (20, 0)))
    assert ship.settle(60.0).inhibits == (Inhibit.HOLDING,)
    ship.armed, ship.stopped = False, True
    assert Inhibit.NOT_ARMED in ship.settle(1.0).inhibits
    ship.armed, ship.stopped = True, True
    assert ship.settle(1.0).leg_index == 0, "stopped all the same"
    ship.armed, ship.stopped = True, False
    order = ship.settle(0.1)
    assert (order.leg_index, order.enable) == (1, True)


def test_a_restart_of_the_operator_s_process_does_not_end_a_leg() -> None:
    ship = boat(hold(), follow((0, 0), (20, 0)))
    ship.settle(10.0)
    ship.armed, ship.epoch = False, 2
    ship.settle(1.0)
    ship.armed = True
    assert ship.settle(20.0).inhibits == (Inhibit.HOLDING,)


def test_a_stop_during_a_route_does_not_skip_a_leg() -> None:
    ship = boat(follow((0, 0), (30, 0)), hold())
    ship.settle(10.0)
    ship.armed, ship.stopped = False, True
    ship.settle(2.0)
    ship.armed, ship.stopped = True, False
    order = ship.settle(1.0)
    assert (order.leg_index, order.enable) == (0, True)


def test_home_and_the_first_leg_begin_where_the_boat_is_armed() -> None:
    """Home is where the boat was armed, not where the process started: it may have been carried to the water."""
    ship = boat(follow((0, 0), (20, 0)), HOME, at_m=(-50.0, -50.0))
    ship.armed = False
    ship.settle(5.0)
    assert ship.state.progress.home is None
    ship.x_m, ship.y_m, ship.armed = 1.0, 1.0, True
    ship.settle(0.1)
    assert ship.state.progress.home == Waypoint(x_m=1.0, y_m=1.0)


def test_a_leg_home_leads_to_the_home_that_the_mission_names() -> None:
    mission = Mission(source_us=0, name="m", legs=(HOME,), home=at(9, 0))
    ship = DriftingBoat(mission, PAANI, at_m=(-3.0, 1.0))
    until(ship, 1)
    assert math.dist(ship.position_m, (9.0, 0.0)) < 2.0


def test_a_boat_at_home_returns_home_at_once() -> None:
    order = boat(HOME).settle(0.2)
    assert order.inhibits == (Inhibit.MISSION_DONE,)


@given(
    st.lists(st.sampled_from([*Direction, "stop", "arm", "jump"]), max_size=30),
    st.permutations([follow(*SQUARE, repeat=True), hold(duration_s=3.0), hold(at(3, 3)), HOME, STOP]),
)
@settings(max_examples=25, deadline=None)
@pytest.mark.slow
def test_the_state_survives_json_and_an_order_that_moves_has_no_inhibits(
    events: list[Direction | str], legs: list[MissionLeg]
) -> None:
    """Replay: a state encodes to JSON and back without loss, whatever has happened."""
    ship = boat(*legs)
    for event in events:
        if event == "stop":
            ship.armed, ship.stopped = False, True
        elif event == "arm":
            ship.armed, ship.stopped = True, False
        elif event == "jump":
            ship.x_m += 7.0
        else:
            ship.direction = Direction(event)
        before = ship.state.progress.leg_index
        for order in ship.run(0.5):
            assert order.enable == (not order.inhibits)
            assert before <= order.leg_index <= len(legs)
        data = msgspec.json.encode(ship.state)
        assert msgspec.json.decode(data, type=NavigatorState) == ship.state


def test_the_decider_follows_the_mission_before_the_route() -> None:
    """The mission comes with the recorded messages, so that a replay decides the same."""
    route = Route(source_us=0, name="r", waypoints=follow(*SQUARE).waypoints)
    mission = Mission(source_us=0, name="m", legs=(STOP,))
    inputs = {topic.name: Input() for topic in DECIDER.inputs} | {keys.ROUTE.name: Input(route)}
    _, alone = DECIDER.decide(NavigatorState(), inputs, 1_000_000, load_config())
    _, given_both = DECIDER.decide(
        NavigatorState(), inputs | {keys.MISSION.name: Input(mission)}, 1_000_000, load_config()
    )
    assert Inhibit.NO_ROUTE not in alone[keys.COMMAND.name].inhibits  # type: ignore[attr-defined]
    assert DECIDER.own == (keys.ROUTE, keys.MISSION)
    assert given_both.keys() == {keys.COMMAND.name}


@pytest.mark.parametrize(("is_straight", "leg_index"), [(False, 0), (True, 1)])
def test_m1_a_turn_does_not_end_the_leg_home(is_straight: bool, leg_index: int) -> None:
    mission = Mission(source_us=0, name="m", legs=(HOME, STOP), home=at(0.0, 0.0))
    begun = MissionProgress(leg_start=Waypoint(x_m=-10.0, y_m=0.0), target=1)
    odometry = Odometry(source_us=0, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.1, healthy=True)
    now = MissionInputs(odometry, Arming(source_us=0, armed=True), 1, is_free=True, is_straight=is_straight)
    assert advance_mission(begun, mission, now, load_config().navigator).leg_index == leg_index
