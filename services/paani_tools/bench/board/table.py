"""The run as a table beside the paper's own column. Pure."""

from __future__ import annotations

import msgspec

from paani.statistics.figure_table import FigureTable
from paani_tools.bench.board.figures import BoardFigures, Spread
from paani_tools.bench.board.machine import MachineIdentity, machine_text

COLUMNS = ("figure", "paper, UNO Q", "here", "samples", "scope, or why there is no value")
NOT_THE_BOARD = "This machine is no Arduino UNO Q: the board's own figures are not measured here."
NO_METER = "no power meter in the protocol"
Row = tuple[str, str, str | None, int | None, str]


class BoardRun(msgspec.Struct, frozen=True, kw_only=True):
    """What `board.json` begins with. `absent`: what this machine does not tell, and why. `conditions`: of the run.

    `memory_group`: the file that the memory of the board's control group was read from.
    """

    machine: MachineIdentity
    profile: str
    conditions: tuple[str, ...]
    memory_group: str
    figures: BoardFigures
    absent: dict[str, str]


def board_table(run: BoardRun) -> FigureTable:
    """Every row of the paper's table, and what it says in the text (V17 to V22)."""
    figures = run.figures
    return FigureTable(
        name=f"board protocol, profile {run.profile}, measured on {machine_text(run.machine)}",
        columns=COLUMNS,
        rows=(*_result_rows(figures), *_machine_rows(run), *_fault_rows(figures, run.absent)),
        note=" ".join((*run.conditions, *(() if run.machine.is_board else (NOT_THE_BOARD,)))),
    )


def _result_rows(figures: BoardFigures) -> tuple[Row, ...]:
    counted = f"{figures.polls} / {figures.distinct_results}"
    wanted = "one a second" + ("" if figures.polls == figures.polls_wanted else f"; {figures.polls_wanted} were wanted")
    return (
        ("polls / distinct results", "300 / 151", counted, figures.polls, wanted),
        _spread_row("pipeline median / p95 / max [ms]", "467.842 / 580.341 / 643.857", figures.pipeline_ms, 3, "mpx"),
        _spread_row("detector median [ms]", "254.408", figures.detector_ms, 3, "m", "with preprocessing and decoding"),
        _spread_row("segmenter run median [ms]", "165.593", figures.segmenter_run_ms, 3, "m", "the network alone"),
        _spread_row("segmenter median [ms]", "-", figures.segmenter_ms, 3, "m", "with preprocessing and corridors"),
        _value_row("inference cadence [Hz]", "0.500", figures.cadence_hz, figures.distinct_results, "of every result"),
        _value_row("capture [pictures/s]", "2.58", figures.captured_hz, figures.answered, "as the camera numbers them"),
        _spread_row("frame age at completion median / p95 [s]", "0.6838 / 0.8888", figures.frame_age_s, 4, "mp"),
    )


def _machine_rows(run: BoardRun) -> tuple[Row, ...]:
    figures, absent = run.figures, run.absent
    zone = f"thermal zone {figures.temperature_zone}"
    return (
        _spread_row("CPU median [%]", "46.32", figures.cpu_percent, 2, "m", "whole machine, all cores busy: 100"),
        _spread_row(
            "memory of the control group median [MiB]", "1665.7", figures.memory_mib, 1, "m",
            f"with cache and kernel memory, {run.memory_group}", absent.get("memory", ""),
        ),
        _spread_row(
            "temperature median / max [C]", "45.3 / 50.3", figures.temperature_c, 1, "mx", zone,
            absent.get("temperature", ""),
        ),
        ("power", "unavailable", None, None, NO_METER),
    )  # fmt: skip


def _fault_rows(figures: BoardFigures, absent: dict[str, str]) -> tuple[Row, ...]:
    answered, failures = figures.answered, ", ".join(f"{text}: {count}" for text, count in figures.failures.items())
    return (
        ("requests answered", "300 of 300", f"{answered} of {figures.polls}", figures.polls, failures),
        ("polls with learned segmentation", "300", str(figures.learned), answered, ""),
        ("polls with stale advice", "0", str(figures.stale), answered, "what happens between polls is not seen"),
        (
            "unusable results",
            "-",
            str(figures.unusable),
            figures.distinct_results,
            "refused by the image-quality check",
        ),
        ("processes lost and back", "-", str(figures.returns), answered, "started again, or their link was silent"),
        ("messages refused or lost", "-", str(figures.drops), answered, ""),
        _count_row("OOM kills", "0", figures.oom_kills, figures.polls, absent.get("oom_kills", "")),
        _count_row("CPU quota throttling", "0", figures.throttled_periods, figures.polls, absent.get("throttling", "")),
        _count_row("major page faults", "-", figures.major_faults, figures.polls, "of the whole machine"),
    )


def _spread_row(
    name: str, paper: str, spread: Spread, digits: int, statistics: str, scope: str = "", missing: str = ""
) -> Row:
    """statistics: which of m (median), p (p95) and x (maximum)."""
    if spread.samples == 0:
        return name, paper, None, None, missing or "no sample"
    values = {"m": spread.median, "p": spread.p95, "x": spread.maximum}
    return name, paper, " / ".join(f"{values[each]:.{digits}f}" for each in statistics), spread.samples, scope


def _value_row(name: str, paper: str, value: float | None, samples: int, scope: str) -> Row:
    if value is None:
        return name, paper, None, None, "fewer than two were sampled"
    return name, paper, f"{value:.3f}", samples, scope


def _count_row(name: str, paper: str, count: int | None, samples: int, text: str) -> Row:
    """text: its scope, or why it is not counted here."""
    return (name, paper, None, None, text or "not counted here") if count is None else (
        name, paper, str(count), samples, text,
    )  # fmt: skip
