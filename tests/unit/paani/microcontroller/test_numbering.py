"""A restarted microcontroller is told from a notification that came out of order."""

from __future__ import annotations

import random

from hypothesis import given
from hypothesis import strategies as st

from paani.messages import McuState
from paani.microcontroller.numbering import FrameNumbers, elapsed_ms, has_restarted, is_out_of_order
from paani.microcontroller.payloads import INDICATION, MAX_SEQ, McuStatus


def status(mcu_ms: int, boot_count: int = 1) -> McuStatus:
    return McuStatus(kind=INDICATION, state=McuState.FRESH, mcu_ms=mcu_ms % 2**32, boot_count=boot_count)


@given(st.integers(0, 2**32 - 1), st.integers(0, 2**31 - 1))
def test_time_passes_through_the_wrap_of_the_clock(start_ms: int, passed_ms: int) -> None:
    before, after = status(start_ms), status(start_ms + passed_ms)
    assert elapsed_ms(before, after) == passed_ms
    assert not has_restarted(before, after)
    assert not is_out_of_order(before, after)


def test_a_restart_is_seen_by_the_boot_count_or_by_the_clock() -> None:
    assert has_restarted(status(90_000), status(91_000, boot_count=2))
    assert has_restarted(status(90_000), status(20))
    assert not has_restarted(status(90_000), status(89_950))
    assert is_out_of_order(status(90_000), status(89_950))


@given(st.integers(0, 2**32))
def test_a_restart_begins_a_session_of_another_number(seed: int) -> None:
    numbers = FrameNumbers(random.Random(seed))
    first, _ = numbers.advance()
    assert not numbers.observe(status(90_000))
    assert not numbers.observe(status(90_100))
    assert numbers.advance() == (first, 2)
    assert numbers.observe(status(10, boot_count=2))
    session, seq = numbers.advance()
    assert session != first
    assert 1 <= session <= 0xFFFF
    assert seq == 1


def test_sequence_numbers_wrap_and_are_never_zero() -> None:
    numbers = FrameNumbers(random.Random(1))
    numbers.seq = MAX_SEQ - 1
    assert [numbers.advance()[1] for _ in range(3)] == [MAX_SEQ, 1, 2]
