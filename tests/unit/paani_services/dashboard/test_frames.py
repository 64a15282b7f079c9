"""The WebSocket frame: what is written is what is read; a cut frame is refused."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_services.dashboard.frames import FrameHeader, decode_frame, encode_frame


@given(key=st.text(max_size=40), age_ms=st.integers(0, 10**9), body=st.binary(max_size=200))
@pytest.mark.slow
def test_a_frame_survives(key: str, age_ms: int, body: bytes) -> None:
    got_key, header, got_body = decode_frame(encode_frame(key, FrameHeader(age_ms=age_ms), body))
    assert (got_key, header.age_ms, got_body) == (key, age_ms, body)


def test_layout_is_the_documented_one() -> None:
    frame = encode_frame("ab", FrameHeader(age_ms=7), b"\x01\x02")
    assert frame == b'\x02\x00\x0cab{"age_ms":7}\x01\x02'


def test_picture_header_travels_as_it_is() -> None:
    raw = msgspec.Raw(b'{"frame_seq":3}')
    _, header, _ = decode_frame(encode_frame("k", FrameHeader(age_ms=0, picture=raw), b"jpeg"))
    assert bytes(header.picture) == b'{"frame_seq":3}'


@pytest.mark.parametrize("cut", [0, 2, 4, 14])
def test_a_cut_frame_is_refused(cut: int) -> None:
    with pytest.raises(ValueError, match="shorter"):
        decode_frame(encode_frame("ab", FrameHeader(age_ms=7), b"")[:cut])


def test_a_key_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="too long"):
        encode_frame("k" * 256, FrameHeader(age_ms=0), b"")
