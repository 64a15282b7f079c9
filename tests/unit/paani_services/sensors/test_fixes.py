"""NMEA 0183 as receivers write it: fixes, damage, and real logs."""

import math
from collections import Counter
from functools import reduce

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.messages import GpsFix
from paani_services.sensors.fixes import UNKNOWN_STD_M, fixes_from_sentences
from tests.places import DATA

LOGS = DATA / "logs"


def sentence(body: str) -> str:
    return f"${body}*{reduce(lambda found, byte: found ^ byte, body.encode(), 0):02X}\r\n"


GGA = sentence("GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,")
RMC = sentence("GPRMC,123519,A,4807.038,N,01131.000,W,022.4,084.4,230394,003.1,W")


def all_fixes(*lines: str) -> tuple[list[GpsFix], Counter[str]]:
    drops = Counter[str]()
    return list(fixes_from_sentences(lines, drops)), drops


def test_the_checksum_of_a_published_example() -> None:
    assert sentence("GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,").strip().endswith("*47")


def test_rmc_after_gga_is_a_fix_with_the_standard_deviation_of_its_hdop() -> None:
    (fix,), drops = all_fixes(GGA, RMC)
    assert fix.fix
    assert (fix.latitude_deg, fix.longitude_deg) == pytest.approx((48.1173, -11.516667), abs=1e-6)
    assert fix.sog_mps == pytest.approx(22.4 * 1852.0 / 3600.0)
    assert fix.cog_rad == pytest.approx(math.radians(90.0 - 84.4))
    assert fix.position_std_m == pytest.approx(0.9 * 5.0)
    assert fix.source_us == (12 * 3600 + 35 * 60 + 19) * 1_000_000
    assert not drops


def test_without_hdop_the_standard_deviation_is_too_large_for_guidance() -> None:
    (fix,), _ = all_fixes(RMC)
    assert fix.position_std_m == UNKNOWN_STD_M > 8.0


def test_gll_takes_its_speed_from_the_vtg_before_it_once() -> None:
    vtg = sentence("IIVTG,224.44,T,224.44,M,5.81,N,,,D")
    first = sentence("GPGLL,6005.071,S,02332.346,E,095559,A,D")
    second = sentence("GPGLL,6005.071,S,02332.346,E,095600,A,D")
    (fix,), _ = all_fixes(vtg, first, second)
    assert fix.latitude_deg == pytest.approx(-60.084517, abs=1e-6)
    assert fix.sog_mps == pytest.approx(2.98892, abs=1e-5)


def test_a_position_marked_invalid_or_missing_is_no_fix() -> None:
    void = sentence("GPRMC,123519,V,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W")
    empty = sentence("GPRMC,123520,A,,,,,,,230394,,")
    found, drops = all_fixes(void, empty)
    assert [fix.fix for fix in found] == [False, False]
    assert not drops


@pytest.mark.parametrize("mode", ["E", "M", "N", "S"])
def test_what_no_satellite_gave_is_no_fix_by_its_mode(mode: str) -> None:
    """Dead reckoning, a position that was typed in, and a simulator."""
    rmc = RMC.strip()[1:-3]
    vtg, gll = "IIVTG,224.44,T,224.44,M,5.81,N,,,{}", "GPGLL,6005.071,S,02332.346,E,095559,A,{}"
    for found in (
        all_fixes(sentence(f"{rmc},{mode}")),
        all_fixes(sentence(vtg.format("A")), sentence(gll.format(mode))),
        all_fixes(sentence(vtg.format(mode)), sentence(gll.format("A"))),
    ):
        assert [fix.fix for fix in found[0]] == [False]


@pytest.mark.parametrize("quality", ["", *"0123456789"])
def test_what_no_satellite_gave_is_no_fix_by_the_quality_of_gga(quality: str) -> None:
    """Of receivers whose RMC has no mode, and until another GGA says better."""
    gga = sentence(f"GPGGA,123519,4807.038,N,01131.000,E,{quality},08,0.9,545.4,M,46.9,M,,")
    (fix, later), _ = all_fixes(gga, RMC, GGA, sentence(RMC.strip()[1:-3].replace("123519", "123520")))
    assert fix.fix is (quality in {"1", "2", "3", "4", "5", "9"})
    assert later.fix


def test_a_receiver_at_rest_that_shows_no_course_has_no_speed() -> None:
    (fix,), _ = all_fixes(sentence("GPRMC,123519,A,4807.038,N,01131.000,E,0.31,,230394,,"))
    assert fix.fix
    assert fix.sog_mps == 0.0


@pytest.mark.parametrize("motion", [",084.4", "022.4,", "1.0,", ","])
def test_a_receiver_that_does_not_tell_how_it_moves_has_no_fix(motion: str) -> None:
    """An empty field is no measurement of 0 m/s, and what moves has a course."""
    (fix,), drops = all_fixes(GGA, sentence(f"GPRMC,123519,A,4807.038,N,01131.000,E,{motion},230394,,"))
    assert not fix.fix
    assert not drops


def test_a_deviation_of_nothing_is_none_that_is_known() -> None:
    gga = sentence("GPGGA,123519,4807.038,N,01131.000,E,1,08,0.0,545.4,M,46.9,M,,")
    gst = sentence("GPGST,123519,0.0,0.0,0.0,0.0,0.0,0.0,0.0")
    for before in ((gga,), (gga, gst)):
        (fix,), _ = all_fixes(*before, RMC)
        assert fix.position_std_m == UNKNOWN_STD_M


@pytest.mark.parametrize(
    "line",
    [
        RMC.replace("022.4", "922.4"),
        RMC.strip()[:-3],
        RMC.strip()[:-2] + "zz",
        RMC.strip()[:-2] + "+6",
        sentence("GPRMC,123519,A,4807.038,N"),
        sentence("GPRMC,123519,A,9107.038,N,01131.000,E,022.4,084.4,230394,003.1,W"),
        sentence("GPRMC,123519,A,4877.038,N,01131.000,E,022.4,084.4,230394,003.1,W"),
        sentence("GPRMC,123519,A,4807.038,X,01131.000,E,022.4,084.4,230394,003.1,W"),
        sentence("GPRMC,253519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W"),
        sentence("GPRMC,1235.19,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W"),
        sentence("GPRMC,123519,A,4807.038,N,01131.000,E,nan,084.4,230394,003.1,W"),
        sentence("GPRMC,123519,A,4807.038,N,01131.000,E,1e99,084.4,230394,003.1,W"),
        sentence("GPRMC,123519,A,4807.038,N,01131.000,E,-2.0,084.4,230394,003.1,W"),
        sentence("GPRMC," + "1" * 300),
    ],
)
def test_a_damaged_sentence_is_counted_and_skipped(line: str) -> None:
    found, drops = all_fixes(line, RMC)
    assert len(found) == 1
    assert drops == {"nmea_damaged": 1}


def test_time_goes_forward_past_midnight_and_never_back() -> None:
    def at(clock: str) -> str:
        return sentence(f"GPRMC,{clock},A,4807.038,N,01131.000,E,0.0,0.0,230394,,")

    found, drops = all_fixes(at("235959"), at("000000.50"), at("000000.50"), at("000000"), at("000001"))
    assert [fix.source_us for fix in found] == [86_399_000_000, 86_400_500_000, 86_401_000_000]
    assert drops == {"gps_late": 2}


@given(st.text(max_size=150) | st.builds(sentence, st.text(max_size=90).map(lambda text: "GPRMC," + text)))
def test_any_text_gives_no_fix_or_one_that_can_be_sent(line: str) -> None:
    found, _ = all_fixes(line)
    for fix in found:
        assert msgspec.json.decode(msgspec.json.encode(fix), type=GpsFix) == fix


@given(
    st.floats(-89.999, 89.999), st.floats(-179.999, 179.999), st.floats(0.0, 40.0), st.floats(0.0, 359.9),
    st.integers(0, 86_399),
)  # fmt: skip
def test_a_written_fix_is_read_back(
    latitude_deg: float, longitude_deg: float, knots: float, course_deg: float, second: int
) -> None:
    def angle(value: float, digits: int) -> str:
        minutes = round(abs(value) * 60.0, 5)
        return f"{int(minutes // 60):0{digits}d}{minutes % 60:08.5f}"

    clock = f"{second // 3600:02d}{second // 60 % 60:02d}{second % 60:02d}"
    body = (
        f"GPRMC,{clock},A,{angle(latitude_deg, 2)},{'N' if latitude_deg >= 0 else 'S'},"
        f"{angle(longitude_deg, 3)},{'E' if longitude_deg >= 0 else 'W'},{knots:.2f},{course_deg:.2f},010124,,"
    )
    (fix,), drops = all_fixes(sentence(body))
    assert not drops
    assert fix.latitude_deg == pytest.approx(latitude_deg, abs=2e-7)
    assert fix.longitude_deg == pytest.approx(longitude_deg, abs=2e-7)
    assert fix.sog_mps == pytest.approx(knots * 0.514444, abs=0.003)
    assert math.cos(fix.cog_rad - math.radians(90.0 - course_deg)) > 1.0 - 1e-7


@pytest.mark.data
@pytest.mark.skipif(not LOGS.is_dir(), reason=f"no logs at {LOGS}; set PAANI_DATA")
@pytest.mark.parametrize(("name", "count", "top_mps"), [("gps_moored.nmea", 599, 2.0), ("plaka_sail.nmea", 3625, 5.0)])
def test_recorded_logs_are_read_to_the_end(name: str, count: int, top_mps: float) -> None:
    """RMC with GGA from a USB receiver, and GLL with VTG from a yacht's instruments."""
    found, drops = all_fixes(*(LOGS / name).read_text("ascii").splitlines())
    assert len(found) == count
    assert not drops
    assert all(fix.fix for fix in found)
    assert 0.0 < max(fix.sog_mps for fix in found) < top_mps
