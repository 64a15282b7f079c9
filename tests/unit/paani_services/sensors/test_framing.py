"""Frames come out whole and in order however the bytes are cut, and nothing after a false start is lost."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani_services.sensors.framing import MAX_SENTENCE, MAX_UBX_PAYLOAD, Frame, Framer, Protocol
from tests.unit.paani_services.sensors.written import nav_pvt, rmc, sentence, ubx

STREAM = [rmc(), nav_pvt(), sentence("IIHDT,12.3,T").encode(), ubx(b"\x01\x03", b"$GP\n\xb5\x62" * 2), rmc("123520")]


def feed(*chunks: bytes) -> list[bytes]:
    framer = Framer()
    return [frame.data for chunk in chunks for frame in framer.feed(chunk)]


@settings(deadline=None)  # the first example compiles patterns and fills caches
@given(st.lists(st.integers(1, 40), min_size=1), st.sampled_from([b"", b"\x00\xff", b"\r\n", b"\xd3\x00\x04abcd"]))
def test_mixed_frames_come_out_however_they_are_cut(sizes: list[int], noise: bytes) -> None:
    data, chunks = noise + noise.join(STREAM) + noise, list[bytes]()
    while data:
        size = sizes[len(chunks) % len(sizes)]
        chunks.append(data[:size])
        data = data[size:]
    assert feed(*chunks) == STREAM


def test_a_frame_says_what_it_is_written_in() -> None:
    assert Framer().feed(nav_pvt() + rmc()) == [Frame(Protocol.UBX, nav_pvt()), Frame(Protocol.NMEA, rmc())]


def test_a_sentence_that_is_cut_off_is_counted_and_hides_no_other() -> None:
    framer = Framer()
    assert [frame.data for frame in framer.feed(rmc()[:20] + rmc() + rmc()[:-9] + nav_pvt())] == [rmc(), nav_pvt()]
    assert framer.cut_sentences == 2


def test_a_false_ubx_header_hides_no_sentence() -> None:
    framer = Framer()
    false_header = b"\xb5\x62\x01\x07\x40\x00"
    assert [frame.data for frame in framer.feed(false_header + rmc() * 3)] == [rmc()] * 3
    assert framer.ubx_failures == 1
    assert feed(b"\xb5\x62\x01\x07\xff\xff" + rmc()) == [rmc()]
    assert feed(b"\xb5" + rmc(), b"\xb5\xb5\x62" + nav_pvt()[2:]) == [rmc(), nav_pvt()]


@pytest.mark.parametrize("whole", [rmc(), nav_pvt(2000)])
def test_a_damaged_length_holds_nothing_up(whole: bytes) -> None:
    """A message that seems to go on for a thousand bytes would keep a receiver's fixes for ten seconds."""
    framer = Framer()
    damaged = bytearray(nav_pvt())
    damaged[4:6] = MAX_UBX_PAYLOAD.to_bytes(2, "little")
    assert framer.feed(bytes(damaged) + whole[:-1]) == []
    assert [frame.data for frame in framer.feed(whole[-1:])] == [whole]
    assert framer.ubx_failures == 1


def test_what_looks_like_a_frame_within_a_message_is_part_of_it() -> None:
    """Its checksum does not fit."""
    within = rmc().replace(b"*", b"*F")[:-3] + b"\r\n" + nav_pvt()[:-1] + b"\x00"
    whole = ubx(b"\x01\x03", within * 3)
    assert feed(whole[:-1], whole[-1:]) == [whole]


def test_a_line_without_end_is_dropped_once_it_is_too_long() -> None:
    framer = Framer()
    for _ in range(100):
        assert framer.feed(b"$" + b"A" * 2 * MAX_SENTENCE) == []
        assert len(framer._waiting) <= 2 * MAX_SENTENCE + 1
    assert framer.cut_sentences >= 99
    assert [frame.data for frame in framer.feed(b"\n" + rmc())] == [rmc()]


@settings(deadline=None)  # the first example compiles patterns and fills caches
@given(st.lists(st.binary(max_size=400), max_size=8))
def test_any_bytes_leave_a_framer_that_still_works(chunks: list[bytes]) -> None:
    framer = Framer()
    for chunk in chunks:
        framer.feed(chunk)
    framer.feed(bytes(1100))  # ends whatever the bytes have begun
    assert [frame.data for frame in framer.feed(rmc())] == [rmc()]
