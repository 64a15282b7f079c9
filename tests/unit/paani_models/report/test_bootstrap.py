"""Intervals draw whole sequences again (U3 with an interval)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_models.report.bootstrap import draw_sequence_counts, interval_of_items, interval_of_sums, percentile_interval


def share(total: np.ndarray) -> float:
    return float(total[0] / total[1])


def test_every_draw_has_as_many_sequences() -> None:
    rows = draw_sequence_counts(7)
    assert rows.shape == (1000, 7)
    assert (rows.sum(1) == 7).all()
    assert np.array_equal(rows, draw_sequence_counts(7))
    assert not np.array_equal(rows, draw_sequence_counts(7, seed=43))


def test_interval_is_of_nearest_ranks_u5() -> None:
    assert percentile_interval(np.arange(1.0, 1001.0)) == (25.0, 975.0)
    assert percentile_interval(np.array([math.nan, 3.0])) == (3.0, 3.0)
    assert all(math.isnan(end) for end in percentile_interval(np.array([math.nan])))


def test_one_sequence_has_no_interval() -> None:
    assert all(math.isnan(end) for end in interval_of_sums(np.array([[1, 2]]), share))
    assert all(math.isnan(end) for end in interval_of_items([[1.0, 2.0]], np.mean))


def test_frames_of_one_sequence_are_not_independent() -> None:
    """Ten sequences of a hundred equal frames: the interval is as wide as for ten frames, not for a thousand."""
    hits = np.array([1, 0] * 5)
    few = interval_of_sums(np.stack([hits, np.ones(10, int)], 1), share)
    many = interval_of_sums(np.stack([hits * 100, np.full(10, 100)], 1), share)
    assert few == many
    assert many[1] - many[0] >= 0.5


def test_sums_and_items_agree() -> None:
    rows = np.random.default_rng(0).integers(0, 9, (6, 2)) + 1
    items = [[row] for row in rows]
    assert interval_of_sums(rows, share) == pytest.approx(
        interval_of_items(items, lambda drawn: share(np.sum(drawn, 0)))
    )


@given(st.lists(st.integers(0, 50), min_size=2, max_size=8))
def test_the_interval_stays_within_the_sequences(hits: list[int]) -> None:
    low, high = interval_of_sums(np.array([[hit, 50] for hit in hits]), share, 100)
    assert min(hits) / 50 <= low <= high <= max(hits) / 50
