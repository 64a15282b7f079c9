"""Slopes and bars of a long drive."""

from __future__ import annotations

import msgspec
import pytest

from paani_tools.bench.soak import Sample, Soaked, SoakReport, keeps_bars, main, slope_per_h, soak_text, soaked


def samples(rss_mib_h: float, *, warm_up_mib: float = 0.0, restarted: bool = False) -> list[Sample]:
    """An hour, one sample a minute: a jump in the first tenth, then a line."""
    return [
        Sample(
            at_s=60.0 * k,
            pid=1 if not restarted or k < 40 else 2,
            anonymous_mib=20.0 + 2.0 * rss_mib_h * k / 60 + (warm_up_mib if k >= 6 else 0.0),
            rss_mib=50.0 + rss_mib_h * k / 60 + (warm_up_mib if k >= 6 else 0.0),
            descriptors=19,
            threads=9,
        )
        for k in range(61)
    ]


def report(one: Soaked) -> SoakReport:
    return SoakReport(
        driven_s=3600.0, distance_m=1900.0, collisions=0, decisions_hz=5.0, drops={"late": 2}, disk_mib=1.0,
        disk_slope_mib_h=0.1, processes={"advisor": one},
    )  # fmt: skip


def test_a_slope_is_by_the_hour() -> None:
    assert slope_per_h([(0.0, 1.0), (1800.0, 2.0), (3600.0, 3.0)]) == pytest.approx(2.0)


@pytest.mark.parametrize("growth_mib_h", [0.0, 0.9, 3.0, -2.0])
def test_growth_is_that_after_the_warm_up(growth_mib_h: float) -> None:
    found = soaked(samples(growth_mib_h, warm_up_mib=40.0))
    assert found.rss_slope_mib_h == pytest.approx(growth_mib_h)
    assert found.anonymous_slope_mib_h == pytest.approx(2.0 * growth_mib_h)
    assert keeps_bars(report(found)) is (growth_mib_h <= 1.0)


@pytest.mark.parametrize("taken_at", range(10, 61))
def test_what_is_taken_once_does_not_last_and_what_is_taken_on_and_on_does(taken_at: int) -> None:
    """The warm-up ends with the tenth look."""
    once = [
        msgspec.structs.replace(each, anonymous_mib=each.anonymous_mib + 5.0 * (k >= taken_at))
        for k, each in enumerate(samples(3.0))
    ]
    assert soaked(once).lasting_slope_mib_h == pytest.approx(6.0)


def test_what_is_taken_after_ten_minutes_is_no_warm_up() -> None:
    late = [
        msgspec.structs.replace(each, rss_mib=each.rss_mib + 5.0 * (k >= 11)) for k, each in enumerate(samples(0.0))
    ]
    assert soaked(late).rss_slope_mib_h > 0.0


def test_a_restart_while_it_warms_up_counts() -> None:
    assert (
        soaked([msgspec.structs.replace(each, pid=1 + (k >= 3)) for k, each in enumerate(samples(0.0))]).restarts == 1
    )


def test_a_restart_is_no_way_to_keep_memory_flat() -> None:
    found = soaked(samples(0.0, restarted=True))
    assert found.restarts == 1
    assert not keeps_bars(report(found))


def test_descriptors_that_stay_open_break_the_bar() -> None:
    leaking = [msgspec.structs.replace(each, descriptors=19 + k // 10) for k, each in enumerate(samples(0.0))]
    assert not keeps_bars(report(soaked(leaking)))


@pytest.mark.parametrize("at", [7, 30, 60])
def test_what_is_open_for_a_moment_breaks_no_bar_whenever_that_is(at: int) -> None:
    """A pool begins threads, and a journal opens a file, for the time that something takes."""
    busy = [
        msgspec.structs.replace(each, descriptors=19 + 4 * (k == at), threads=9 + 4 * (k == at))
        for k, each in enumerate(samples(0.0))
    ]
    assert keeps_bars(report(soaked(busy)))
    assert soaked(busy).threads == (9, 9)


def test_the_table_names_each_process_and_what_was_dropped() -> None:
    text = soak_text(report(soaked(samples(0.5))))
    assert "| advisor | 50.5 | +0.50 | +1.00 | 19, 19 | 9, 9 | 0 |" in text
    assert "late 2" in text


def test_a_run_too_short_for_a_slope_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--for", "9"])
    assert stop.value.code == 2
    assert "argument --for: 9: expected seconds from 10" in capsys.readouterr().err
