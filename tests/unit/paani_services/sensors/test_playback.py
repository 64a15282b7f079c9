"""A recorded log comes as it was recorded, byte for byte and second for second."""

from __future__ import annotations

import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani_services.sensors.playback import MAX_WAIT_S, play
from tests.unit.paani_services.sensors.written import imu_line, nav_pvt, rmc, sentence


def waits(data: bytes) -> list[float]:
    return [round(piece.wait_s, 3) for piece in play(io.BytesIO(data))]


def test_sentences_of_one_time_come_together_and_the_next_when_they_are_due() -> None:
    gga = sentence("GPGGA,123520,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,").encode()
    gsv = sentence("GPGSV,1,1,00").encode()
    pieces = list(play(io.BytesIO(rmc("123519") + gsv + rmc("123520") + gga + gsv + rmc("123520.50"))))
    assert [piece.data for piece in pieces] == [rmc("123519") + gsv, rmc("123520") + gga + gsv, rmc("123520.50")]
    assert [piece.wait_s for piece in pieces] == pytest.approx([0.0, 1.0, 0.5])


def test_midnight_is_no_pause_and_a_long_pause_is_cut_short() -> None:
    assert waits(rmc("235959") + rmc("000001") + rmc("000500")) == [0.0, 2.0, MAX_WAIT_S]
    assert waits(rmc("123520") + rmc("123519") + rmc("123521")) == [0.0, 0.0, 2.0]


def test_logs_of_ubx_and_of_inertial_units_keep_their_time() -> None:
    assert waits(nav_pvt(1000) + b"\n" + nav_pvt(1200) + b"\n") == [0.0, 0.2]
    assert waits(imu_line(5) + imu_line(15) + imu_line(40)) == [0.0, 0.01, 0.025]


def test_a_gll_carries_its_time_and_a_log_without_time_comes_as_on_a_line() -> None:
    first, second = (sentence(f"IIGLL,4807.038,N,01131.000,E,1235{n},A").encode() for n in (19, 21))
    assert waits(first + second) == [0.0, 2.0]
    line = sentence("IIHDT,1.0,T").encode()
    assert waits(line * 3) == pytest.approx([len(line) / 11_520.0] * 3, abs=1e-3)


@settings(deadline=None)  # the first example compiles patterns and fills caches
@given(st.binary(max_size=3000), st.booleans())
def test_no_byte_is_lost_whatever_a_log_holds(noise: bytes, is_timed: bool) -> None:
    data = rmc() + noise + rmc("123520") if is_timed else noise
    pieces = list(play(io.BytesIO(data)))
    assert b"".join(piece.data for piece in pieces) == data
    assert all(0.0 <= piece.wait_s <= MAX_WAIT_S for piece in pieces)
