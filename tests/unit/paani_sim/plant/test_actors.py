"""Moving things on their paths, and skippers who give way."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.geometry import wrap_rad
from paani_sim.plant.actors import SWIMMER_KEEPS_CLEAR_M, VESSEL_KEEPS_CLEAR_M, ActorPath, Actors, yielding_speed_mps
from paani_sim.worlds import Actor, Behaviour, Kind, Pose2, actor_pose_along, load_world

BOAT_REACH_M = 0.65
FAR_M = (1e3, 1e3)
EVERY_S = 0.05


def straight(behaviour: Behaviour = Behaviour.GIVES_WAY, **changes: Any) -> Actor:
    path_m = np.array([[0.0, 0.0], [100.0, 0.0]])
    actor = Actor("skipper", Kind.VESSEL, "cruiser", path_m, 1.5, 5.0, 2.0, 2.0, closed=False, behaviour=behaviour)
    return dataclasses.replace(actor, **changes)


@pytest.mark.parametrize("name", ["lake", "river", "canal", "harbour"])
@pytest.mark.slow
def test_actor_path_equals_the_world_s_path(name: str) -> None:
    """The eye places actors with `actor_at`, the plant with its own measure of the path: one pose."""
    for actor in load_world(name).actors:
        track = ActorPath(actor)
        for along_m in np.linspace(-20.0, 400.0, 211):
            exact, quick = actor_pose_along(actor, float(along_m)), track.pose_at(float(along_m))
            assert math.hypot(exact.x_m - quick.x_m, exact.y_m - quick.y_m) < 1e-9
            assert abs(wrap_rad(exact.yaw_rad - quick.yaw_rad)) < 1e-6


def test_a_vessel_stops_short_and_goes_on_when_clear() -> None:
    actors = Actors([straight()], EVERY_S, BOAT_REACH_M)
    steps = round(24.0 / EVERY_S)
    for step in range(steps):
        actors.advance(EVERY_S * (step + 1), (30.0, 0.5))
    gap_m = 30.0 - BOAT_REACH_M - (actors.along_m[0] + 2.5)
    assert gap_m == pytest.approx(VESSEL_KEEPS_CLEAR_M, abs=0.05)
    assert actors.speeds_mps[0] < 0.02
    stopped_m = actors.along_m[0]
    for step in range(200):
        actors.advance(24.0 + EVERY_S * (step + 1), (30.0, 8.0))
    assert actors.along_m[0] == pytest.approx(stopped_m + 10.0 * 1.5, rel=0.01)


def test_a_swimmer_stops_short_of_a_boat_across_the_way_and_not_of_one_that_is_past() -> None:
    swimmer = straight(kind=Kind.PERSON, look="swimming", speed_mps=0.3, length_m=1.1, width_m=0.6)
    actors = Actors([swimmer], EVERY_S, BOAT_REACH_M)
    for step in range(round(60.0 / EVERY_S)):
        actors.advance(EVERY_S * (step + 1), (10.0, 0.5))
    furthest_m = actors.along_m[0]
    assert 10.0 - BOAT_REACH_M - 0.55 - furthest_m >= SWIMMER_KEEPS_CLEAR_M - 0.05
    for step in range(round(60.0 / EVERY_S)):
        actors.advance(60.0 + EVERY_S * (step + 1), (10.0, 4.0))
    assert actors.along_m[0] > furthest_m + 10.0


def test_an_actor_that_holds_on_follows_time_to_the_bit() -> None:
    """A path that no one bars is a function of time alone, whatever the boat does."""
    actors = Actors([straight(Behaviour.HOLDS_ON, start_s=2.0)], EVERY_S, BOAT_REACH_M)
    for step in range(400):
        actors.advance(EVERY_S * (step + 1), (10.0, 0.0))
    assert actors.along_m == (1.5 * (EVERY_S * 400 - 2.0),)


def test_no_actor_moves_before_its_start() -> None:
    actors = Actors([straight(start_s=5.0)], EVERY_S, BOAT_REACH_M)
    for step in range(100):
        actors.advance(EVERY_S * (step + 1), FAR_M)
    assert actors.along_m == (0.0,)


@given(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0), st.floats(-3.2, 3.2))
def test_giving_way_only_ever_slows(x_m: float, y_m: float, yaw: float) -> None:
    """Between stop and its own speed; a boat well astern or aside is none of its business."""
    pose = Pose2(0.0, 0.0, yaw)
    speed = yielding_speed_mps(straight(), pose, (x_m, y_m), BOAT_REACH_M)
    assert 0.0 <= speed <= 1.5
    if math.cos(yaw) * x_m + math.sin(yaw) * y_m <= -2.5 - BOAT_REACH_M or math.hypot(x_m, y_m) > 20.0:
        assert speed == 1.5
    assert yielding_speed_mps(straight(Behaviour.HOLDS_ON), pose, (x_m, y_m), BOAT_REACH_M) == 1.5


def test_an_actor_that_waited_long_backs_off_and_tries_again() -> None:
    """Two that wait for each other would wait for ever."""
    actors = Actors([straight()], EVERY_S, BOAT_REACH_M)
    stopped_m, furthest_m, back_m = 0.0, 0.0, 1e9
    for step in range(round(70.0 / EVERY_S)):
        actors.advance(EVERY_S * (step + 1), (30.0, 0.5))
        furthest_m = max(furthest_m, actors.along_m[0])
        if actors.speeds_mps[0] < 0.0 and not stopped_m:
            stopped_m = actors.along_m[0]
        if stopped_m:
            back_m = min(back_m, actors.along_m[0])
    assert stopped_m == pytest.approx(furthest_m, abs=0.1)
    assert furthest_m + 2.5 < 30.0 - BOAT_REACH_M - VESSEL_KEEPS_CLEAR_M + 0.1
    assert back_m == pytest.approx(stopped_m - 12.0, abs=0.1)


@pytest.mark.parametrize(("x_m", "sense"), [(1.0, -1.0), (-1.0, 1.0)])
def test_an_actor_that_yields_does_not_touch_a_boat_alongside(x_m: float, sense: float) -> None:
    """Forward of the beam: astern. Abaft it: ahead, and not astern onto it."""
    actors = Actors([straight(start_m=20.0)], EVERY_S, BOAT_REACH_M)
    speeds = []
    for step in range(round(20.0 / EVERY_S)):
        actors.advance(EVERY_S * (step + 1), (actors.poses[0].x_m + x_m, 1.8))
        speeds.append(actors.speeds_mps[0])
    assert speeds[-1] == sense * 0.4
    assert min(sense * speed for speed in speeds) >= 0.0


@pytest.mark.parametrize("behaviour", [Behaviour.GIVES_WAY, Behaviour.FLEES])
def test_at_the_end_of_its_path_an_actor_stays_and_leaves_it_again_at_once(behaviour: Behaviour) -> None:
    actor = straight(behaviour)
    actors, far, t_s = Actors((actor,), EVERY_S, 0.65), (0.0, 500.0), 0.0
    length_m = float(np.linalg.norm(actor.path_m[-1] - actor.path_m[0]))
    for _ in range(round(2.0 * length_m / actor.speed_mps / EVERY_S)):
        t_s += EVERY_S
        actors.advance(t_s, far)
    assert actors.along_m == (length_m,)
    assert actors.speeds_mps == (0.0,), "and no receiver is told otherwise"
    if behaviour is Behaviour.FLEES:
        x_m, y_m, yaw_rad = actors.poses[0]
        actors.advance(t_s + EVERY_S, (x_m + math.cos(yaw_rad), y_m + math.sin(yaw_rad)))
        assert actors.along_m[0] < length_m
