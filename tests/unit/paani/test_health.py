"""What a process says of itself: rates from counters, inputs alive and fresh by the table of keys."""

from __future__ import annotations

import asyncio
import collections
import os
import resource
import sys
from pathlib import Path

import pytest

from paani import keys
from paani.bus.inbox import Latest
from paani.clock import ManualClock
from paani.health import HealthReporter, count_open_files, warmest_zone_c


async def test_rates_ages_and_drops() -> None:
    clock = ManualClock()
    busy: Latest[int] = Latest(clock)
    silent: Latest[int] = Latest(clock)
    drops: collections.Counter[str] = collections.Counter()
    reporter = HealthReporter(
        "advisor", [(keys.EVIDENCE, busy), (keys.EVIDENCE, silent)], drops, lambda: "CENTER_CLEAR"
    )
    await asyncio.to_thread(reporter.report, clock.now_us())
    for value in range(5):
        clock.advance(0.2)
        busy.offer(value)
    drops["replayed"] += 3
    report = await asyncio.to_thread(reporter.report, clock.now_us())
    first, second = report.inputs
    assert first.rate_hz == pytest.approx(5.0)
    assert (first.rate_ok, first.fresh, first.received) == (True, True, 5)
    assert (second.alive, second.fresh, second.rate_ok) == (False, False, False)
    assert [(drop.cause, drop.count) for drop in report.drops] == [("replayed", 3)]
    assert report.uptime_s == pytest.approx(1.0)
    assert report.note == "CENTER_CLEAR"
    assert report.rss_mib > 1.0
    assert report.open_files >= 3, "the standard streams at least"


@pytest.mark.parametrize(("silence_s", "alive", "fresh"), [(0.1, True, True), (1.0, True, False), (20.0, False, False)])
async def test_silence_is_first_stale_then_dead(silence_s: float, alive: bool, fresh: bool) -> None:
    clock = ManualClock()
    inbox: Latest[int] = Latest(clock)
    inbox.offer(1)
    clock.advance(silence_s)
    reporter = HealthReporter("advisor", [(keys.EVIDENCE, inbox)], collections.Counter(), lambda: "")
    report = await asyncio.to_thread(reporter.report, clock.now_us())
    assert (report.inputs[0].alive, report.inputs[0].fresh) == (alive, fresh)


def test_a_process_without_a_free_descriptor_still_reports() -> None:
    """All taken is the moment at which its health is asked for; reports that end would have it killed as hanging."""
    clock = ManualClock()
    reporter = HealthReporter("plant", [], collections.Counter(), lambda: "")
    before = reporter.report(clock.now_us())
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with Path(os.devnull).open(encoding="ascii") as free:
        limit = free.fileno()
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))
    try:
        report = reporter.report(clock.now_us())
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert report.open_files == limit
    assert report.rss_mib == before.rss_mib > 1.0


async def test_newest_wins_in_an_inbox() -> None:
    inbox: Latest[int] = Latest(ManualClock())
    for value in range(4):
        inbox.offer(value)
    assert await inbox.next() == 3
    assert (inbox.received, inbox.superseded) == (4, 3)


def test_descriptors_are_counted(tmp_path: Path) -> None:
    before = count_open_files()
    with (tmp_path / "one").open("w"), (tmp_path / "two").open("w"):
        assert count_open_files() == before + 2
    assert count_open_files() == before


def test_the_warmest_zone_that_can_be_read(tmp_path: Path) -> None:
    assert warmest_zone_c(str(tmp_path)) == 0.0
    for number, text in enumerate(("41500\n", "63250\n", "not a number\n", None)):
        zone = tmp_path / f"thermal_zone{number}"
        zone.mkdir()
        if text is None:
            (zone / "temp").mkdir()  # cannot be read
        else:
            (zone / "temp").write_text(text, encoding="ascii")
    assert warmest_zone_c(str(tmp_path)) == 63.25


def test_a_machine_without_zones_has_no_temperature(tmp_path: Path) -> None:
    assert warmest_zone_c(str(tmp_path / "none")) == 0.0


def test_a_report_adds_no_string_to_the_table_of_the_interpreter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "thermal_zone0").mkdir()
    (tmp_path / "thermal_zone0" / "temp").write_text("41500\n", encoding="ascii")
    reporter = HealthReporter("advisor", [], collections.Counter(), lambda: "")
    added: list[str] = []

    def intern(text: str) -> str:
        added.append(text)
        return text

    with monkeypatch.context() as patch:
        patch.setattr(sys, "intern", intern)
        reporter.report(1_000_000)
        warmest_c = warmest_zone_c(str(tmp_path))
    assert warmest_c == 41.5
    assert added == []
