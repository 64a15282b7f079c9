"""A replay moves every message to its new time without changing how messages refer to each other."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import keys
from paani import messages as m
from paani.decider import decider_of
from paani_tools.replay.check import check_service
from paani_tools.replay.ledger import Ledger
from paani_tools.replay.recompute import RecordingFacts
from paani_tools.replay.shift import TimeShift
from tests.unit.paani_tools.replay.recorded_drive import CONFIG, T0_US, drive

LATER = TimeShift(T0_US, T0_US + 86_400_000_000, 1.0)


def test_stamps_and_epochs_move_by_one_offset_and_nothing_else() -> None:
    advisory = m.Advisory(
        source_us=T0_US + 5, seq=7, epoch=T0_US // 1000, sent_us=T0_US + 9, direction=m.Direction.STOP,
        reason=m.Reason.CENTER_RISK, frame_seq=3, frame_epoch=T0_US // 1000 + 2, evidence_sent_us=0,
        explanation="1800000000000000 and \u00e9",
    )  # fmt: skip
    moved = msgspec.json.decode(LATER.shift_message(msgspec.json.encode(advisory)), type=m.Advisory)
    expected = msgspec.structs.replace(
        advisory, source_us=LATER.shift_us(T0_US + 5), sent_us=LATER.shift_us(T0_US + 9),
        epoch=advisory.epoch + 86_400_000, frame_epoch=advisory.frame_epoch + 86_400_000,
    )  # fmt: skip
    assert moved == expected


def test_time_that_is_not_unix_time_stays() -> None:
    time = m.SimTime(source_us=T0_US, sim_us=61_000_000, stamp_us=900_000_000_000)
    moved = msgspec.json.decode(LATER.shift_message(msgspec.json.encode(time)), type=m.SimTime)
    assert (moved.sim_us, moved.stamp_us, moved.source_us) == (61_000_000, 900_000_000_000, T0_US + 86_400_000_000)


@given(st.lists(st.integers(0, 10**10), min_size=2, max_size=6), st.sampled_from([0.01, 0.5, 1.0, 3.0, 1000.0]))
@pytest.mark.slow
def test_the_order_of_times_and_equal_stamps_stay(offsets_us: list[int], speed: float) -> None:
    shift = TimeShift(T0_US, T0_US + 10**12, speed)
    moved = [shift.shift_us(T0_US + offset) for offset in offsets_us]
    for (a, x), (b, y) in zip(
        zip(offsets_us, moved, strict=True), zip(offsets_us[1:], moved[1:], strict=False), strict=False
    ):
        assert (a <= b) == (x <= y) or x == y
        assert a != b or x == y
        assert (y - x) == pytest.approx((b - a) / speed, abs=1.0)


@pytest.mark.parametrize("service", keys.DECIDING_SERVICES)
@pytest.mark.slow
def test_a_moved_drive_is_still_exact(service: str) -> None:
    """Ledger, states and messages move together: what was recorded from a replay can be checked as well."""
    moved = [record._replace(data=LATER.shift_message(record.data)) for record in drive(14.0)]
    decider = decider_of(service)
    records = [r for r in moved if r.topic in Ledger(decider).topics]
    result = check_service(decider, CONFIG, records, RecordingFacts({}, ()))
    assert result.is_exact, (result.unexplained, result.differences)
    assert result.states > 5


def test_any_bytes_go_through() -> None:
    for data in (b"", b"\xff\xfe", b'{"a_us":18000000000000001}', b'{"a_us":1.8e15}', b'{"epoch":"1800000000000"}'):
        assert LATER.shift_message(data) == data
