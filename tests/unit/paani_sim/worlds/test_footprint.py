"""Outlines of things: what is drawn, run into and scored is the same."""

import mujoco
import numpy as np
import pytest

from paani.arrays import F64
from paani_sim.eye.boats import boat
from paani_sim.eye.hull import HULLS
from paani_sim.worlds import Obstacle, Pose2, load_world
from paani_sim.worlds.footprint import BOWS, build_outline, place_outline
from paani_sim.worlds.sizes import SIZES
from paani_sim.worlds.spec import build_spec
from paani_sim.worlds.world import World

FENDER_M = 0.15  # tyres and an outboard motor stick out


def _vessel(look: str) -> Obstacle:
    size = SIZES[look]
    return Obstacle("it", size.kind, look, Pose2(0.0, 0.0, 0.0), size.length_m, size.width_m, size.height_m)


def _beyond_m(outline: F64, points: F64) -> F64:
    """How far each point lies outside of a convex outline, below 0 inside."""
    leg = np.roll(outline, -1, axis=0) - outline
    outward = np.column_stack([leg[:, 1], -leg[:, 0]]) / np.hypot(*leg.T)[:, None]
    away: F64 = ((points[:, None] - outline[None]) * outward[None]).sum(axis=-1).max(axis=1)
    return away


@pytest.mark.parametrize("look", [*sorted(BOWS), "eight"])
@pytest.mark.slow
def test_the_drawn_boat_lies_within_its_outline_and_fills_it(look: str) -> None:
    vessel = _vessel(look)
    outline = build_outline(vessel)
    drawn = [
        boat(look, vessel.length_m, vessel.width_m, vessel.height_m, variant)[0].vertices[:, :2].astype(np.float64)
        for variant in range(len(HULLS))
    ]
    points = np.concatenate(drawn)
    assert _beyond_m(outline, points).max() < FENDER_M
    full = 0.5 * np.abs(outline[:, 0] * np.roll(outline[:, 1], -1) - np.roll(outline[:, 0], -1) * outline[:, 1]).sum()
    assert full < 0.95 * vessel.length_m * vessel.width_m
    assert np.abs(points[:, 0]).max() > 0.46 * vessel.length_m
    assert np.abs(points[:, 1]).max() > 0.46 * vessel.width_m


def test_outlines_are_convex_and_counter_clockwise() -> None:
    for look in SIZES:
        leg = np.diff(np.vstack([build_outline(_vessel(look)), build_outline(_vessel(look))[:2]]), axis=0)
        assert (leg[:-1, 0] * leg[1:, 1] - leg[:-1, 1] * leg[1:, 0] >= -1e-9).all(), look


@pytest.fixture(scope="module")
def canal() -> World:
    return load_world("canal")


@pytest.mark.slow
def test_the_colliding_shape_is_the_outline(canal: World) -> None:
    model = build_spec(canal).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hulls = [each for each in canal.obstacles if each.look in BOWS]
    assert hulls
    for each in hulls:
        geom = model.geom(each.id).id
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        own = model.mesh_vert[first : first + count]
        corners = own @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        expected = place_outline(build_outline(each), each.pose)
        away = np.hypot(*(corners[:, None, :2] - expected[None]).transpose(2, 0, 1))
        assert max(away.min(axis=0).max(), away.min(axis=1).max()) < 1e-5
        assert corners[:, 2].min() == pytest.approx(-1.0, abs=1e-5)
        assert corners[:, 2].max() == pytest.approx(each.height_m, abs=1e-5)
