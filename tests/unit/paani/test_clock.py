"""Spans of time by a clock that may be set."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from paani.clock import has_passed

TIMES_US = st.integers(0, 2**53)


@given(TIMES_US, st.integers(1, 10**9), st.data())
def test_a_span_has_passed_at_its_end_and_where_its_start_is_in_the_future(
    since_us: int, span_us: int, data: st.DataObject
) -> None:
    assert not has_passed(since_us, span_us, since_us + data.draw(st.integers(0, span_us - 1)))
    assert has_passed(since_us, span_us, since_us + span_us + data.draw(TIMES_US))
    assert has_passed(since_us, span_us, since_us - data.draw(st.integers(1, 2**53)))
