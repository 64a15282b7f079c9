"""Figures of a board run from its polls, by the paper's rules, and the table beside its column."""

from __future__ import annotations

import asyncio
import threading

import msgspec
import pytest
from msgspec.structs import replace

from paani import messages as m
from paani.board_status import BoardStatus, ProcessStatus
from paani.clock import WallClock
from paani.statistics.figure_table import table_text
from paani_tools.bench.board import command, poll
from paani_tools.bench.board.figures import board_figures, is_stale, spread
from paani_tools.bench.board.host_counters import HostSample
from paani_tools.bench.board.machine import MachineIdentity
from paani_tools.bench.board.poll import Poll, poll_board
from paani_tools.bench.board.table import NOT_THE_BOARD, BoardRun, board_table
from tests.at_work import at_work

HOST = HostSample(
    busy_ticks=0,
    total_ticks=0,
    memory_mib=None,
    temperature_c={},
    oom_kills=None,
    throttled_periods=None,
    major_faults=None,
)
ADVISORY = m.Advisory(
    source_us=1, direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR, evidence_age_s=0.7, lifetime_s=3.5
)
MACHINE = MachineIdentity(name="test bench", is_board=False, cores=2, memory_mib=100, kernel="Linux", load_before=0.1)


def result(number: int, period_s: float) -> m.Evidence:
    timing = m.InferenceTiming(
        frame_age_ms=200.0,
        detector_ms=200.0 + number,
        segmenter_ms=180.0,
        segmenter_run_ms=150.0 + number,
        inference_ms=1.0,
        total_ms=400.0 + number,
    )
    return m.Evidence(
        source_us=1,
        sent_us=round(number * period_s * 1e6),
        seq=number,
        epoch=5,
        frame_seq=2 * number,
        frame_epoch=1,
        width_px=320,
        height_px=240,
        usable=True,
        segmentation=m.SegmentationSource.LEARNED,
        timing=timing,
    )


def status(at_s: float, period_s: float, starts: int = 1, drops: int = 0) -> BoardStatus:
    number = int(at_s / period_s)
    picture = m.PictureHeader(
        source_us=round(at_s * 1e6), frame_seq=int(at_s * 2.58), frame_epoch=9, width_px=1, height_px=1
    )
    return BoardStatus(
        now_us=round(at_s * 1e6),
        profile="paper",
        picture=picture,
        evidence=result(number, period_s),
        advisory=ADVISORY,
        advisory_age_s=0.1,
        processes=(ProcessStatus(service="camera", alive=True, starts=starts, drops=drops),),
    )


def polls(count: int, period_s: float) -> list[Poll]:
    """One each second; CPU at 25 %, memory and heat that climb."""
    hosts = [
        HostSample(
            busy_ticks=25 * i,
            total_ticks=100 * i,
            memory_mib=1000.0 + i,
            temperature_c={"cpuss0-thermal": 45.0 + i, "ddr-thermal": 90.0},
            oom_kills=4,
            throttled_periods=7 + (i > 2),
            major_faults=3 * i,
        )
        for i in range(count)
    ]
    return [
        Poll(at_us=round(i * 1e6), answer_ms=3.0, host=host, status=status(0.5 + i, period_s))
        for i, host in enumerate(hosts)
    ]


def test_u10_three_hundred_polls_of_a_result_every_two_seconds() -> None:
    """U10: 300 polls a second apart meet every second result twice, 150 or 151 in all; V19: at 0.5 Hz."""
    figures = board_figures(polls(300, 2.0), 300)
    assert (figures.polls, figures.answered, figures.distinct_results) == (300, 300, 150)
    assert figures.cadence_hz == pytest.approx(0.5)
    assert figures.captured_hz == pytest.approx(2.58, abs=0.01)
    assert (figures.learned, figures.stale, figures.failures) == (300, 0, {})


def test_results_between_two_polls_count_for_the_cadence() -> None:
    figures = board_figures(polls(20, 0.2), 20)
    assert figures.distinct_results == 20
    assert figures.cadence_hz == pytest.approx(5.0)


def test_v17_v18_v20_stage_times_are_of_distinct_results_by_the_papers_rule() -> None:
    """Each of five results is sampled twice; nearest rank of five is the last one."""
    figures = board_figures(polls(10, 2.0), 10)
    assert figures.pipeline_ms == spread([400.0, 401.0, 402.0, 403.0, 404.0])
    assert (figures.pipeline_ms.median, figures.pipeline_ms.p95, figures.pipeline_ms.samples) == (402.0, 404.0, 5)
    assert (figures.detector_ms.median, figures.segmenter_run_ms.median) == (202.0, 152.0)
    assert figures.frame_age_s.median == pytest.approx(0.602)


def test_v18_a_picture_that_no_network_saw_has_no_time_of_one() -> None:
    run = polls(5, 1.0)
    for number in (0, 1, 2):
        seen = run[number].status
        assert seen is not None
        assert seen.evidence is not None
        refused = replace(seen.evidence, usable=False, timing=m.InferenceTiming(total_ms=3.0))
        run[number] = replace(run[number], status=replace(seen, evidence=refused))
    figures = board_figures(run, 5)
    assert figures.detector_ms == spread([203.0, 204.0])
    assert figures.segmenter_run_ms == spread([153.0, 154.0])
    assert (figures.unusable, figures.pipeline_ms.samples) == (3, 5)


def test_v19_rates_go_on_after_a_restart_that_numbers_anew() -> None:
    run = polls(40, 2.0)
    for number in range(20, 40):
        seen = run[number].status
        assert seen is not None
        assert seen.evidence is not None
        assert seen.picture is not None
        evidence = replace(seen.evidence, epoch=6, seq=seen.evidence.seq - 10)
        picture = replace(seen.picture, frame_epoch=10, frame_seq=seen.picture.frame_seq - 52)
        run[number] = replace(run[number], status=replace(seen, evidence=evidence, picture=picture))
    figures = board_figures(run, 40)
    assert figures.cadence_hz == pytest.approx(0.5)
    assert figures.captured_hz == pytest.approx(2.58, abs=0.03)


def test_v21_machine_figures_are_of_polls() -> None:
    figures = board_figures(polls(10, 2.0), 10)
    assert figures.cpu_percent == spread([25.0] * 9)
    assert figures.memory_mib.median == 1004.5
    assert figures.temperature_zone == "cpuss0-thermal"
    assert (figures.temperature_c.median, figures.temperature_c.maximum) == (49.5, 54.0)


def test_without_the_papers_zone_the_hottest_one_counts() -> None:
    cool = {"board": 30.0, "package": 61.0}
    figures = board_figures([replace(poll, host=replace(poll.host, temperature_c=cool)) for poll in polls(3, 2.0)], 3)
    assert (figures.temperature_zone, figures.temperature_c.median) == ("package", 61.0)


def test_v22_failures_stale_advice_kills_and_throttling_are_counted() -> None:
    run = polls(6, 2.0)
    run[1] = replace(run[1], status=None, failure="timed out")
    old = run[2].status
    assert old is not None
    run[2] = replace(run[2], status=replace(old, advisory_age_s=2.9))
    run[0] = replace(run[0], status=status(0.5, 2.0, starts=0))  # not seen yet: its first start is none too many
    run[3] = replace(run[3], status=status(3.5, 2.0, starts=2, drops=4))
    run[4] = replace(run[4], status=status(4.5, 2.0, starts=2, drops=5))
    run[5] = replace(run[5], status=status(5.5, 2.0, starts=2, drops=1))
    by_colour = status(0.5, 2.0, starts=0)
    assert by_colour.evidence is not None
    by_colour = replace(by_colour, evidence=replace(by_colour.evidence, segmentation=m.SegmentationSource.FALLBACK))
    run[0] = replace(run[0], status=by_colour)
    figures = board_figures(run, 6)
    assert (figures.answered, figures.failures, figures.stale, figures.learned) == (5, {"timed out": 1}, 1, 4)
    assert (figures.oom_kills, figures.throttled_periods, figures.major_faults) == (0, 1, 15)
    assert (figures.returns, figures.drops) == (1, 6)


@pytest.mark.parametrize(
    ("advisory", "age_s", "stale"),
    [
        (ADVISORY, 2.7, False),
        (ADVISORY, 2.9, True),
        (None, 0.0, True),
        (replace(ADVISORY, reason=m.Reason.STALE_EVIDENCE), 0.0, True),
        (replace(ADVISORY, reason=m.Reason.FUTURE_EVIDENCE), 0.0, True),
        (replace(ADVISORY, reason=m.Reason.NO_EVIDENCE), 0.0, True),
    ],
)
def test_advice_is_stale_that_says_so_or_outlives_its_evidence(
    advisory: m.Advisory | None, age_s: float, stale: bool
) -> None:
    assert is_stale(BoardStatus(now_us=1, profile="paper", advisory=advisory, advisory_age_s=age_s)) is stale


def run_of(made: list[Poll], wanted: int, absent: dict[str, str], machine: MachineIdentity = MACHINE) -> BoardRun:
    return BoardRun(
        machine=machine,
        profile="paper",
        conditions=("Pictures from sim.",),
        memory_group="group",
        figures=board_figures(made, wanted),
        absent=absent,
    )


def test_the_table_stands_beside_the_papers_column() -> None:
    table = board_table(run_of(polls(300, 2.0), 300, {}))
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["polls / distinct results"][:2] == ("300 / 151", "300 / 150")
    assert rows["pipeline median / p95 / max [ms]"][:2] == (
        "467.842 / 580.341 / 643.857",
        "474.500 / 542.000 / 549.000",
    )
    assert rows["detector median [ms]"][:2] == ("254.408", "274.500")
    assert rows["segmenter run median [ms]"][:2] == ("165.593", "224.500")
    assert rows["inference cadence [Hz]"][:2] == ("0.500", "0.500")
    assert rows["capture [pictures/s]"][:2] == ("2.58", "2.579")
    assert rows["frame age at completion median / p95 [s]"][:2] == ("0.6838 / 0.8888", "0.6745 / 0.7420")
    assert rows["CPU median [%]"][:2] == ("46.32", "25.00")
    assert rows["memory of the control group median [MiB]"][:2] == ("1665.7", "1149.5")
    assert rows["temperature median / max [C]"][:2] == ("45.3 / 50.3", "194.5 / 344.0")
    assert rows["requests answered"][:2] == ("300 of 300", "300 of 300")
    assert rows["polls with learned segmentation"][:2] == ("300", "300")
    assert rows["polls with stale advice"][:2] == ("0", "0")
    assert (rows["OOM kills"][0], rows["CPU quota throttling"][0]) == ("0", "0")
    assert rows["power"][:2] == ("unavailable", None)
    assert "test bench" in table.name
    assert NOT_THE_BOARD in table.note
    assert NOT_THE_BOARD not in board_table(run_of(polls(3, 2.0), 3, {}, replace(MACHINE, is_board=True))).note


def test_a_row_without_a_value_says_why() -> None:
    bare = [Poll(at_us=1, answer_ms=1.0, host=HOST, failure="refused")]
    absent = {"memory": "no group", "temperature": "no zone", "oom_kills": "no kills", "throttling": "no quota"}
    table = board_table(run_of(bare, 300, absent))
    missing = {row[0]: row[4] for row in table.rows if row[2] is None}
    assert all(missing.values())
    assert missing["memory of the control group median [MiB]"] == "no group"
    assert missing["temperature median / max [C]"] == "no zone"
    assert missing["OOM kills"] == "no kills"
    assert missing["CPU quota throttling"] == "no quota"
    assert missing["pipeline median / p95 / max [ms]"] == "no sample"
    rows = {row[0]: row for row in table.rows}
    assert rows["requests answered"][2:5] == ("0 of 1", 1, "refused: 1")
    assert "300 were wanted" in str(rows["polls / distinct results"][4])
    assert table_text(table)


class StillCounters:
    def read(self) -> HostSample:
        return HOST


async def test_a_failed_request_is_one_poll_with_its_reason_and_the_next_goes_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("paani_tools.bench.board.poll.PERIOD_S", 0.01)
    answers: list[bytes | Exception] = [msgspec.json.encode(status(0.5, 2.0)), b"<html>", TimeoutError("timed out")]

    def fetch() -> bytes:
        answer = answers[len(done) % 3]
        if isinstance(answer, Exception):
            raise answer
        return answer

    done: list[Poll] = []
    counts: list[int] = []
    await poll_board(fetch, StillCounters(), WallClock(), 4, done, counts.append)
    assert counts == [1, 2, 3, 4]
    assert [poll.failure.partition(":")[0] for poll in done] == ["", "not a status", "timed out", ""]
    assert [poll.status is not None for poll in done] == [True, False, False, True]


async def test_an_interrupted_run_keeps_what_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("paani_tools.bench.board.poll.PERIOD_S", 0.01)
    answer, two = msgspec.json.encode(status(0.5, 2.0)), threading.Event()
    done: list[Poll] = []

    def note_progress(made: int) -> None:
        if made >= 2:
            two.set()

    async with at_work(poll_board(lambda: answer, StillCounters(), WallClock(), 10_000, done, note_progress)):
        await asyncio.to_thread(two.wait)
    assert 2 <= len(done) < 10_000
    assert board_figures(done, 10_000).answered == len(done)


def test_u10_x8_what_is_counted_of_polls_and_what_of_results() -> None:
    """A result of a restarted camera is another; of a poll without an answer the host is still known."""
    assert (command._parser().parse_args([]).polls, poll.PERIOD_S) == (300, 1.0)
    run = polls(2, 1.0)
    first, second = (each.status for each in run)
    assert first is not None
    assert second is not None
    assert first.evidence is not None
    renumbered = replace(second, evidence=replace(first.evidence, frame_epoch=2))
    assert board_figures([run[0], replace(run[1], status=renumbered)], 2).distinct_results == 2
    run = polls(10, 2.0)
    run[9] = replace(run[9], status=None, failure="timed out")
    figures = board_figures(run, 10)
    assert (figures.frame_age_s.samples, figures.pipeline_ms.samples) == (5, 5)
    assert (figures.temperature_c.samples, figures.cpu_percent.samples) == (10, 9)
