"""Spans of time by a clock that may be set."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.clock import ManualClock, WallTime, has_passed

TIMES_US = st.integers(0, 2**53)


@given(TIMES_US, st.integers(1, 10**9), st.data())
def test_a_span_has_passed_at_its_end_and_where_its_start_is_in_the_future(
    since_us: int, span_us: int, data: st.DataObject
) -> None:
    assert not has_passed(since_us, span_us, since_us + data.draw(st.integers(0, span_us - 1)))
    assert has_passed(since_us, span_us, since_us + span_us + data.draw(TIMES_US))
    assert has_passed(since_us, span_us, since_us - data.draw(st.integers(1, 2**53)))


def test_wall_time_follows_a_clock_that_is_set_and_no_hiccup_between_two_looks() -> None:
    wall, steady = ManualClock(5_000_000), ManualClock(1_000_000)
    wall_time, ahead_us = WallTime(wall, steady), 4_000_000
    for set_s in (0.0, 0.05, 3600.0, 0.0, -7200.0):
        wall.advance(1.0 + set_s)
        steady.advance(1.0)
        ahead_us += round(set_s * 1e6) if abs(set_s) > 1.0 else 0
        assert wall_time.offset_us() == pytest.approx(ahead_us, abs=50_000)
        assert wall_time.offset_us() == wall_time.offset_us()
