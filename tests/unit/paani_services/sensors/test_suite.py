"""All devices together: bytes in, fixes, samples and the state of each device out."""

from __future__ import annotations

import math

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.config import AisConfig, GpsConfig, HeadingConfig, ImuConfig, LidarConfig, SensorDevicesConfig, SonarConfig
from paani.messages import ImuSample, SensorRole, SensorStatus
from paani_services.sensors.fixes import RESYNC_FIXES
from tests.unit.paani_services.sensors.sensor_bench import (
    CONFIG,
    GPS,
    HEADING,
    IMU,
    LINES,
    RECEIVER,
    SCANNER,
    SONAR,
    START_US,
    Bench,
)
from tests.unit.paani_services.sensors.written import imu_line, nav_pvt, rmc, sentence


def test_without_settings_there_is_no_line_and_everything_is_off() -> None:
    bench = Bench(SensorDevicesConfig())
    assert not bench.suite.lines
    assert {device.status for device in bench.suite.report(START_US)} == {SensorStatus.OFF}


def test_a_fix_is_dated_by_its_receipt_less_the_latency() -> None:
    bench = Bench()
    (fix,) = bench.fixes(nav_pvt())
    assert fix.source_us == START_US - 100_000
    assert bench.device(SensorRole.GPS).status is SensorStatus.OK


def test_fixes_that_come_in_one_piece_are_in_order() -> None:
    first, second = Bench().fixes(rmc("123519") + rmc("123520"))
    assert second.source_us > first.source_us


def test_samples_that_come_in_one_piece_keep_the_spacing_of_their_clock() -> None:
    bench = Bench()
    bench.run_imu(0.5)
    bench.wait(0.04)
    newest_ms = bench.now_us // 1000 % 1_000_000
    found = bench.samples(b"".join(bench.noisy(newest_ms - before) for before in (28, 20, 11, 0)))
    assert [sample.source_us - bench.now_us for sample in found] == [-28_000, -20_000, -11_000, 0]


def test_samples_without_a_clock_are_spread_over_the_time_since_the_last() -> None:
    bench = Bench()
    lines = [sentence(f"VNYMR,10,0,0,0,0,0,0.0{n},0.02,-9.81,0,0,0.1").encode() for n in range(5)]
    bench.samples(lines[0])
    bench.wait(0.04)
    found = bench.samples(b"".join(lines[1:]))
    assert [sample.source_us - bench.now_us for sample in found] == [-30_000, -20_000, -10_000, 0]


def test_what_waited_on_the_way_is_dated_back_and_withheld_after_a_second() -> None:
    """A link that stood for three seconds hands over all at once."""
    bench = Bench()
    for second in range(10, 15):
        bench.wait(1.0)
        assert bench.fixes(rmc(f"1235{second}"))
    bench.run_imu(1.0)
    bench.wait(3.0)
    found = bench.fixes(b"".join(rmc(f"1235{second}") for second in (15, 16, 17, 18)))
    assert [(bench.now_us - fix.source_us) * 1e-6 for fix in found] == pytest.approx([1.1, 0.1], abs=0.01)
    now_ms = bench.now_us // 1000 % 1_000_000
    samples = bench.samples(b"".join(bench.noisy(now_ms - before) for before in (2000, 1500, 500, 0)))
    assert [bench.now_us - sample.source_us for sample in samples] == pytest.approx([500_000, 0], abs=2000)
    assert (bench.suite.drops["gps_old"], bench.suite.drops["imu_old"]) == (2, 2)


def test_data_that_all_come_late_are_named_and_withheld_for_as_long_as_they_do() -> None:
    bench, taken = Bench(), list[bool]()
    for second in range(10, 30):
        bench.wait(61.0 if second == 15 else 1.0)
        taken.append(bool(bench.fixes(rmc(f"1235{second}"))))
    assert taken == [True] * 5 + [False] * 15
    device = bench.device(SensorRole.GPS)
    assert device.status is SensorStatus.INCOMPLETE
    assert "late" in device.note


def test_what_is_read_is_dated_by_the_wall_clock() -> None:
    bench = Bench()
    (fix,) = bench.suite.take(GPS, rmc("123510"), bench.now_us).dated(-3_600_000_000).fixes
    assert fix.source_us == pytest.approx(bench.now_us - 3_600_100_000, abs=10_000)


def test_a_receiver_whose_clock_was_set_back_is_believed_again_at_once() -> None:
    """The fixes that its new time is told by took five seconds: they are not a way that has become longer."""
    bench = Bench()
    for second in range(10, 15):
        bench.wait(1.0)
        assert bench.fixes(rmc(f"1235{second}"))
    taken = list[bool]()
    for second in range(10, 20):
        bench.wait(1.0)
        taken.append(bool(bench.fixes(rmc(f"1230{second}"))))
    assert taken == [False] * (RESYNC_FIXES - 1) + [True] * (11 - RESYNC_FIXES)


@pytest.mark.parametrize("back_s", [2, 3, 4])
def test_a_clock_that_was_set_back_by_little_shuts_nobody_out(back_s: int) -> None:
    """As receivers do when they hear of the leap seconds: the time before is reached again at once."""
    bench = Bench()
    taken = list[bool]()
    for second in (*range(10, 20), *range(20 - back_s, 50)):
        bench.wait(1.0)
        taken.append(bool(bench.fixes(rmc(f"1235{second}"))))
    assert taken == [True] * 10 + [False] * back_s + [True] * 30


def test_a_receiver_without_a_position_is_not_late() -> None:
    bench = Bench()
    void = sentence("GPRMC,,V,,,,,,,,,,N").encode()
    for _ in range(10):
        bench.wait(1.0)
        (fix,) = bench.fixes(void)
        assert not fix.fix
    assert "late" not in bench.device(SensorRole.GPS).note


def test_a_unit_that_began_anew_keeps_its_time() -> None:
    bench = Bench()
    bench.run_imu(1.0)
    bench.wait(0.5)
    (sample,) = bench.samples(bench.noisy(3))
    assert sample.source_us == bench.now_us


@pytest.mark.slow
def test_a12_an_mpu6050_has_no_orientation_until_a_compass_gives_the_heading() -> None:
    alone = Bench(SensorDevicesConfig(imu=ImuConfig(line=IMU)))
    assert {sample.orientation_available for sample in alone.run_imu(1.0)} == {False}
    bench = Bench()
    assert {sample.orientation_available for sample in bench.run_imu(1.0)} == {False}
    bench.suite.take(HEADING, sentence("HCHDM,358.0,M").encode(), bench.now_us)
    samples = bench.run_imu(1.0, rate_dps=10.0)
    assert all(sample.orientation_available for sample in samples)
    assert samples[0].yaw_rad == pytest.approx(math.radians(90.1), abs=1e-6)
    assert samples[-1].yaw_rad == pytest.approx(math.radians(100.0), abs=1e-6)


def test_a12_a_receivers_course_gives_an_mpu6050_no_orientation() -> None:
    """Nor does the variation of the place, with which a compass would have one."""
    bench = Bench(SensorDevicesConfig(gps=GpsConfig(line=GPS), imu=ImuConfig(line=IMU), variation_deg=5.0))
    assert bench.fixes(rmc("123510"))[0].fix
    assert {sample.orientation_available for sample in bench.run_imu(0.2)} == {False}


def test_the_orientation_becomes_unavailable_when_the_compass_falls_silent() -> None:
    bench = Bench()
    bench.suite.take(HEADING, sentence("GNHDT,90.0,T").encode(), bench.now_us)
    samples = bench.run_imu(2.0)
    last = max(sample.source_us for sample in samples if sample.orientation_available)
    assert (last - START_US) * 1e-6 == pytest.approx(1.5, abs=0.02)


def test_a_nine_axis_unit_gives_its_own_yaw_only_if_its_north_is_known() -> None:
    line = sentence("VNYMR,10.0,0.0,0.0,0,0,0,0.01,0.02,-9.81,0,0,0.1").encode()
    for variation_deg, yaw_deg in ((None, None), (5.0, 75.0)):
        bench = Bench(SensorDevicesConfig(imu=ImuConfig(line=IMU), variation_deg=variation_deg))
        (sample,) = bench.samples(line)
        assert sample.orientation_available is (yaw_deg is not None)
        if yaw_deg is not None:
            assert math.degrees(sample.yaw_rad) == pytest.approx(yaw_deg)


def test_one_line_may_carry_position_and_heading() -> None:
    bench = Bench(
        SensorDevicesConfig(gps=GpsConfig(line=GPS), imu=ImuConfig(line=IMU), heading=HeadingConfig(line=GPS))
    )
    assert set(bench.suite.lines) == {GPS, IMU}
    assert bench.fixes(rmc() + sentence("GNHDT,0.0,T").encode())
    assert all(sample.orientation_available for sample in bench.run_imu(0.2))
    assert bench.device(SensorRole.HEADING).status is SensorStatus.OK


def test_each_status_names_what_is_wrong() -> None:
    bench = Bench(is_open=False)
    assert bench.device(SensorRole.GPS).status is SensorStatus.ABSENT
    bench.suite.lost(GPS, "no such file; next try after 1 s")
    assert bench.device(SensorRole.GPS).note == "no such file; next try after 1 s"
    bench.suite.opened(GPS, bench.now_us)
    bench.wait(3.0)
    assert bench.device(SensorRole.GPS).status is SensorStatus.SILENT
    assert not bench.fixes(b"\x80\x00\xffab" * 20)
    device = bench.device(SensorRole.GPS)
    assert device.status is SensorStatus.UNREADABLE
    assert "baud" in device.note
    assert not bench.fixes(sentence("GPGSV,1,1,00").encode())
    device = bench.device(SensorRole.GPS)
    assert (device.status, device.heard) == (SensorStatus.INCOMPLETE, "GSV")
    assert "RMC" in device.note
    (fix,) = bench.fixes(sentence("GPRMC,123519,V,,,,,,,230394,,").encode())
    assert not fix.fix
    assert bench.device(SensorRole.GPS).status is SensorStatus.NO_FIX
    assert bench.fixes(rmc("123520"))
    assert bench.device(SensorRole.GPS).status is SensorStatus.OK
    bench.suite.lost(GPS, "vanished")
    assert bench.device(SensorRole.GPS).status is SensorStatus.ABSENT
    bench.suite.opened(GPS, bench.now_us)
    assert bench.device(SensorRole.GPS).reconnections == 1


def test_a_compass_without_variation_says_what_to_set() -> None:
    bench = Bench(SensorDevicesConfig(imu=ImuConfig(line=IMU), heading=HeadingConfig(line=HEADING)))
    bench.suite.take(HEADING, sentence("HCHDM,358.0,M").encode(), bench.now_us)
    device = bench.device(SensorRole.HEADING)
    assert device.status is SensorStatus.INCOMPLETE
    assert "sensors.variation_deg" in device.note
    assert not bench.run_imu(0.1)[-1].orientation_available


def test_a_protocol_that_is_left_out_is_named_and_not_used() -> None:
    bench = Bench(SensorDevicesConfig(gps=GpsConfig(line=GPS, protocol="nmea")))
    bench.wait(3.0)
    assert not bench.fixes(nav_pvt())
    device = bench.device(SensorRole.GPS)
    assert device.status is SensorStatus.UNREADABLE
    assert device.note == "speaks UBX, which sensors.gps.protocol leaves out"


def test_a_receiver_whose_time_stands_is_frozen_and_gives_nothing_until_it_goes_on() -> None:
    bench = Bench()
    assert bench.fixes(rmc("123519"))
    for _ in range(6):
        bench.wait(0.2)
        assert not bench.fixes(rmc("123519"))
    assert bench.device(SensorRole.GPS).status is SensorStatus.FROZEN
    assert bench.fixes(rmc("123520"))
    assert bench.device(SensorRole.GPS).status is SensorStatus.OK


def test_a_receiver_that_rests_goes_on_and_one_that_stands_at_speed_is_withheld() -> None:
    bench = Bench()
    for second in range(30):
        bench.wait(1.0)
        assert bench.fixes(rmc(f"1235{second:02d}", knots=0.02))
    frozen = []
    for second in range(30):
        bench.wait(1.0)
        frozen.append(not bench.fixes(rmc(f"1235{30 + second}", knots=2.0)))
    assert frozen.index(True) == 3
    assert all(frozen[3:])
    device = bench.device(SensorRole.GPS)
    assert (device.status, device.withheld) == (SensorStatus.FROZEN, 27)
    assert bench.fixes(rmc("123640", "4807.0390,N", knots=2.0))


@pytest.mark.slow
def test_an_inertial_unit_that_repeats_one_sample_is_withheld_until_it_changes() -> None:
    bench = Bench()
    assert len(bench.run_imu(1.0)) == 100
    found: list[ImuSample] = []
    for step in range(200):
        bench.wait(0.01)
        found += bench.samples(imu_line(20_000 + 10 * step, (0.0, 0.0, 9.8)))
    assert len(found) == pytest.approx(50, abs=1)
    assert bench.device(SensorRole.IMU).status is SensorStatus.FROZEN
    assert bench.run_imu(0.1)
    assert bench.device(SensorRole.IMU).status is SensorStatus.OK


def test_a_unit_in_g_is_withheld() -> None:
    bench = Bench()
    for step in range(20):
        bench.wait(0.01)
        assert not bench.samples(bench.noisy(step, z=1.0))
    device = bench.device(SensorRole.IMU)
    assert device.status is SensorStatus.IMPLAUSIBLE
    assert "m/s^2" in device.note


@pytest.mark.slow
def test_a_compass_that_stands_while_the_gyro_turns_is_withheld() -> None:
    bench = Bench()
    found: list[ImuSample] = []
    for _ in range(30):
        bench.suite.take(HEADING, sentence("GNHDT,90.0,T").encode(), bench.now_us)
        found += bench.run_imu(0.1, rate_dps=20.0)
    assert found[20].orientation_available
    assert not any(sample.orientation_available for sample in found[-200:])
    assert bench.device(SensorRole.HEADING).status is SensorStatus.FROZEN
    bench.suite.take(HEADING, sentence("GNHDT,30.0,T").encode(), bench.now_us)
    assert bench.run_imu(0.1)[-1].orientation_available


def test_a_line_that_is_opened_again_begins_anew() -> None:
    """A receiver that was switched off may come back with an earlier clock; what was frozen may be over."""
    bench = Bench()
    assert bench.fixes(rmc("123519"))
    for _ in range(5):
        assert not bench.fixes(rmc("123519"))
    assert bench.device(SensorRole.GPS).status is SensorStatus.FROZEN
    bench.suite.lost(GPS, "vanished")
    bench.suite.opened(GPS, bench.now_us)
    assert bench.device(SensorRole.GPS).status is SensorStatus.INCOMPLETE
    assert bench.fixes(rmc("100001"))
    assert bench.device(SensorRole.GPS).status is SensorStatus.OK


@pytest.mark.slow
def test_a_unit_that_was_pulled_out_and_began_anew_is_not_late() -> None:
    """Its own clock began with it, and may be ahead of where it stood when it was pulled out."""
    bench = Bench()
    for ms in range(0, 5000, 10):
        bench.wait(0.01)
        bench.samples(bench.noisy(ms))
    bench.suite.lost(IMU, "vanished")
    bench.wait(15.0)
    bench.suite.opened(IMU, bench.now_us)
    assert [sample.source_us for sample in bench.samples(bench.noisy(6000))] == [bench.now_us]


def test_damage_is_counted_by_cause() -> None:
    bench = Bench()
    bench.fixes(rmc().replace(b"A", b"B") + rmc()[:20] + rmc("253519") + nav_pvt()[:-1] + b"\x00" + rmc("123519"))
    device = bench.device(SensorRole.GPS)
    assert (device.checksum_failures, device.damaged, device.frames) == (2, 2, 2)
    assert bench.suite.drops == {"nmea_checksum": 1, "nmea_damaged": 2, "ubx_checksum": 1}


def test_the_rate_is_that_of_usable_data() -> None:
    bench = Bench()
    for second in range(10):
        bench.wait(1.0)
        bench.fixes(rmc(f"1235{second:02d}"))
    assert bench.device(SensorRole.GPS).rate_hz == pytest.approx(1.0, abs=0.01)
    bench.wait(0.5)
    device = bench.device(SensorRole.GPS)
    assert device.rate_hz == pytest.approx(1.0, abs=0.01)
    assert device.age_s == pytest.approx(0.5)


@settings(deadline=None)  # the first example compiles patterns and fills caches
@given(st.lists(st.tuples(st.sampled_from(LINES), st.binary(max_size=300)), max_size=8))
def test_any_bytes_on_any_line_are_survived(pieces: list[tuple[str, bytes]]) -> None:
    devices = {"ais": AisConfig(line=RECEIVER), "lidar": LidarConfig(line=SCANNER), "sonar": SonarConfig(line=SONAR)}
    bench = Bench(msgspec.structs.replace(CONFIG, **devices))
    for address, data in pieces:
        bench.wait(0.1)
        bench.suite.take(address, data, bench.now_us)
    assert len(bench.suite.report(bench.now_us)) == len(SensorRole)


BODIES = st.text(st.characters(codec="ascii", exclude_characters="\r\n$!*"), max_size=80)
KINDS = [
    "GPRMC",
    "GPGGA",
    "GPGLL",
    "GPVTG",
    "GPGST",
    "GPHDT",
    "GPHDG",
    "GPHDM",
    "GPTHS",
    "PQTMIMU",
    "VNYMR",
    "PASHR",
    "PUBX",
]


@settings(deadline=None)  # the first example compiles patterns and fills caches
@given(st.lists(st.tuples(st.sampled_from(KINDS), BODIES), max_size=6))
@pytest.mark.slow
def test_any_sentence_with_a_good_checksum_is_survived(bodies: list[tuple[str, str]]) -> None:
    bench = Bench(
        SensorDevicesConfig(gps=GpsConfig(line=GPS), imu=ImuConfig(line=GPS), heading=HeadingConfig(line=GPS))
    )
    for kind, body in bodies:
        bench.wait(0.1)
        bench.fixes(sentence(f"{kind},{body}").encode())
    bench.suite.report(bench.now_us)
