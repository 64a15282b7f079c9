"""Packets of a planar range scanner in, whole turns out."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from paani.config import GpsConfig, LidarConfig, SensorDevicesConfig
from paani.messages import SensorRole, SensorStatus
from paani_services.sensors.lidar_packets import BEAMS, HEADER, LAYOUT, Turn, TurnAssembler, checksum, scan_message
from paani_services.sensors.suite import SensorSuite
from tests.unit.paani_services.sensors.written import lidar_turn

# The example of the LD06 development manual: 12 points from 324.27 to 334.70 degrees, 224 to 192 mm away.
EXAMPLE = bytes.fromhex(
    "542c6808ab7ee000e4dc00e2d900e5d500e3d300e4d000e9cd00e4ca00e2c700e9c500e5c200e5c000e5be823a1a50"
)
SETTINGS = LidarConfig(line="serial:/dev/lidar@230400")
LINE, START_US = SETTINGS.line, 1_700_000_000_000_000


def starboard(deg: float) -> float:
    """A hull of which 20 degrees are in sight, 3 m away abeam."""
    return 3.0 if abs(deg - 90.0) < 10.0 else 0.0


def turns_of(data: bytes, config: LidarConfig = SETTINGS, piece: int = 1000) -> list[Turn]:
    assembler = TurnAssembler(config)
    return [turn for at in range(0, len(data), piece) for turn in assembler.feed(data[at : at + piece])]


def bearings_deg(turn: Turn) -> list[int]:
    """Of the beams that met something, counter-clockwise from ahead."""
    return [beam - 180 for beam, range_m in enumerate(turn.ranges_m) if range_m > 0.0]


def test_the_makers_example_is_read() -> None:
    assert checksum(EXAMPLE[:-1]) == EXAMPLE[-1]
    assembler = TurnAssembler(replace(SETTINGS, near_m=0.0))
    assembler.feed(EXAMPLE)
    assert (assembler.packets, assembler.checksum_failures) == (1, 0)
    _, speed_dps, first, *points, last, at_ms, _ = LAYOUT.unpack(EXAMPLE)
    assert (speed_dps, first, last, at_ms) == (2152, 32427, 33470, 6714)
    assert points[::2] == [224, 220, 217, 213, 211, 208, 205, 202, 199, 197, 194, 192]


@pytest.mark.parametrize(("offset_deg", "middle_deg"), [(0.0, -90), (90.0, -180), (-90.0, 0)])
def test_a_turn_is_counter_clockwise_from_the_bow_however_the_scanner_is_mounted(
    offset_deg: float, middle_deg: int
) -> None:
    turn, _ = turns_of(3 * lidar_turn(starboard), replace(SETTINGS, offset_deg=offset_deg))
    off_deg = [(each - middle_deg + 180) % 360 - 180 for each in bearings_deg(turn)]
    assert (min(off_deg), max(off_deg)) == pytest.approx((-10, 10), abs=1)
    assert set(turn.ranges_m) == {0.0, 3.0}
    assert turn.duration_s == pytest.approx(0.1)


@given(st.integers(1, 200), st.binary(max_size=40))
@example(1000, HEADER + bytes(20))
@settings(deadline=None, max_examples=30)
@pytest.mark.slow
def test_neither_pieces_nor_noise_before_it_change_a_turn(piece: int, noise: bytes) -> None:
    turn = lidar_turn(lambda deg: 2.0 + 0.01 * deg)
    assert turns_of(3 * (noise + turn), piece=piece) == turns_of(3 * turn)


def test_a_damaged_packet_is_counted_and_the_rest_of_the_turn_is_used() -> None:
    data = bytearray(3 * lidar_turn(lambda _: 5.0))
    data[len(data) // 2] ^= 0x10
    assembler = TurnAssembler(SETTINGS)
    turns = assembler.feed(bytes(data))
    assert assembler.checksum_failures == 1
    assert [sum(each > 0.0 for each in turn.ranges_m) for turn in turns] == pytest.approx([355, 345], abs=4)


def test_a_turn_that_is_half_heard_is_none() -> None:
    turn = lidar_turn(starboard)
    assert turns_of(turn[: len(turn) // 2] + turn) == []


def test_what_is_too_near_or_too_far_is_left_out_and_of_one_degree_the_nearest_counts() -> None:
    """The nearest things are the boat's own."""
    first, *_ = turns_of(2 * lidar_turn(lambda deg: 0.3 if deg < 90.0 else 30.0 if deg < 180.0 else 4.0))
    assert {round(each) for each in bearings_deg(first)} <= set(range(181)) | {-180}
    mixed, *_ = turns_of(2 * lidar_turn(lambda deg: 4.0 if round(deg / 0.8) % 2 else 5.0))
    assert mixed.ranges_m.count(5.0) < 0.7 * mixed.ranges_m.count(4.0), "every second point is 5 m away"


def test_a_scan_is_dated_by_the_middle_of_its_turn() -> None:
    config = replace(SETTINGS, forward_m=0.4, max_range_m=25.0)
    scan = scan_message(Turn((1.0,) * BEAMS, 0.2), config, START_US)
    assert scan.source_us == START_US - 100_000
    assert (scan.first_bearing_rad, scan.step_rad) == pytest.approx((-math.pi, math.radians(1.0)))
    assert (scan.forward_m, scan.max_range_m) == (0.4, 25.0)


def suite() -> SensorSuite:
    found = SensorSuite(SensorDevicesConfig(lidar=SETTINGS))
    found.opened(LINE, START_US)
    return found


def test_a_scanner_that_repeats_one_turn_is_frozen_and_withheld() -> None:
    """One on open water, which meets nothing, is not."""
    for range_m, statuses in ((4.0, SensorStatus.FROZEN), (0.0, SensorStatus.OK)):
        scanner, now_us = suite(), START_US
        turn, scans = lidar_turn({4.0: lambda _: 4.0, 0.0: lambda _: 0.0}[range_m]), 0
        for _ in range(20):
            now_us += 100_000
            scans += len(scanner.take(LINE, turn, now_us).scans)
        lidar = next(each for each in scanner.report(now_us) if each.role is SensorRole.LIDAR)
        assert lidar.status is statuses
        assert (scans < 6) == (statuses is SensorStatus.FROZEN)
        assert scanner.drops["lidar_frozen"] == lidar.withheld == (19 - scans)


@pytest.mark.parametrize(
    ("data", "note"),
    [
        (b"$GPRMC,123519*00" * 20, "no LDROBOT packets"),
        (lidar_turn(starboard)[: LAYOUT.size] * 8, "does it turn freely"),
    ],
)
def test_what_is_wrong_with_a_scanner_is_said(data: bytes, note: str) -> None:
    scanner = suite()
    for number in range(1, 30):
        scanner.take(LINE, data, START_US + number * 100_000)
    lidar = next(each for each in scanner.report(START_US + 2_900_000) if each.role is SensorRole.LIDAR)
    assert note in lidar.note


def test_a_scanner_shares_its_line_with_nothing() -> None:
    with pytest.raises(ValueError, match=r"lidar\.line: is also gps\.line"):
        SensorDevicesConfig(lidar=SETTINGS, gps=GpsConfig(line="serial:/dev/lidar@9600"))
