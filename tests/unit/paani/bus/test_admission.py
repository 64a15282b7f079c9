"""What a receiver refuses, and the name it gives each refusal."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import keys
from paani import messages as m
from paani.bus.admission import MAX_MESSAGE_BYTES, Admission, same_clock, since_sent
from paani.bus.publish import Numbering
from paani.clock import ManualClock

NOW_US = 1_000_000_000


def thrust(**changes: object) -> m.Thrust:
    message = m.Thrust(
        source_us=NOW_US, seq=5, epoch=7, producer="controller", sent_us=NOW_US, left=0.1, right=0.2, enabled=True,
        topic=keys.THRUST.name,
    )  # fmt: skip
    return msgspec.structs.replace(message, **changes)


def admission() -> Admission[m.Thrust]:
    return Admission(keys.THRUST, domain=43, max_future_s=1.0)


def raw(message: m.Message, **changes: object) -> bytes:
    return msgspec.json.encode({**msgspec.to_builtins(message), **changes})


@pytest.mark.parametrize(
    ("data", "cause"),
    [
        (raw(thrust()), ""),
        (b"", "undecodable"),
        (b"\xff\xfe\x00", "undecodable"),
        (b'{"left": ', "undecodable"),
        (raw(thrust()).replace(b"0.1", b"NaN"), "non_finite"),
        (raw(thrust()).replace(b"0.1", b"-Infinity"), "non_finite"),
        (raw(thrust(), left="fast"), "wrong_type"),
        (raw(thrust(), enabled=None), "wrong_type"),
        (b"{}", "wrong_type"),
        (b"[]", "wrong_type"),
        (raw(thrust(), left=1.5), "out_of_range"),
        (raw(thrust(), left=-1.1), "out_of_range"),
        (raw(thrust(), domain=42), "wrong_domain"),
        (raw(thrust(), domain=44), "wrong_domain"),
        (raw(thrust(), producer="advisor"), "wrong_producer"),
        (raw(thrust(), topic=""), "wrong_topic"),
        (raw(thrust(), topic=keys.ARMING.name), "wrong_topic"),
        (raw(thrust(), source_us=NOW_US + 2_000_000), "future"),
        (raw(thrust(), sent_us=NOW_US + 2_000_000), "future"),
        (raw(thrust(), epoch=2**53), "future"),
        (raw(thrust(), epoch=NOW_US // 1000 + 2000), "future"),
        (b'{"unknown": ' + 1500 * b"[" + 1500 * b"]" + b"}", "undecodable"),
        (raw(thrust(), unknown="x" * MAX_MESSAGE_BYTES), "oversized"),
    ],
)
def test_each_fault_has_its_cause(data: bytes, cause: str) -> None:
    message, given_cause = admission().judge(data, NOW_US)
    assert given_cause == cause
    assert (message is None) == bool(cause)


def test_duplicates_replays_and_older_epochs_never_come_back() -> None:
    judge = admission().judge
    assert judge(raw(thrust(seq=5)), NOW_US)[1] == ""
    assert judge(raw(thrust(seq=5)), NOW_US)[1] == "duplicate"
    assert judge(raw(thrust(seq=4)), NOW_US)[1] == "replayed"
    assert judge(raw(thrust(seq=6)), NOW_US)[1] == ""
    assert judge(raw(thrust(seq=0, epoch=8)), NOW_US)[1] == ""
    assert judge(raw(thrust(seq=99, epoch=7)), NOW_US)[1] == "old_epoch"


def test_no_epoch_of_the_future_silences_its_producer() -> None:
    judge = admission().judge
    assert judge(raw(thrust(epoch=2**53)), NOW_US)[1] == "future"
    assert judge(raw(thrust()), NOW_US)[1] == ""


def test_no_frame_epoch_of_the_future_is_taken() -> None:
    header = m.PictureHeader(
        source_us=NOW_US, frame_seq=0, frame_epoch=2**53, width_px=1, height_px=1, epoch=7, producer="camera",
        topic=keys.PICTURE.name,
    )  # fmt: skip
    judge = Admission(keys.PICTURE, domain=43, max_future_s=1.0).judge
    assert judge(msgspec.json.encode(header), NOW_US)[1] == "future"
    assert judge(msgspec.json.encode(msgspec.structs.replace(header, frame_epoch=7)), NOW_US)[1] == ""


@given(st.integers(2, 10**4), st.integers(0, 30), st.booleans())
def test_a_clock_that_is_set_back_silences_nobody(back_s: int, messages: int, is_restarted: bool) -> None:
    """What is said after it is heard, of a producer that goes on and of one that was started again."""
    clock = ManualClock(10**12)
    judge, numbering = admission().judge, Numbering(clock)
    for _ in range(messages):
        numbering.advance()
        now_us = clock.now_us()
        heard = thrust(seq=numbering.seq, epoch=numbering.epoch, source_us=now_us, sent_us=now_us)
        assert judge(raw(heard), now_us)[1] == ""
    clock.advance(-back_s)
    if is_restarted:
        numbering = Numbering(clock)
    for _ in range(3):
        numbering.advance()
        now_us = clock.now_us()
        heard = thrust(seq=numbering.seq, epoch=numbering.epoch, source_us=now_us, sent_us=now_us)
        assert judge(raw(heard), now_us)[1] == ""


@given(st.binary(max_size=200))
def test_no_bytes_raise(data: bytes) -> None:
    message, cause = admission().judge(data, NOW_US)
    assert message is None
    assert cause


@given(st.integers(0, 400), st.integers(0, 255))
def test_a_flipped_byte_never_yields_a_value_out_of_range(index: int, value: int) -> None:
    data = bytearray(raw(thrust()))
    data[index % len(data)] = value
    message, _ = admission().judge(bytes(data), NOW_US)
    assert message is None or (0.0 <= message.left <= 1.0 and 0.0 <= message.right <= 1.0)


def test_what_nobody_may_write_in_a_graph_is_not_let_in() -> None:
    """On a hull there is no truth, whoever claims to be nobody."""
    row = keys.topic_in(keys.TRUE_POSE, keys.Graph.HULL)
    for producer in ("", "plant"):
        pose = m.TruePose(
            source_us=1, sim_us=0, x_m=0, y_m=0, z_m=0, roll_rad=0, pitch_rad=0, yaw_rad=0, surge_mps=0, sway_mps=0,
            yaw_rate_radps=0, domain=43, producer=producer,
        )  # fmt: skip
        assert Admission(row, 43, 1.0).judge(msgspec.json.encode(pose), 10) == (None, "wrong_producer")


@pytest.mark.parametrize("field", ["source_us", "sent_us"])
@pytest.mark.parametrize(("ahead_us", "cause"), [(1_000_000, ""), (1_000_001, "future")])
def test_a_stamp_may_be_ahead_by_no_more_than_clocks_may_differ(field: str, ahead_us: int, cause: str) -> None:
    assert admission().judge(raw(thrust(**{field: NOW_US + ahead_us})), NOW_US)[1] == cause


@pytest.mark.parametrize(("longer", "cause"), [(0, ""), (1, "oversized")])
def test_a_message_may_be_as_long_as_the_limit(longer: int, cause: str) -> None:
    data = raw(thrust())
    padded = data + b" " * (MAX_MESSAGE_BYTES + longer - len(data))
    assert admission().judge(padded, NOW_US)[1] == cause


def test_the_first_message_of_a_start_is_let_in() -> None:
    """Epoch and number 0 are the lowest there are; after them the same is a repetition."""
    gate = admission()
    assert gate.judge(raw(thrust(epoch=0, seq=0)), NOW_US)[1] == ""
    assert gate.judge(raw(thrust(epoch=0, seq=0)), NOW_US)[1] == "duplicate"


def test_an_epoch_at_the_edge_of_the_future_still_counts_and_one_beyond_is_forgotten() -> None:
    """After a clock was set back: the old epoch outranks for as long as it may be one of this clock's."""
    epoch = NOW_US // 1000 + 1000
    for back_us, cause in ((0, "old_epoch"), (1, "")):
        gate = admission()
        assert gate.judge(raw(thrust(epoch=epoch, source_us=0, sent_us=0)), NOW_US)[1] == ""
        assert gate.judge(raw(thrust(epoch=0, seq=0, source_us=0, sent_us=0)), NOW_US - back_us)[1] == cause


@pytest.mark.parametrize("shift_us", [5_000_000, -5_000_000])
def test_another_machines_stamps_are_judged_by_its_clock_and_come_out_by_this_ones(shift_us: int) -> None:
    asked: list[tuple[m.Message, int]] = []

    def shift(message: m.Message, now_us: int) -> int:
        asked.append((message, now_us))
        return shift_us

    there_us = NOW_US - shift_us
    first = thrust(source_us=there_us, sent_us=there_us, epoch=0)
    for as_sent, source_us in ((False, NOW_US), (True, there_us)):
        gate = Admission(keys.THRUST, 43, 1.0, shift, as_sent=as_sent)
        message, cause = gate.judge(raw(first), NOW_US)
        assert (message, cause) == (msgspec.structs.replace(first, source_us=source_us), "")
        late = raw(thrust(source_us=there_us + 1_000_001, sent_us=there_us, epoch=0, seq=6))
        assert gate.judge(late, NOW_US)[1] == "future"
    assert asked[0] == (first, NOW_US)


def test_a_stamp_before_this_clocks_beginning_is_its_beginning() -> None:
    gate = Admission(keys.THRUST, 43, 1.0, lambda message, now_us: -500)
    message, _ = gate.judge(raw(thrust(source_us=400, sent_us=NOW_US, epoch=0)), NOW_US)
    assert message is not None
    assert message.source_us == 0


def test_stamps_of_one_clock_come_out_as_they_were_and_what_is_echoed_may_be_taken_as_sent_now() -> None:
    message, _ = admission().judge(raw(thrust(source_us=123)), NOW_US)
    assert message == thrust(source_us=123)
    assert same_clock(thrust(), NOW_US) == 0
    assert since_sent(thrust(sent_us=NOW_US - 70), NOW_US) == 70
