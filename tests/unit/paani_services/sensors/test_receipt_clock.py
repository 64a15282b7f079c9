"""Times of a device in ours."""

from __future__ import annotations

import pytest

from paani_services.sensors.receipt_clock import ReceiptClock

AHEAD_US = 1_700_000_000_000_000


def test_jitter_of_the_line_is_taken_out() -> None:
    clock, found = ReceiptClock(), []
    for step, late_us in enumerate([5000, 0, 30_000, 80_000, 0, 2000]):
        clock.observe(200_000 * step, AHEAD_US + 200_000 * step + late_us)
        found.append(clock.date(200_000 * step))
    assert [at_us - AHEAD_US - 200_000 * step for step, at_us in enumerate(found) if at_us] == pytest.approx(
        [5000, 0, 40, 80, 0, 40], abs=20
    )


@pytest.mark.slow
def test_two_clocks_may_drift_apart() -> None:
    clock = ReceiptClock()
    for step in range(36_000):
        now_us = AHEAD_US + round(200_000 * step * (1.0 + 1e-4))
        clock.observe(200_000 * step, now_us)
        at_us = clock.date(200_000 * step)
        assert at_us is not None
        assert now_us - at_us < 100


def test_a_way_that_has_become_longer_for_good_is_never_taken_for_a_clock() -> None:
    """Ten minutes behind a link that keeps everything for two seconds: nothing of it is dated."""
    clock = ReceiptClock()
    for step in range(3000):
        clock.observe(200_000 * step, AHEAD_US + 200_000 * step + (2_000_000 if step > 20 else 0))
        assert (clock.date(200_000 * step) is None) is (step > 20)
