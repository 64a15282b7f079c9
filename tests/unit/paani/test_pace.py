"""One in a period on average, and nobody late for what came late before."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from paani.pace import due_after_us


def test_what_comes_late_does_not_make_the_next_late() -> None:
    """Pictures every 200 ms over a link that holds one up by 150 ms: each is taken as it comes."""
    due_us, period_us = 0, 180_000
    for at_us in (200_000, 400_000, 750_000, 800_000, 1_000_000):
        assert due_us <= at_us
        due_us = due_after_us(due_us, period_us, at_us)


@given(st.lists(st.integers(0, 2_000_000), min_size=1, max_size=60), st.integers(10_000, 2_000_000))
def test_no_more_are_due_than_one_in_a_period_and_one_that_was_late(waits_us: list[int], period_us: int) -> None:
    due_us = now_us = 1_000_000_000
    began_us = now_us
    for count, wait_us in enumerate(waits_us, 1):
        now_us = max(now_us + wait_us, due_us)
        due_us = due_after_us(due_us, period_us, now_us)
        assert now_us <= due_us <= now_us + period_us
        assert count <= (now_us - began_us) / period_us + 1


@given(st.integers(-(10**12), 10**12), st.integers(1, 10**7), st.integers(0, 10**12))
def test_a_clock_set_back_lets_nothing_wait_longer_than_a_period(due_us: int, period_us: int, now_us: int) -> None:
    assert now_us <= due_after_us(due_us, period_us, now_us) <= now_us + period_us
