"""`paani scenario PATH...`: the paper's offline scenarios on any pictures; no bus, no simulator."""

import argparse
import sys
from pathlib import Path

import msgspec

from paani.cli import add_config_arguments, config_from
from paani.clock import stopwatch_ms
from paani.config import Config
from paani.errors import UserError
from paani.messages import Text
from paani.option_paths import input_path, output_file, require_apart
from paani.whole_file import write_json
from paani_services.perception.pipeline import Perceiver
from paani_tools.look.verdict import PRESENTATION_US, PRESENTATIONS, Verdict
from paani_tools.progress import Progress
from paani_tools.scenario.stills import Row, Skipped, Stale, present_still, probe_stale, row_of, stills_of
from paani_tools.scenario.stills_table import families_table, stills_table
from paani_tools.scenario.trajectories import Family, families


class StillsReport(msgspec.Struct, frozen=True, kw_only=True):
    """What `--json` writes for pictures; the last row is the black one."""

    profile: Text
    models: Text
    confidence_threshold: float
    presentations: int = PRESENTATIONS
    period_s: float = PRESENTATION_US / 1e6
    rows: tuple[Row, ...]
    stale: Stale
    skipped: tuple[Skipped, ...]


class TrajectoriesReport(msgspec.Struct, frozen=True, kw_only=True):
    """What `--json` writes for trajectories."""

    profile: Text
    families: tuple[Family, ...]


def main(argv: list[str]) -> int:
    """Raises UserError naming a path that is missing, holds no pictures, or is none."""
    parser = _parser()
    options = parser.parse_args(argv)
    if options.trajectories == bool(options.paths):
        parser.error("give pictures, or --trajectories")
    config = config_from(options)
    report: StillsReport | TrajectoriesReport
    if options.trajectories:
        report = TrajectoriesReport(profile=config.profile, families=families(config))
        text = families_table(report.families)
    else:
        require_apart({"--json": options.json}, (file for file, _ in stills_of(options.paths)))
        report = stills_report(options.paths, config)
        text = stills_table(report.rows, report.stale)
        for skipped in report.skipped:
            text += f"skipped {skipped.file}: {skipped.why}\n"
        if report.skipped:
            text += f"{len(report.skipped)} of {len(report.skipped) + len(report.rows) - 1} pictures skipped\n"
    if options.json is not None:
        write_json(options.json, report, "--json")
    sys.stdout.write(text)
    return 0


def stills_report(paths: list[Path], config: Config) -> StillsReport:
    """Show every picture and the black one. Raises UserError as `main` does."""
    stills = stills_of(paths)
    judgements: list[Verdict] = []
    skipped: list[Skipped] = []
    perceiver = Perceiver(config.perception, stopwatch_ms)
    try:
        with Progress("scenario") as progress:
            for number, found in enumerate(present_still(stills, perceiver, config)):
                progress.at(number / (len(stills) + 1))
                if isinstance(found, Skipped):
                    skipped.append(found)
                else:
                    judgements.append(found)
    finally:
        perceiver.close()
    if len(judgements) == 1:
        raise UserError(f"{paths[0]}: holds no picture that can be read ({skipped[0].file}: {skipped[0].why})")
    return StillsReport(
        profile=config.profile,
        models=judgements[-1].evidence.models,
        confidence_threshold=config.perception.detections.confidence,
        rows=tuple(row_of(judgement) for judgement in judgements),
        stale=probe_stale(judgements, config),
        skipped=tuple(skipped),
    )


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani scenario",
        description="Show each picture to the boat eight times, 0.1 s apart, then a black one; then ask again when the "
        "last picture is 9.3 s old. Prints corridor risks, advice, why and apparent motion.",
    )
    parser.add_argument("paths", nargs="*", type=input_path(), metavar="PATH", help="picture or folder of pictures")
    parser.add_argument("--trajectories", action="store_true", help="generated boxes instead of pictures")
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE", help="also write the report there")
    add_config_arguments(parser)
    return parser
