"""What recording costs: the whole loop with pictures at 10 Hz, every topic, real processes, a real disk."""

from __future__ import annotations

import argparse
import asyncio
import tempfile
from pathlib import Path

from paani import keys
from paani.cli import config_from
from paani.logs.reader import open_log
from paani.logs.writer import HEADER
from paani.statistics.figure_table import FigureTable
from paani_tools.logs.info import LogInfo, info_of
from paani_tools.up.command import up_sets
from paani_tools.up.lifecycle import Outcome, run_plan
from paani_tools.up.plan import make_plan
from paani_tools.up.run_summary import Report
from paani_tools.up.terminal import Display

PICTURES = ("camera.rate_hz=10", "eye.rate_hz=10", "perception.rate_hz=10")
MIB = 2**20


def recorder(options: argparse.Namespace, display: Display) -> tuple[FigureTable, str]:
    """Drive for `options.seconds` and record it. Returns the figures, and why the drive failed (empty: it did not)."""
    with tempfile.TemporaryDirectory(prefix="paani-bench-") as folder:
        outcome = asyncio.run(_drive(options, Path(folder), display))
        if outcome.failure:
            return FigureTable(name="recorder", columns=("figure",), rows=()), outcome.failure
        return figures(outcome.report, info_of(open_log(Path(folder)))), ""


def figures(report: Report, info: LogInfo) -> FigureTable:
    """Side by side with the router, which carries the same messages without keeping them."""
    own, router = report.services["recorder"], report.services["router"]
    topics = {topic.topic: topic for topic in info.topics}
    pictures = topics.get(keys.PICTURE.name)
    recorded = [topic for topic in info.topics if not topic.topic.startswith("viewer/")]
    bus = sum(topic.rate_hz for topic in recorded if not topic.topic.endswith(HEADER))
    return FigureTable(
        name="recorder",
        columns=("figure", "value"),
        rows=(
            ("CPU of the recorder [% of a core]", round(100 * own.cpu_cores, 2)),
            ("CPU of the router, which keeps nothing [% of a core]", round(100 * router.cpu_cores, 2)),
            ("CPU, recorder over router", round(own.cpu_cores / router.cpu_cores, 2) if router.cpu_cores else None),
            ("memory [MiB]", round(own.rss_mib, 1)),
            ("messages a second", round(bus, 1)),
            ("pictures a second", pictures.rate_hz if pictures else 0.0),
            ("on disk [MiB an hour]", round(info.size_bytes / MIB / info.duration_s * 3600, 1)),
            ("dropped", sum(topic.dropped for topic in info.topics)),
            ("missing", sum(topic.missing for topic in info.topics)),
        ),
        note=f"{report.duration_s:.0f} s of driving, {info.size_bytes / MIB:.1f} MiB",
    )


async def _drive(options: argparse.Namespace, folder: Path, display: Display) -> Outcome:
    sets = (*up_sets(world=None, camera=None, headless=True, record=folder), *PICTURES)
    return await run_plan(await make_plan(config_from(options, sets)), options.seconds, display)
