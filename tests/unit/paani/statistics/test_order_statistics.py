"""Percentile and median as the paper defines them (U5)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.statistics.order_statistics import median, nearest_rank

SAMPLES = st.lists(st.floats(-1e6, 1e6), min_size=1)


@pytest.mark.parametrize(("percent", "expected"), [(0, 1), (5, 1), (20, 1), (21, 2), (50, 3), (95, 5), (100, 5)])
def test_nearest_rank_by_hand_u5(percent: float, expected: float) -> None:
    assert nearest_rank([5, 3, 1, 2, 4], percent) == expected


def test_the_median_of_an_even_count_is_the_mean_of_the_middle_pair_u5() -> None:
    assert median([4, 1, 3, 2]) == 2.5
    assert nearest_rank([4, 1, 3, 2], 50) == 2
    assert median([3, 1, 2]) == 2


@given(SAMPLES, st.floats(0, 100))
def test_a_percentile_is_the_first_sample_with_enough_below_it_u5(samples: list[float], percent: float) -> None:
    value = nearest_rank(samples, percent)
    assert value in samples
    needed = max(1, math.ceil(percent * len(samples) / 100))
    assert sum(s <= value for s in samples) >= needed
    assert sum(s < value for s in samples) < needed


def test_nothing_has_no_percentile() -> None:
    for percent in (-1, 101):
        with pytest.raises(ValueError, match="percent"):
            nearest_rank([1.0], percent)
    with pytest.raises(ValueError, match="sample"):
        nearest_rank([], 50)
