"""What a picture shows of a thing that its sides cut."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import messages as m
from paani.arrays import F64
from paani_sim.trials.ground_truth_evidence import MASK_ROWS, GroundTruthEvidenceSource
from paani_sim.trials.policies import Policy, load_policy_config
from paani_sim.trials.silhouettes import bounds_in_picture
from paani_sim.worlds import actor_pose_along
from paani_sim.worlds.imazu import build_imazu_scenario

WORLD = build_imazu_scenario("imazu-03").world  # one dinghy on open water
SEEN = GroundTruthEvidenceSource(WORLD, (), load_policy_config(Policy.ORACLE))
PARTS = np.linspace(0.0, 1.0, 201)[:, None]
COORDINATES = st.floats(-3.0, 4.0)


@given(st.lists(st.tuples(COORDINATES, COORDINATES), min_size=3, max_size=12))
@pytest.mark.slow
def test_the_bounds_are_those_of_the_part_within_the_picture(corners: list[tuple[float, float]]) -> None:
    """Every point between two corners that the picture shows is within them."""
    points = np.array(corners)
    low, high = bounds_in_picture(points)
    lines = np.concatenate([one + PARTS * (other - one) for one in points for other in points])
    visible_part = lines[((lines > 1e-4) & (lines < 1.0 - 1e-4)).all(axis=1)]
    assert (visible_part >= low - 1e-9).all()
    assert (visible_part <= high + 1e-9).all()
    assert (low >= 0.0).all()
    assert (high <= 1.0).all()


@pytest.mark.parametrize("mirror", [lambda at: at, lambda at: at[:, ::-1], lambda at: 1.0 - at])
def test_what_lies_beyond_one_side_does_not_stretch_the_bounds_along_another(mirror: Callable[[F64], F64]) -> None:
    """A hull beside the boat: its far end, ahead, is in the picture; its near end is below it and to the left."""
    low, high = bounds_in_picture(mirror(np.array([[-4.0, 5.0], [-4.0, 4.0], [0.2, 0.4], [0.2, 0.6]])))
    expected = mirror(np.array([[0.0, 0.4], [0.2, 0.6 + 4.4 * 0.2 / 4.2]]))
    assert low == pytest.approx(expected.min(axis=0))
    assert high == pytest.approx(expected.max(axis=0))


@settings(max_examples=50, deadline=None)
@given(range_m=st.floats(3.0, 10.0), bearing_deg=st.floats(-45.0, 45.0), aspect_deg=st.floats(-180.0, 180.0))
@pytest.mark.slow
def test_a_box_ends_where_the_part_of_the_vessel_in_the_picture_does(
    range_m: float, bearing_deg: float, aspect_deg: float
) -> None:
    """That is where the mask ends the water before it, to a cell, also where the picture's sides cut the vessel."""
    vessel, yaw_rad = actor_pose_along(WORLD.actors[0], 10.0), math.radians(aspect_deg)
    towards_rad = yaw_rad - math.radians(bearing_deg)
    truth = m.TruePose(
        source_us=1,
        sim_us=1,
        x_m=vessel.x_m - range_m * math.cos(towards_rad),
        y_m=vessel.y_m - range_m * math.sin(towards_rad),
        z_m=0.0,
        roll_rad=0.0,
        pitch_rad=0.0,
        yaw_rad=yaw_rad,
        surge_mps=0.0,
        sway_mps=0.0,
        yaw_rate_radps=0.0,
        actors_along_m=(10.0,),
    )
    scene = SEEN.compute_visible_scene(truth)
    rows = np.flatnonzero(~scene.water.all(axis=1))
    for _, (_, top, _, bottom) in scene.boxes:
        assert bottom * MASK_ROWS == pytest.approx(rows[-1] + 1, abs=1.5)
        assert top < bottom
