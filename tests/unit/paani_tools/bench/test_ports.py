"""What the bench of ports makes of its drives."""

from __future__ import annotations

import pytest

from paani.cli import main as paani
from paani_tools.bench.ports.figures import StickLatencies, keeps_bars, ports_report, ports_text
from paani_tools.up.run_summary import Report, ServiceFigures

HEARD = {"nmea": [0.01, 0.02, 0.03]}


def drive(decisions: int, *, cpu_cores: float = 0.0, restarts: int = 0) -> Report:
    port = ServiceFigures(cpu_cores=cpu_cores, rss_mib=40.0, restarts=restarts)
    return Report(
        duration_s=10.0, profile="paani", world="river", services={"nmea": port}, board_rss_mib=0.0, latency_ms={},
        decisions={"STRAIGHT": decisions - 10, "STOP": 10}, reasons={}, distance_m=5.0, waypoints_reached=0,
        collisions=0, drops={}, superseded={},
    )  # fmt: skip


def test_the_ratio_is_of_decisions_a_second_in_each_round() -> None:
    rounds = [(drive(50), drive(49, cpu_cores=0.02)), (drive(40), drive(44))]
    report = ports_report(10.0, ["nmea"], rounds, HEARD, {})
    assert report.ratios == pytest.approx((0.98, 1.1))
    assert report.decisions_hz == pytest.approx((5.0, 4.9, 4.0, 4.4))
    text = ports_text(report)
    assert "| nmea | 1.0 | 40 | 20 / 30 (n = 3) | - |" in text
    assert "2 pairs of 10 s; decisions/s with the ports over without: 0.980, 1.100" in text


@pytest.mark.parametrize(("beside", "kept"), [(97, True), (96, False)])
def test_three_in_a_hundred_decisions_may_be_lost(beside: int, kept: bool) -> None:
    report = ports_report(10.0, ["nmea"], [(drive(100), drive(beside))] * 3, HEARD, {})
    assert keeps_bars(report) is kept
    bar = f"bar: median of the ratios 0.{beside}0, at least 0.97: {'met' if kept else 'not met'}\n"
    assert ports_text(report).endswith(bar)


def test_a_port_that_fell_is_no_success() -> None:
    assert not keeps_bars(ports_report(10.0, ["nmea"], [(drive(100), drive(100, restarts=1))], HEARD, {}))


def test_sticks_and_those_that_no_thrust_followed_are_told() -> None:
    stick_latencies = {"nmea": StickLatencies([0.2, 0.1, 0.4], 2)}
    text = ports_text(ports_report(10.0, ["nmea"], [(drive(100), drive(100))], HEARD, stick_latencies))
    assert "| 20 / 30 (n = 3) | 200 / 400 (n = 3) |" in text
    assert "sticks that no thrust followed: 2" in text


@pytest.mark.parametrize(
    ("ages_s", "latencies_s", "kept"), [([0.01], [0.1], True), ([], [0.1], False), ([0.01], [], False)]
)
def test_a_port_that_nobody_hears_or_that_does_not_obey_is_no_success(
    ages_s: list[float], latencies_s: list[float], kept: bool
) -> None:
    rounds, stick_latencies = [(drive(100), drive(100))], {"nmea": StickLatencies(latencies_s, 0)}
    assert keeps_bars(ports_report(10.0, ["nmea"], rounds, {"nmea": ages_s}, stick_latencies)) is kept


@pytest.mark.slow
def test_a_port_that_is_none_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        paani(["bench", "ports", "--ports", "telex"])
    assert "telex" in capsys.readouterr().err
