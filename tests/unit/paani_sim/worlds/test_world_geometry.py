"""The worlds' water, routes and things, by the numbers."""

import dataclasses

import numpy as np
import pytest

from paani.arrays import F64
from paani.errors import UserError
from paani_sim.worlds import WORLDS, Kind, World, actor_pose_at, load_world
from paani_sim.worlds.curves import clearance_m, closed_length_m, is_inside, point_along_closed, resample_closed
from paani_sim.worlds.passability import footprint_distance_m

pytestmark = pytest.mark.slow

SQUARE_M = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])


@pytest.fixture(scope="module", params=sorted(WORLDS))
def world(request: pytest.FixtureRequest) -> World:
    return load_world(request.param)


def test_lake_extents_are_exact() -> None:
    """K1: 208.699 x 126.000 m."""
    extent_m = np.ptp(load_world("lake").shore_m, axis=0)
    assert extent_m == pytest.approx([208.699, 126.000], abs=1e-9)


def test_lake_route_is_exact() -> None:
    """K2: 59 waypoints, a repeating route of 465.443 m with even legs."""
    lake = load_world("lake")
    legs_m = np.linalg.norm(np.roll(lake.route_m, -1, axis=0) - lake.route_m, axis=1)
    assert lake.route_m.shape == (59, 2)
    assert lake.route_length_m == pytest.approx(465.443, abs=1e-9)
    assert np.ptp(legs_m) < 0.2


def test_unknown_world_names_the_known_ones() -> None:
    with pytest.raises(UserError, match=r"'pond' \(known: lake, river, canal, harbour, waterway\)"):
        load_world("pond")


def test_river_is_a_channel_of_varying_width() -> None:
    """Across the route's reach the channel is 14 to 48 m wide and meanders."""
    river = load_world("river")
    width_m = 2.0 * clearance_m(river.shore_m, _middle(river))
    assert 13.0 < width_m.min() < 16.0
    assert 40.0 < width_m.max() < 49.0
    assert np.ptp(river.route_m[:, 1]) > 40.0


def _middle(river: World) -> F64:
    half = len(river.shore_m) // 2
    right, left = river.shore_m[:half], river.shore_m[half:][::-1]
    middle = 0.5 * (right + left)
    reach = (middle[:, 0] > 0.0) & (middle[:, 0] < 270.0)
    return np.asarray(middle[reach])


def test_route_keeps_off_the_banks(world: World) -> None:
    fine_m = resample_closed(world.route_m, 2000)
    assert clearance_m(world.shore_m, fine_m).min() > 3.9


def test_start_lies_on_the_route_and_heads_along_it(world: World) -> None:
    x_m, y_m, yaw_rad = point_along_closed(world.route_m, 0.0)
    assert world.start == pytest.approx((x_m, y_m, yaw_rad))


def test_start_is_clear_of_everything(world: World) -> None:
    for obstacle in world.obstacles:
        gap_m = np.hypot(obstacle.pose.x_m - world.start.x_m, obstacle.pose.y_m - world.start.y_m)
        assert gap_m > 3.0 or obstacle.kind is Kind.OTHER, obstacle.id


@pytest.mark.parametrize("name", ["lake", "canal", "harbour"])
def test_route_keeps_off_what_is_not_meant_to_be_in_the_way(name: str) -> None:
    """What is not within 1 m of the route leaves the boat 2.5 m: nothing is nearly in the way."""
    world = load_world(name)
    fine_m = resample_closed(world.route_m, 2000)
    for obstacle in world.obstacles:
        gap_m = footprint_distance_m(obstacle, obstacle.pose, fine_m).min()
        assert obstacle.look == "bridge" or gap_m < 1.0 or gap_m > 2.5, (obstacle.id, gap_m)


def test_names_are_unique(world: World) -> None:
    names = [o.id for o in world.obstacles] + [a.id for a in world.actors]
    assert len(set(names)) == len(names)


def test_what_floats_is_afloat_and_who_walks_is_ashore_or_on_a_pier(world: World) -> None:
    piers = [o for o in world.obstacles if o.kind is Kind.PIER]
    for obstacle in world.obstacles:
        here = np.array([obstacle.pose[:2]])
        wet = clearance_m(world.shore_m, here)[0] > 0.0
        if obstacle.kind in (Kind.VESSEL, Kind.BUOY) or obstacle.look == "swimming":
            assert wet, obstacle.id
        elif obstacle.kind is Kind.PERSON and wet:
            assert any(np.hypot(*(here[0] - p.pose[:2])) < 0.6 * p.length_m for p in piers), obstacle.id


def test_actors_stay_in_the_water_and_off_fixed_things(world: World) -> None:
    assert world.actors
    for actor in world.actors:
        lap_s = closed_length_m(actor.path_m) / actor.speed_mps
        track_m = np.array([actor_pose_at(actor, t)[:2] for t in np.linspace(0.0, lap_s, 400)])
        assert clearance_m(world.shore_m, track_m).min() > 0.5 * actor.width_m + 0.3, actor.id
        for obstacle in world.obstacles:
            if obstacle.look != "bridge":
                gap_m = footprint_distance_m(obstacle, obstacle.pose, track_m).min()
                assert gap_m > 0.5 * actor.width_m, (actor.id, obstacle.id)


def test_actor_runs_at_its_speed_along_its_heading(world: World) -> None:
    for actor in world.actors:
        t_s = actor.start_s + 20.0
        now, soon = actor_pose_at(actor, t_s), actor_pose_at(actor, t_s + 0.5)
        step_m = np.array([soon.x_m - now.x_m, soon.y_m - now.y_m])
        assert np.linalg.norm(step_m) == pytest.approx(0.5 * actor.speed_mps, rel=0.05)
        ahead = np.array([np.cos(now.yaw_rad), np.sin(now.yaw_rad)])
        assert step_m @ ahead > 0.9 * np.linalg.norm(step_m)


def test_something_stands_in_the_way_and_leaves_room(world: World) -> None:
    """Obstacles close to the route, and open water at least 4 m wide beside each of them."""
    near = [
        o
        for o in world.obstacles
        if o.look != "bridge" and footprint_distance_m(o, o.pose, resample_closed(world.route_m, 2000)).min() < 1.0
    ]
    assert near
    afloat = [o for o in world.obstacles if o.look != "bridge"]
    for obstacle in near:
        free_m = []
        for side in np.arange(-24.0, 24.0, 0.5):
            nearest = _across_route(world, obstacle.pose[:2], side)
            clear = clearance_m(world.shore_m, nearest[None])[0] > 1.0 and all(
                footprint_distance_m(o, o.pose, nearest[None])[0] > 0.8 for o in afloat
            )
            free_m.append(clear)
        assert _longest_run(free_m) * 0.5 >= 4.0, obstacle.id


def _across_route(world: World, at_m: tuple[float, float], side_m: float) -> F64:
    fine_m = resample_closed(world.route_m, 2000)
    index = int(np.argmin(np.linalg.norm(fine_m - np.asarray(at_m), axis=1)))
    way = fine_m[(index + 5) % 2000] - fine_m[index - 5]
    way /= np.linalg.norm(way)
    return np.asarray(fine_m[index] + side_m * np.array([-way[1], way[0]]))


def _longest_run(flags: list[bool]) -> int:
    best = run = 0
    for flag in flags:
        run = run + 1 if flag else 0
        best = max(best, run)
    return best


def test_same_name_gives_the_same_world(world: World) -> None:
    again = load_world(world.name)
    for field in dataclasses.fields(world):
        first, second = getattr(world, field.name), getattr(again, field.name)
        if field.name == "actors":
            assert [a.id for a in first] == [a.id for a in second]
        else:
            assert np.array_equal(first, second) if field.name.endswith("_m") else first == second


def test_resampling_keeps_the_length_of_a_square() -> None:
    assert closed_length_m(resample_closed(SQUARE_M, 64)) == pytest.approx(16.0)


def test_point_along_closed_wraps() -> None:
    assert point_along_closed(SQUARE_M, 18.0) == pytest.approx((2.0, 0.0, 0.0))
    assert point_along_closed(SQUARE_M, 6.0) == pytest.approx((4.0, 2.0, 0.5 * np.pi))


def test_clearance_is_signed() -> None:
    points_m = np.array([[2.0, 2.0], [1.0, 2.0], [6.0, 2.0]])
    assert clearance_m(SQUARE_M, points_m) == pytest.approx([2.0, 1.0, -2.0])
    assert is_inside(SQUARE_M, points_m).tolist() == [True, True, False]
