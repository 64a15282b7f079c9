"""`paani bench bridge`: round trips, lease expiry, advice to arrow, and what the bridge and the firmware take."""

from __future__ import annotations

import argparse
import asyncio
import functools
import os
import socket
import sys
from collections.abc import Iterable
from pathlib import Path

import msgspec

from paani.cli import add_config_arguments, config_from
from paani.config import Config, with_settings
from paani.errors import UserError
from paani.option_numbers import whole_number
from paani.statistics.figure_table import FigureTable, table_text
from paani.statistics.measured import Machine, Report
from paani.statistics.order_statistics import median, nearest_rank
from paani_tools.bench.bridge.emulator import IMAGE, emulated, require_emulator
from paani_tools.bench.bridge.measure import (
    measure_bridge,
    measure_image,
    measure_lease_errors,
    measure_round_trips,
)
from paani_tools.progress import Progress


def main(argv: list[str]) -> int:
    """Measure against the emulated microcontroller. Raises UserError that names what to install or to build."""
    parser = argparse.ArgumentParser(
        prog="paani bench bridge", description="The bridge against the firmware on an emulated microcontroller."
    )
    parser.add_argument("--image", default=IMAGE, metavar="ELF", help=f"the firmware; default: {IMAGE}")
    parser.add_argument(
        "--count", type=whole_number(2, 100_000), default=100, metavar="N", help="samples of each figure; default: 100"
    )
    parser.add_argument("--json", action="store_true", help="print JSON; progress goes to standard error")
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    image = Path(options.image)
    require_emulator(image)
    config = _private(config_from(options))
    cores, load_before = os.cpu_count() or 1, os.getloadavg()[0]
    part = asyncio.run(_measure(image, config, options.count))
    machine = Machine(cores=cores, load_before=round(load_before, 2), load_after=round(os.getloadavg()[0], 2))
    if options.json:
        sys.stdout.write(msgspec.json.encode(Report(machine=machine, parts=(part,))).decode() + "\n")
        return 0
    sys.stdout.write("\n" + table_text(part))
    sys.stdout.write(f"\n{cores} cores, load {machine.load_before:.2f} before and {machine.load_after:.2f} after\n")
    return 0


async def _measure(image: Path, config: Config, count: int) -> FigureTable:
    """One table. Each figure has an emulator of its own, so that none inherits another's session."""
    rows: list[tuple[str, int | None, float | None, float | None, float | None]] = []
    with Progress("measuring") as bar:
        for transport in ("pty", "tcp"):
            async with emulated(image, transport) as (line, _, _):
                show = functools.partial(bar.at, text=f"round trips over {transport}")
                rows.append(_row(f"round trip over {transport} [ms]", await measure_round_trips(line, count, show)))
        async with emulated(image, "tcp") as (line, _, _):
            errors_ms = await measure_lease_errors(line, count, functools.partial(bar.at, text="leases"))
        rows.append(_row("STOP after the lease's end, by the microcontroller's clock [ms]", errors_ms))
        async with emulated(image, "tcp") as (line, _, _):
            run = await measure_bridge(line, config, count, functools.partial(bar.at, text="advice to arrow"))
        rows.append(_row("advisory on the bus to its arrow reported back on the bus [ms]", run.delays_ms))
    text, data, bss = measure_image(image)
    rows += [
        ("CPU of the bridge [% of a core]", None, round(100 * run.cpu_cores, 2), None, None),
        ("memory of the bridge [MiB]", None, round(run.rss_mib, 1), None, None),
        ("firmware, text [bytes]", None, text, None, None),
        ("firmware, data [bytes]", None, data, None, None),
        ("firmware, bss [bytes]", None, bss, None, None),
    ]
    return FigureTable(
        name="bridge",
        columns=("figure", "n", "median", "p95", "most"),
        rows=tuple(rows),
        note="n: calls answered within 250 ms. Against QEMU's mps2-an505 on this machine; "
        "the board's own microcontroller is not measured.",
    )


def _row(name: str, samples: Iterable[float]) -> tuple[str, int, float, float, float]:
    values = tuple(samples)
    if not values:
        raise UserError(f"{name}: no call was answered within 250 ms; the machine has no time for the emulator")
    return name, len(values), round(median(values), 2), round(nearest_rank(values, 95), 2), round(max(values), 2)


def _private(config: Config) -> Config:
    """On a bus of its own, beside one that may be running."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return with_settings(config, (f"bus.router=tcp/127.0.0.1:{probe.getsockname()[1]}",))
