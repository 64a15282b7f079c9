"""Only what can be in the picture is drawn, and nothing that can be is left out."""

import numpy as np
import pytest

from paani_sim.eye.chunks import F64, U32, make_chunks, visible

HALF_RAD = np.radians(35.0)


@pytest.fixture
def field() -> tuple[F64, U32]:
    """Three hundred triangles, 1 m wide, strewn over 400 m."""
    rng = np.random.default_rng(4)
    middle = rng.uniform(-200.0, 200.0, (300, 1, 2))
    return (middle + rng.uniform(-0.5, 0.5, (300, 3, 2))).reshape(-1, 2), np.arange(900, dtype=np.uint32)


def test_every_triangle_is_in_exactly_one_chunk(field: tuple[F64, U32]) -> None:
    place_m, order = field
    chunks = make_chunks(place_m, order, np.zeros(len(place_m)))
    assert sorted(chunks.order.tolist()) == order.tolist()
    assert chunks.count.sum() == len(order)
    assert len(chunks.first) > 10


@pytest.mark.parametrize("heading_rad", [0.0, 1.1, 2.9, -2.0])
def test_nothing_in_the_wedge_is_left_out(field: tuple[F64, U32], heading_rad: float) -> None:
    place_m, order = field
    chunks = make_chunks(place_m, order, np.zeros(len(place_m)))
    eye_m = np.array([10.0, -20.0, 0.9])
    found = visible(chunks, eye_m, heading_rad, HALF_RAD)
    drawn = {int(i) for k in found for i in chunks.order[chunks.first[k] : chunks.first[k] + chunks.count[k]]}
    offset = place_m - eye_m[:2]
    bearing = np.angle(np.exp(1j * (np.arctan2(offset[:, 1], offset[:, 0]) - heading_rad)))
    assert set(np.flatnonzero(np.abs(bearing) < HALF_RAD).tolist()) <= drawn
    assert len(drawn) < 0.6 * len(order)


def test_nearest_first() -> None:
    place_m = np.repeat(np.array([[300.0, 0.0], [20.0, 0.0], [150.0, 0.0]]), 3, axis=0)
    chunks = make_chunks(place_m, np.arange(9, dtype=np.uint32), np.zeros(9))
    found = visible(chunks, np.zeros(3), 0.0, HALF_RAD)
    assert chunks.centre_m[found, 0].tolist() == [20.0, 150.0, 300.0]


def test_reach_widens_a_chunk() -> None:
    """A plant just outside the wedge still shows the half of its card that leans in."""
    place_m = np.repeat(np.array([[0.0, 10.0]]), 3, axis=0)
    order = np.arange(3, dtype=np.uint32)
    bare = make_chunks(place_m, order, np.zeros(3))
    wide = make_chunks(place_m, order, np.full(3, 9.0))
    assert len(visible(bare, np.zeros(3), 0.0, HALF_RAD)) == 0
    assert len(visible(wide, np.zeros(3), 0.0, HALF_RAD)) == 1
