"""The bridge as a mesh: a road that comes from the ground and goes back into it."""

import numpy as np
import pytest

from paani_sim.eye.land import make_land
from paani_sim.eye.structures import bridge, bridge_reach_m
from paani_sim.worlds import load_world

BANK_M = 0.9  # a quay; a grassy bank is higher so far from the water
PARAPET_M = 0.95


@pytest.mark.parametrize("world", ["canal", "river"])
@pytest.mark.slow
def test_both_ends_of_the_road_are_in_the_ground(world: str) -> None:
    """Where the road ends it lies below the bank; before, no part of it hangs in the air."""
    [thing] = [o for o in load_world(world).obstacles if o.look == "bridge"]
    at_m = bridge(thing.length_m, thing.width_m, thing.base_z_m, thing.height_m).vertices[:, :3]
    ashore = at_m[np.abs(at_m[:, 0]) > 0.5 * thing.length_m + 1.2]
    for side in (-1.0, 1.0):
        ramp = ashore[side * ashore[:, 0] > 0.0]
        end = ramp[side * ramp[:, 0] > (side * ramp[:, 0]).max() - 0.5]
        assert ramp[:, 2].min() < 0.0
        assert end[:, 2].max() < BANK_M + PARAPET_M
        assert np.median(end[:, 2]) < BANK_M
    assert ashore[:, 0].max() == pytest.approx(bridge_reach_m(thing.length_m, thing.base_z_m), abs=1.0)
    assert ashore[:, 0].min() == pytest.approx(-ashore[:, 0].max(), abs=1e-4)


@pytest.mark.slow
def test_nothing_grows_through_the_road() -> None:
    """Of the river's trees none stands on its bridge or on a ramp."""
    world = load_world("river")
    [thing] = [o for o in world.obstacles if o.look == "bridge"]
    cos, sin = np.cos(thing.pose.yaw_rad), np.sin(thing.pose.yaw_rad)
    plants = make_land(world).plants[:, :2] - np.array(thing.pose[:2])
    along_m, aside_m = plants @ [cos, sin], plants @ [-sin, cos]
    near = np.abs(along_m) < bridge_reach_m(thing.length_m, thing.base_z_m)
    assert np.abs(aside_m[near]).min() > 0.5 * thing.width_m
