"""`paani models convert` and `paani models bench`: another engine for the same networks, and whether it pays here."""

from __future__ import annotations

import argparse
import os
import platform
import sys
from collections.abc import Mapping
from pathlib import Path

from paani.clock import stopwatch_ms
from paani.errors import UserError
from paani.option_numbers import whole_number
from paani.option_paths import input_file, output_file, output_folder
from paani.whole_file import write_json
from paani_models.catalogue import read_contract, verified_path
from paani_models.datasets.selection import PictureSelection
from paani_models.engines import benchmark
from paani_models.engines.contract_check import MAX_DIFFERENCE, infer_role
from paani_models.engines.ncnn_runner import NOT_INSTALLED, ncnn_files, ncnn_version, verified_ncnn_files
from paani_models.engines.parity import prepare_inputs

ROLES = ("detector", "segmenter")


def add_convert_arguments(parser: argparse.ArgumentParser) -> None:
    """Of `paani models convert`."""
    parser.add_argument(
        "models", type=input_file(), nargs="*", metavar="MODEL.onnx", help="the shipped pair if not given"
    )
    parser.add_argument("--role", choices=ROLES, help="inferred from the output if not given")
    parser.add_argument("--out", type=output_folder("--out"), metavar="DIR", help="beside the model if not given")
    parser.add_argument("--pnnx", metavar="FILE", help="the converter; found on the PATH if not given")


def add_bench_arguments(parser: argparse.ArgumentParser) -> None:
    """Of `paani models bench`."""
    parser.add_argument("--engine", choices=("all", *benchmark.ENGINES), default="all")
    parser.add_argument("--threads", type=_parse_thread_counts, default=(1, 2), metavar="N,N", help="default: 1,2")
    parser.add_argument(
        "--rounds", type=whole_number(1, 10_000), default=30, metavar="N", help="runs of each (default: 30)"
    )
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the figures there too")


def convert(arguments: argparse.Namespace) -> int:
    """Raises UserError naming what is missing or cannot be converted."""
    try:
        from paani_models.engines import ncnn_convert  # noqa: PLC0415 - onnx is not on the board
    except ModuleNotFoundError as error:
        raise UserError(f"{error.name} is not installed; install the extra paani[train]") from error
    if ncnn_version() is None:
        raise UserError(NOT_INSTALLED)
    settings = ["perception.engine=ncnn"]
    for source in arguments.models or [verified_path(role) for role in ROLES]:
        role = infer_role(source, arguments.role)
        folder = arguments.out or source.parent
        inputs = prepare_inputs(read_contract(source, role), _held_out_pictures(arguments))
        record = ncnn_convert.convert_to_ncnn(source, role, folder, arguments.pnnx, inputs)
        sys.stdout.write(
            f"{ncnn_files(folder / source.name).param}: {role}, answers differ by at most {record.max_difference:.1e}, "
            f"{record.inputs} inputs\n"
        )
        if arguments.models or arguments.out:
            settings.append(f"perception.{role}={folder / source.name}")
    sys.stdout.write("paani up" + "".join(f" --set {setting}" for setting in settings) + "\n")
    return 0


def bench(arguments: argparse.Namespace) -> int:
    """Measure, print, write. Raises UserError where an engine that was asked for by name cannot run."""
    nets = benchmark.load_networks(arguments.weights)
    engines = list(benchmark.ENGINES) if arguments.engine == "all" else [arguments.engine]
    excluded = {}
    if "ncnn" in engines and (reason := _reason_against_ncnn(nets)):
        if arguments.engine == "ncnn":
            raise UserError(reason)
        engines.remove("ncnn")
        excluded["ncnn"] = reason
    agreements: tuple[benchmark.Agreement, ...] = ()
    if "ncnn" in engines:
        pictures = _held_out_pictures(arguments)
        inputs = {role: prepare_inputs(net.contract, pictures) for role, net in nets.items()}
        agreements = benchmark.measure_agreements(nets, inputs)
    ready, load_before = benchmark.prepare_cases(nets, engines, arguments.threads), os.getloadavg()[0]
    times_ms: dict[benchmark.Case, list[float]] = {}
    for turn, times_ms in benchmark.measure_rounds(  # noqa: B007 - the last one is the result
        ready, arguments.rounds, stopwatch_ms
    ):
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{max(0, turn):4} of {arguments.rounds} rounds\r")
    rows = benchmark.summarise_times(times_ms)
    report = benchmark.EngineReport(
        machine=f"{platform.machine()} {platform.system()}",
        cores=os.cpu_count() or 1,
        load_before=round(load_before, 2),
        load_after=round(os.getloadavg()[0], 2),
        rows=rows,
        costs=benchmark.measure_costs(nets),
        agreements=agreements,
        left_out=excluded,
        choice=benchmark.choose_engine(rows, agreements, MAX_DIFFERENCE),
    )
    sys.stdout.write(benchmark.format_report(report))
    if arguments.json:
        write_json(arguments.json, report, "--json")
    return 0


def _reason_against_ncnn(nets: Mapping[str, benchmark.NetworkFile]) -> str:
    """Why ncnn cannot be timed; empty where it can."""
    if ncnn_version() is None:
        return NOT_INSTALLED
    try:
        for net in nets.values():
            verified_ncnn_files(net.file)
    except UserError as error:
        return str(error)
    return ""


def _held_out_pictures(arguments: argparse.Namespace) -> list[Path]:
    """Pictures of the held-out sequences, where there is a data folder."""
    if not arguments.data.is_dir():
        return []
    samples = PictureSelection(arguments.data, arguments.sources, arguments.rendered).samples
    return [sample.picture for sample in samples if sample.held_out]


def _parse_thread_counts(text: str) -> tuple[int, ...]:
    try:
        values = tuple(dict.fromkeys(int(part) for part in text.split(",")))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no list of numbers like 1,2") from None
    if not all(1 <= value <= 64 for value in values):
        raise argparse.ArgumentTypeError(f"{text}: a number of threads is from 1 to 64")
    return values
