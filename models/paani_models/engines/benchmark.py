"""Time both networks by every engine and number of threads, in turn, and choose the faster engine for this machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from paani.statistics.order_statistics import median, nearest_rank
from paani_models.catalogue import Model, load_catalogue, verified_path
from paani_models.engines.contract_check import synthetic_inputs
from paani_models.engines.multiply_adds import count_multiply_adds
from paani_models.engines.ncnn_runner import Run, ncnn_files, open_ncnn, verified_ncnn_files
from paani_models.engines.onnx_runner import open_network
from paani_models.engines.parity import Inputs, measure_difference

ENGINES = ("onnxruntime", "ncnn")
PAPER_MULTIPLY_ADDS = {"detector": 631_000_000, "segmenter": 357_000_000}  # counted: its two shapes at 256x320
SCENE = "a river"
WARM_ROUNDS = 3


class NetworkFile(NamedTuple):
    """A model file and its contract."""

    contract: Model
    file: Path


class Case(NamedTuple):
    """One network, run one way."""

    engine: str
    net: str
    threads: int


class TimingRow(msgspec.Struct, frozen=True):
    """Least, median and 95th percentile (nearest rank) of `n` runs of one network, [ms]."""

    engine: str
    net: str
    threads: int
    least_ms: float
    median_ms: float
    p95_ms: float
    n: int


class NetCost(msgspec.Struct, frozen=True):
    """File sizes and work per frame of a network.

    multiply_adds: None where onnx, which tells them, is not installed.
    """

    net: str
    onnx_bytes: int
    ncnn_bytes: int | None
    multiply_adds: int | None
    paper_multiply_adds: int


class Agreement(msgspec.Struct, frozen=True):
    """The largest difference of both engines' answers over `inputs` pictures; boxes as shares of the input's sides."""

    net: str
    max_difference: float
    inputs: int


class Choice(msgspec.Struct, frozen=True):
    """What `perception.engine` should be on this machine, and why."""

    engine: str
    reason: str


class EngineReport(msgspec.Struct, frozen=True):
    """What `--json` writes. left_out: engines that could not run, with the reason."""

    machine: str
    cores: int
    load_before: float
    load_after: float
    rows: tuple[TimingRow, ...]
    costs: tuple[NetCost, ...]
    agreements: tuple[Agreement, ...]
    left_out: dict[str, str]
    choice: Choice


def load_networks(weights: Path) -> dict[str, NetworkFile]:
    """Load both networks of a weights folder. Raises UserError naming a file that is missing or corrupt."""
    return {
        role: NetworkFile(load_catalogue(weights)[role], verified_path(role, weights)) for role in PAPER_MULTIPLY_ADDS
    }


def prepare_cases(
    nets: Mapping[str, NetworkFile], engines: Sequence[str], threads: Sequence[int]
) -> dict[Case, Callable[[], object]]:
    """Prepare each network to run on a synthetic scene.

    Raises UserError for an engine or a file that cannot be used.
    """
    return {
        Case(engine, role, count): _bind_input(net, open_ncnn(verified_ncnn_files(net.file), count))
        if engine == "ncnn"
        else _bind_input(net, open_network(net.file, count))
        for role, net in nets.items()
        for count in threads
        for engine in engines
    }


def _bind_input(net: NetworkFile, run: Run) -> Callable[[], object]:
    scene = np.asarray(synthetic_inputs(net.contract)[SCENE], np.float32)
    return lambda: run(scene)


def measure_rounds(
    ready: Mapping[Case, Callable[[], object]], rounds: int, stopwatch_ms: Callable[[], float]
) -> Iterator[tuple[int, dict[Case, list[float]]]]:
    """Run all cases in turn; yields the round and all times so far, [ms]. A few rounds warm up."""
    times_ms: dict[Case, list[float]] = {case: [] for case in ready}
    for turn in range(-WARM_ROUNDS, rounds):
        for case, run in ready.items():
            start_ms = stopwatch_ms()
            run()
            if turn >= 0:
                times_ms[case].append(stopwatch_ms() - start_ms)
        yield turn + 1, times_ms


def summarise_times(times_ms: Mapping[Case, list[float]]) -> tuple[TimingRow, ...]:
    """Least, median and 95th percentile of each case, in the order of the cases."""
    return tuple(
        TimingRow(*case, round(min(t), 3), round(median(t), 3), round(nearest_rank(t, 95), 3), len(t))
        for case, t in times_ms.items()
        if t
    )


def choose_engine(found: Sequence[TimingRow], agreements: Sequence[Agreement], max_difference: float) -> Choice:
    """Choose the engine whose fastest number of threads runs the pair in the least time, by medians.

    ncnn only where it answers as onnxruntime does, and ran every network that onnxruntime ran; onnxruntime where they
    draw.
    """
    for agreement in agreements:
        if not agreement.max_difference <= max_difference:
            apart = f"{agreement.max_difference:.1e}, more than {max_difference:.0e}"
            return Choice("onnxruntime", f"ncnn's {agreement.net} answers differ by {apart}")
    nets = {row.net for row in found}
    best: dict[str, float] = {}
    for engine, threads in dict.fromkeys((row.engine, row.threads) for row in found):
        took = {row.net: row.median_ms for row in found if (row.engine, row.threads) == (engine, threads)}
        if set(took) == nets:
            best[engine] = min(best.get(engine, sum(took.values())), sum(took.values()))
    if set(best) != set(ENGINES):
        return Choice("onnxruntime", "the default; nothing was compared")
    fastest, other = sorted(ENGINES, key=lambda engine: best[engine])
    return Choice(fastest, f"the pair takes {best[fastest]:.1f} ms, by {other} {best[other]:.1f} ms: medians")


def measure_costs(nets: Mapping[str, NetworkFile]) -> tuple[NetCost, ...]:
    """Measure the sizes of the files that exist, and count the work of one run."""
    found = []
    for role, net in nets.items():
        files = ncnn_files(net.file)
        there = files.param.is_file() and files.bin.is_file()
        size = files.param.stat().st_size + files.bin.stat().st_size if there else None
        found.append(
            NetCost(role, net.file.stat().st_size, size, count_multiply_adds(net.file), PAPER_MULTIPLY_ADDS[role])
        )
    return tuple(found)


def measure_agreements(nets: Mapping[str, NetworkFile], inputs: Mapping[str, Inputs]) -> tuple[Agreement, ...]:
    """Measure the agreement of both engines for each network.

    Raises UserError for an engine or a file that cannot be used.
    """
    return tuple(
        Agreement(
            role,
            measure_difference(net.file, verified_ncnn_files(net.file), role, net.contract, inputs[role]),
            len(inputs[role]),
        )
        for role, net in nets.items()
    )


def format_report(report: EngineReport) -> str:
    """Format the report as two tables and the choice."""
    lines = [
        f"{'engine':12} {'net':10} {'threads':>7} {'least [ms]':>11} {'median [ms]':>12} {'p95 [ms]':>10} {'n':>5}"
    ]
    lines += [
        f"{r.engine:12} {r.net:10} {r.threads:7} {r.least_ms:11.2f} {r.median_ms:12.2f} {r.p95_ms:10.2f} {r.n:5}"
        for r in report.rows
    ]
    lines += ["", f"{'net':10} {'onnx [bytes]':>13} {'ncnn [bytes]':>13} {'multiply-adds':>14} {'of the paper':>13}"]
    lines += [
        f"{c.net:10} {c.onnx_bytes:13} {_or_dash(c.ncnn_bytes):>13} {_or_dash(c.multiply_adds):>14} "
        f"{c.paper_multiply_adds:13}"
        for c in report.costs
    ]
    counted = [c.multiply_adds for c in report.costs if c.multiply_adds is not None]
    if len(counted) == len(report.costs):
        share = sum(counted) / sum(c.paper_multiply_adds for c in report.costs)
        lines.append(f"a frame costs {sum(counted) / 1e6:.0f} M multiply-adds, {share:.2f} of the paper's pair")
    lines.append("")
    for agreement in report.agreements:
        differ = f"answers differ by at most {agreement.max_difference:.1e}"
        lines.append(f"{agreement.net}: {differ}, {agreement.inputs} inputs")
    lines += [f"{engine} left out: {reason}" for engine, reason in report.left_out.items()]
    lines.append(f"{report.machine}, {report.cores} cores, load {report.load_before:.2f} to {report.load_after:.2f}")
    lines.append(f"for this machine: perception.engine={report.choice.engine} ({report.choice.reason})")
    return "\n".join(lines) + "\n"


def _or_dash(value: int | None) -> str:
    return "-" if value is None else str(value)
