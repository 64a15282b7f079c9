"""Room to pass, on small maps whose answer can be seen."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from paani_sim.worlds import Kind, Obstacle, Pose2, load_world
from paani_sim.worlds.passability import (
    PassabilityGrid,
    _flood_row,
    _is_connected,
    footprint_distance_m,
    obstacle_distance_m,
)
from paani_sim.worlds.route_frame import RouteFrame, cut_route

BARGE = Obstacle("barge", Kind.VESSEL, "barge", Pose2(0.0, 0.0, 0.5 * np.pi), 10.0, 2.0, 2.0)


@given(st.integers(0, 2**57 - 1), st.integers(0, 2**57 - 1))
def test_flooding_fills_the_runs_that_hold_a_seed(row: int, seeds: int) -> None:
    seeds &= row
    flags = np.array([bool(row >> k & 1) for k in range(57)])
    label, _ = ndimage.label(flags)
    held = {int(label[k]) for k in range(57) if seeds >> k & 1}
    expected = sum(1 << k for k in range(57) if flags[k] and int(label[k]) in held)
    assert _flood_row(seeds, row) == expected


@pytest.mark.parametrize(
    ("rows", "leads"),
    [
        (["..#..", "..#..", "....."], True),
        (["..#..", "#####", "....."], False),
        (["..###", "..###", "###.."], False),
        (["...##", "##..#", "###.."], True),
    ],
)
def test_connection_of_the_first_row_with_the_last(rows: list[str], leads: bool) -> None:
    free = np.array([[cell == "." for cell in row] for row in rows])
    assert _is_connected(free, np.ones(5, np.bool_)) is leads


def test_distances_are_to_the_footprint() -> None:
    points_m = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 8.0], [4.0, 9.0]])
    assert footprint_distance_m(BARGE, BARGE.pose, points_m) == pytest.approx([0.0, 2.0, 3.0, 5.0])
    assert obstacle_distance_m((), points_m).tolist() == [np.inf] * 4


@pytest.mark.slow
def test_a_barge_across_the_canal_blocks_it_and_one_along_does_not() -> None:
    world = cut_route(load_world("canal"), 20.0, 40.0)
    route = RouteFrame(world.route_m, closed=False)
    lattice = PassabilityGrid(world, route, 40.0)
    middle = route.pose_at(20.0, 2.0)

    def barge(turn_rad: float) -> Obstacle:
        pose = middle._replace(yaw_rad=middle.yaw_rad + turn_rad)
        return Obstacle("barge", Kind.VESSEL, "barge", pose, 16.0, 2.0, 2.0)

    assert lattice.is_passable((barge(0.0),), (), 3.0, 0.6)
    assert not lattice.is_passable((barge(0.5 * np.pi),), (), 3.0, 0.6)
