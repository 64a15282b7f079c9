"""Fixes of UBX NAV-PVT."""

from __future__ import annotations

import math
from collections import Counter

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.messages import GpsFix
from paani_services.sensors.fixes import RESYNC_FIXES, FixDecoder
from paani_services.sensors.sentences import read_sentence
from tests.unit.paani_services.sensors.written import nav_pvt, rmc, sentence, ubx


def decode(*frames: bytes) -> tuple[list[GpsFix], Counter[str]]:
    drops = Counter[str]()
    decoder = FixDecoder(drops)
    found = []
    for frame in frames:
        if frame.startswith(b"$"):
            _, read = read_sentence(frame)
            assert read is not None
            found.append(decoder.take_sentence(read))
        else:
            found.append(decoder.take_ubx(frame))
    return [fix for fix in found if fix is not None], drops


def test_a_solution_is_a_fix_with_the_receivers_own_accuracy() -> None:
    (fix,), drops = decode(nav_pvt(latitude_deg=-60.0845, longitude_deg=-170.25, course_deg=200.0))
    assert fix.fix
    assert (fix.latitude_deg, fix.longitude_deg) == pytest.approx((-60.0845, -170.25), abs=1e-7)
    assert fix.sog_mps == pytest.approx(1.5)
    assert fix.cog_rad == pytest.approx(math.radians(90.0 - 200.0))
    assert fix.position_std_m == pytest.approx(1.2)
    assert fix.source_us == 1_000_000
    assert not drops


@pytest.mark.parametrize(
    "frame",
    [nav_pvt(fix_type=0), nav_pvt(fix_type=1), nav_pvt(fix_type=5), nav_pvt(flags=0), nav_pvt(flags3=1)],
    ids=["none", "dead reckoning", "time only", "not ok", "invalid"],
)
def test_a_solution_that_is_not_measured_is_no_fix(frame: bytes) -> None:
    (fix,), _ = decode(frame)
    assert not fix.fix


@pytest.mark.parametrize(
    "frame",
    [
        ubx(b"\x01\x07", bytes(40)),
        ubx(b"\x01\x07", b""),
        nav_pvt(latitude_deg=91.0),
        nav_pvt(longitude_deg=181.0),
        nav_pvt(sog_mmps=-1),
        nav_pvt(itow_ms=604_800_000),
    ],
)
def test_an_impossible_solution_is_refused(frame: bytes) -> None:
    with pytest.raises(ValueError, match="NAV-PVT"):
        decode(frame)


def test_other_messages_are_passed_over() -> None:
    assert decode(ubx(b"\x01\x03", bytes(16)), ubx(b"\x0a\x04", b"x" * 40)) == ([], Counter())


def test_time_goes_on_over_the_end_of_the_week_and_never_back() -> None:
    found, drops = decode(nav_pvt(604_799_000), nav_pvt(0), nav_pvt(0), nav_pvt(1000))
    assert [fix.source_us for fix in found] == [604_799_000_000, 604_800_000_000, 604_801_000_000]
    assert drops == {"gps_late": 1}


def test_a_receiver_that_states_its_accuracy_is_taken_instead_of_its_sentences() -> None:
    found, drops = decode(rmc("123519"), nav_pvt(2000), rmc("123520"), nav_pvt(3000), rmc("123521"))
    assert [round(fix.position_std_m, 1) for fix in found] == [10.0, 1.2, 1.2]
    assert not drops


def test_a_receiver_whose_clock_was_set_back_is_followed_once_it_goes_on_in_order() -> None:
    later = [nav_pvt(1000 * second) for second in range(100, 100 + RESYNC_FIXES + 2)]
    found, drops = decode(nav_pvt(500_000), *later)
    assert len(found) == 1 + 3
    assert drops == {"gps_late": RESYNC_FIXES - 1}
    assert sorted(fix.source_us for fix in found) == [fix.source_us for fix in found]


def test_a_stated_standard_deviation_is_taken_before_that_of_the_hdop() -> None:
    gga = sentence("GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,").encode()
    gst = sentence("GNGST,123519,1.0,,,,0.7,0.5,1.1").encode()
    (fix,), _ = decode(gga, gst, rmc())
    assert fix.position_std_m == 0.7


def test_an_estimated_position_is_no_fix() -> None:
    for mode, is_fixed in (("A", True), ("D", True), ("E", False), ("S", False), ("N", False)):
        (fix,), _ = decode(sentence(f"GPRMC,1235{19},A,4807.038,N,01131.000,E,1.0,84.4,230394,,,{mode}").encode())
        assert fix.fix is is_fixed, mode


def test_a_receiver_without_time_has_no_fix_and_does_not_stand_in_time() -> None:
    empty = sentence("GPRMC,,V,,,,,,,,,,N").encode()
    found, drops = decode(empty, empty, empty, rmc())
    assert [fix.fix for fix in found] == [False, False, False, True]
    assert not drops


@settings(deadline=None)  # the first example compiles patterns and fills caches
@given(st.binary(min_size=84, max_size=100))
def test_any_payload_gives_no_fix_or_one_that_can_be_sent(payload: bytes) -> None:
    try:
        found, _ = decode(ubx(b"\x01\x07", payload))
    except ValueError:
        return
    for fix in found:
        assert msgspec.json.decode(msgspec.json.encode(fix), type=GpsFix) == fix
