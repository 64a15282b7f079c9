"""Only what can be in the picture is drawn, and nothing that can be is left out."""

import numpy as np
import pytest

from paani.arrays import F64, U32
from paani_sim.eye.camera import BoatPose, Camera, project, view_projection
from paani_sim.eye.chunks import find_visible, is_in_view, make_chunks

CAMERA = Camera()


@pytest.fixture
def field() -> tuple[F64, U32]:
    """Three hundred triangles, 1 m wide, strewn over 400 m and up to 8 m high."""
    rng = np.random.default_rng(4)
    middle = rng.uniform((-200.0, -200.0, 0.0), (200.0, 200.0, 8.0), (300, 1, 3))
    return (middle + rng.uniform(-0.5, 0.5, (300, 3, 3))).reshape(-1, 3), np.arange(900, dtype=np.uint32)


def test_every_triangle_is_in_exactly_one_chunk(field: tuple[F64, U32]) -> None:
    place_m, order = field
    chunks = make_chunks(place_m, order, np.zeros_like(place_m))
    assert sorted(chunks.order.tolist()) == order.tolist()
    assert chunks.count.sum() == len(order)
    assert len(chunks.first) > 10


@pytest.mark.parametrize("roll_rad", [0.0, 0.3])
@pytest.mark.parametrize("heading_rad", [0.0, 1.1, 2.9, -2.0])
def test_nothing_in_the_picture_is_left_out(field: tuple[F64, U32], heading_rad: float, roll_rad: float) -> None:
    place_m, order = field
    chunks = make_chunks(place_m, order, np.zeros_like(place_m))
    pose = BoatPose(10.0, -20.0, heading_rad, roll_rad=roll_rad, pitch_rad=0.1)
    found = find_visible(chunks, view_projection(pose, CAMERA), np.array([10.0, -20.0, 0.9]))
    drawn = {int(i) for k in found for i in chunks.order[chunks.first[k] : chunks.first[k] + chunks.count[k]]}
    pixels = project(place_m, pose, CAMERA)
    seen = (pixels >= 0.0).all(axis=1) & (pixels <= (CAMERA.width_px, CAMERA.height_px)).all(axis=1)
    assert seen.sum() > 20
    assert set(np.flatnonzero(seen).tolist()) <= drawn
    assert len(drawn) < 0.6 * len(order)


def test_nearest_first_and_none_beyond_the_limit() -> None:
    place_m = np.repeat(np.array([[300.0, 0.0, 0.0], [20.0, 0.0, 0.0], [150.0, 0.0, 0.0]]), 3, axis=0)
    chunks = make_chunks(place_m, np.arange(9, dtype=np.uint32), np.zeros((9, 3)))
    clip = view_projection(BoatPose(0.0, 0.0, 0.0), CAMERA)
    assert chunks.middle_m[find_visible(chunks, clip, np.zeros(3)), 0].tolist() == [20.0, 150.0, 300.0]
    assert chunks.middle_m[find_visible(chunks, clip, np.zeros(3), 151.0), 0].tolist() == [20.0, 150.0]


def test_reach_widens_a_chunk() -> None:
    """A plant just outside the picture still shows the half of its card that leans in."""
    place_m = np.repeat(np.array([[0.0, 10.0, 0.0]]), 3, axis=0)
    order = np.arange(3, dtype=np.uint32)
    bare = make_chunks(place_m, order, np.zeros((3, 3)))
    wide = make_chunks(place_m, order, np.full((3, 3), 9.0))
    clip = view_projection(BoatPose(0.0, 0.0, 0.0), CAMERA)
    assert len(find_visible(bare, clip, np.zeros(3))) == 0
    assert len(find_visible(wide, clip, np.zeros(3))) == 1


def test_a_box_is_in_view_while_a_part_of_it_is() -> None:
    clip = view_projection(BoatPose(0.0, 0.0, 0.0), CAMERA)
    middle_m = np.array([[20.0, 0.0, 0.0], [-20.0, 0.0, 0.0], [20.0, 18.0, 0.0], [20.0, 18.0, 0.0]])
    half_m = np.array([[1.0], [1.0], [1.0], [5.0]]) * np.ones(3)
    assert is_in_view(middle_m, half_m, clip).tolist() == [True, False, False, True]
