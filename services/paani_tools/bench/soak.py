"""`paani bench soak`: does a drive that goes on and on take more? Memory, descriptors, threads, disk, decisions."""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import linear_regression

import msgspec

from paani.cli import add_config_arguments, config_from
from paani.clock import MonotonicClock
from paani.config import Config
from paani.option_numbers import quantity
from paani.option_paths import output_file
from paani.runtime import runtime_dir
from paani.whole_file import write_json
from paani_tools.up.command import up_sets
from paani_tools.up.lifecycle import run_plan
from paani_tools.up.plan import make_plan
from paani_tools.up.terminal import Display

CLOCK = MonotonicClock()
LEAST_S = 10.0  # of a run: of less there are too few samples to see a slope
SAMPLE_S = 5.0
WARM_UP = 0.2  # of the run, at most ten minutes: caches fill, and the C library finds its size
WARM_UP_MAX_S = 600.0
MAX_RSS_SLOPE_MIB_H = 1.0
CHILD = "paani_tools.up.child"


class Sample(msgspec.Struct, frozen=True):
    """One look at a process."""

    at_s: float
    pid: int
    rss_mib: float
    anonymous_mib: float
    descriptors: int
    threads: int


class Soaked(msgspec.Struct, frozen=True, kw_only=True):
    """What a process took after the warm-up; slopes by least squares.

    Anonymous memory is what a process itself has asked for. RSS has pages of files as well, which the kernel takes back
    and brings again by what else the machine does. Lasting: the smaller slope of the two halves of the time, of
    anonymous memory; what is taken once, when something happens first, is in one of them alone.
    descriptors, threads: the least of each half of the samples: what is opened for a moment is not kept.
    """

    restarts: int
    rss_mib: float
    rss_slope_mib_h: float
    anonymous_slope_mib_h: float
    lasting_slope_mib_h: float
    descriptors: tuple[int, int]
    threads: tuple[int, int]


class SoakReport(msgspec.Struct, frozen=True, kw_only=True):
    """`disk_slope_mib_h`: of the runtime folder, logs and journals among what lies there."""

    driven_s: float
    distance_m: float
    collisions: int
    decisions_hz: float
    drops: dict[str, int]
    disk_mib: float
    disk_slope_mib_h: float
    processes: dict[str, Soaked]


def main(argv: list[str]) -> int:
    """Exit codes: 0 every bar was kept, 1 one was not or a process was started again, 2 user's mistake."""
    parser = argparse.ArgumentParser(prog="paani bench soak", description="A long drive, and what it takes.")
    parser.add_argument("--world", help="a world or a scenario (default: river)")
    seconds = quantity("seconds", LEAST_S, with_low=True)
    parser.add_argument("--for", dest="seconds", type=seconds, default=3600.0, metavar="S", help="default: 3600")
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the figures there too")
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    config = config_from(options, up_sets(world=options.world, camera=None, headless=True))
    report = asyncio.run(_soak(config, options.seconds))
    sys.stdout.write("\n" + soak_text(report))
    if options.json:
        write_json(options.json, report, "--json")
    return 0 if keeps_bars(report) else 1


def keeps_bars(report: SoakReport) -> bool:
    """Memory does not grow by more than 1 MiB an hour, and nothing was started again or keeps what it opens."""
    return all(
        one.rss_slope_mib_h <= MAX_RSS_SLOPE_MIB_H and one.restarts == 0 and one.descriptors[1] <= one.descriptors[0]
        for one in report.processes.values()
    )


def soak_text(report: SoakReport) -> str:
    """The table."""
    rows = [
        "| process | RSS [MiB] | slope [MiB/h] | of it anonymous | descriptors, least of halves | threads | restarts |",
        "|---|---|---|---|---|---|---|",
    ]
    rows += [
        f"| {name} | {one.rss_mib:.1f} | {one.rss_slope_mib_h:+.2f} "
        f"| {one.anonymous_slope_mib_h:+.2f} | {one.descriptors[0]}, {one.descriptors[1]} "
        f"| {one.threads[0]}, {one.threads[1]} | {one.restarts} |"
        for name, one in report.processes.items()
    ]
    drops = ", ".join(f"{name} {count}" for name, count in report.drops.items()) or "none"
    return "\n".join(rows) + (
        f"\n\n{report.driven_s:.0f} s, {report.distance_m:.0f} m, {report.collisions} collisions, "
        f"{report.decisions_hz:.2f} decisions/s; runtime folder {report.disk_mib:.1f} MiB, "
        f"{report.disk_slope_mib_h:+.2f} MiB/h; drops: {drops}\n"
    )


def soaked(samples: Sequence[Sample]) -> Soaked:
    """Figures of one process from samples in order, at least four of them in its last life after the warm-up."""
    driven_s = samples[-1].at_s - samples[0].at_s
    warm_s = samples[0].at_s + min(WARM_UP * driven_s, WARM_UP_MAX_S)
    warm = [each for each in samples if each.at_s >= warm_s]
    middle = len(warm) // 2
    first, second = halves = warm[:middle], warm[middle:]
    return Soaked(
        restarts=len({each.pid for each in samples}) - 1,
        rss_mib=warm[-1].rss_mib,
        rss_slope_mib_h=slope_per_h((each.at_s, each.rss_mib) for each in warm),
        anonymous_slope_mib_h=slope_per_h((each.at_s, each.anonymous_mib) for each in warm),
        lasting_slope_mib_h=min(slope_per_h((each.at_s, each.anonymous_mib) for each in half) for half in halves),
        descriptors=(min(each.descriptors for each in first), min(each.descriptors for each in second)),
        threads=(min(each.threads for each in first), min(each.threads for each in second)),
    )


def slope_per_h(points: Iterable[tuple[float, float]]) -> float:
    """Slope of a line through points of time [s] and value, by least squares [1/h]."""
    times_s, values = zip(*points, strict=True)
    return linear_regression(times_s, values).slope * 3600.0


async def _soak(config: Config, driven_s: float) -> SoakReport:
    plan = await make_plan(config)
    folder = await asyncio.to_thread(runtime_dir, plan.config.bus)
    samples: dict[str, list[Sample]] = {name: [] for name in plan.services}
    disk: list[tuple[float, float]] = []

    async def watch() -> None:
        begun_us = CLOCK.now_us()
        while (at_s := (CLOCK.now_us() - begun_us) * 1e-6) < driven_s:
            for name, sample in (await asyncio.to_thread(_look, at_s)).items():
                samples[name].append(sample)
            disk.append((at_s, await asyncio.to_thread(_size_mib, folder)))
            await asyncio.sleep(min(SAMPLE_S, driven_s / 20))

    outcome = await run_plan(plan, None, Display(sys.stdout), watch)
    report = outcome.report
    return SoakReport(
        driven_s=report.duration_s,
        distance_m=report.distance_m,
        collisions=report.collisions,
        decisions_hz=sum(report.decisions.values()) / max(report.duration_s, 1e-9),
        drops=report.drops,
        disk_mib=disk[-1][1],
        disk_slope_mib_h=slope_per_h(disk),
        processes={name: soaked(found) for name, found in samples.items()},
    )


def _look(at_s: float) -> dict[str, Sample]:
    """Every process that this one has started, by name."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            words = (folder / "cmdline").read_text(encoding="utf-8").rstrip("\0").split("\0")
            if CHILD not in words or words[words.index(CHILD) + 1] != str(os.getpid()):
                continue
            status = dict(line.split(":", 1) for line in (folder / "status").read_text(encoding="ascii").splitlines())
            found[words[-1]] = Sample(
                at_s=at_s,
                pid=int(folder.name),
                rss_mib=_mib(status["VmRSS"]),
                anonymous_mib=_mib(status["RssAnon"]),
                descriptors=len(list((folder / "fd").iterdir())),
                threads=int(status["Threads"]),
            )
        except (OSError, KeyError):  # it has just ended
            continue
    return found


def _mib(text: str) -> float:
    """Of a value of `/proc/*/status`, such as `  1024 kB`."""
    return int(text.split(maxsplit=1)[0]) / 1024


def _size_mib(folder: Path) -> float:
    total = 0
    for path in folder.rglob("*"):
        try:
            total += path.stat().st_size if path.is_file() else 0
        except OSError:  # replaced meanwhile
            continue
    return total / 2**20
