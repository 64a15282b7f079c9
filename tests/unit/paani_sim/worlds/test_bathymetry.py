"""Depth of the water is that of the model which the hull touches."""

from __future__ import annotations

import dataclasses
import functools

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_sim.worlds import Shoal, World, load_world
from paani_sim.worlds.bathymetry import depth_at_m, find_aground, radius_at_depth_m
from paani_sim.worlds.spec import build_spec

SHOALS = (Shoal(0.0, 0.0, 6.0, 0.1), Shoal(4.0, 1.0, 3.0, 0.5), Shoal(30.0, -5.0, 8.0, 0.02))


def shoal_lake(*shoals: Shoal, bottom_m: float = 3.0) -> World:
    lake = load_world("lake")
    return dataclasses.replace(lake, obstacles=(), actors=(), shoals=shoals, bottom_m=bottom_m)


@functools.cache
def model_of_shoals() -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = build_spec(shoal_lake(*SHOALS)).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@given(st.floats(-8.0, 40.0), st.floats(-14.0, 8.0))
@pytest.mark.slow
def test_a_ray_straight_down_meets_the_shoal_at_the_depth_there(x_m: float, y_m: float) -> None:
    model, data = model_of_shoals()
    geom = np.zeros(1, np.int32)
    boat = model.body("boat").id
    met_m = mujoco.mj_ray(model, data, np.array([x_m, y_m, 0.0]), np.array([0.0, 0.0, -1.0]), None, 1, boat, geom)
    depth_m = depth_at_m(shoal_lake(*SHOALS), x_m, y_m)
    if met_m < 0.0 or met_m > 3.0:
        assert depth_m == 3.0
    else:
        assert model.geom(int(geom[0])).name.startswith("shoal_")
        assert met_m == pytest.approx(depth_m, abs=1e-6)


@given(st.floats(0.5, 9.0), st.floats(0.0, 1.0), st.floats(1.2, 6.0), st.floats(0.0, 1.0))
@pytest.mark.slow
def test_the_radius_of_a_depth_is_where_the_water_is_so_deep(
    radius_m: float, top_m: float, bottom_m: float, part: float
) -> None:
    shoal = Shoal(5.0, 2.0, radius_m, top_m)
    depth_m = top_m + part * (bottom_m - top_m)
    away_m = radius_at_depth_m(shoal, bottom_m, depth_m)
    assert 0.0 <= away_m <= radius_m
    assert depth_at_m(shoal_lake(shoal, bottom_m=bottom_m), 5.0 + away_m, 2.0) == pytest.approx(depth_m, abs=1e-6)
    assert radius_at_depth_m(shoal, bottom_m, 0.5 * top_m - 0.1) == 0.0


@pytest.mark.slow
def test_a_world_without_shoals_has_the_model_that_it_had() -> None:
    names = {each.name for each in build_spec(load_world("river")).geoms}
    assert not any(name.startswith(("shoal", "keel")) for name in names)
    assert {"keel_port", "keel_starboard", "shoal_2"} <= {each.name for each in build_spec(shoal_lake(*SHOALS)).geoms}


def test_the_boat_is_aground_where_a_shoal_rises_above_its_draught_within_its_reach() -> None:
    world = shoal_lake(Shoal(0.0, 0.0, 6.0, 0.1))
    dry_m = radius_at_depth_m(world.shoals[0], 3.0, 0.19)
    assert find_aground(world, 0.74 + dry_m, 0.0, 0.19, 0.75) == 0
    assert find_aground(world, 0.76 + dry_m, 0.0, 0.19, 0.75) is None
    assert find_aground(world, 0.0, 0.0, 0.09, 0.75) is None
