"""`paani faults DATA`: what the image-quality check refuses, beside the segmenter's error on each fault."""

import argparse
import sys
from pathlib import Path

import msgspec

from paani.arrays import U8
from paani.cli import add_config_arguments, config_from
from paani.config import PerceptionConfig
from paani.errors import UserError
from paani.messages import UnusableCause
from paani.option_numbers import whole_number
from paani.option_paths import input_file, input_folder, output_file, require_apart
from paani.whole_file import write_json, write_whole
from paani_services.perception.corridors import classify_cells
from paani_services.perception.engine import load_network
from paani_services.perception.fitness import load_fitness
from paani_services.perception.image_quality import ImageQualityState, check_image_quality
from paani_services.perception.preprocessing import lookup_tables_for, stretch_picture
from paani_tools.faults.corpus import find_source_folders, read_clean_pictures, read_listed_pictures, read_scenes
from paani_tools.faults.measure import CleanFigures, LevelFigures, Totals, measure_clean, measure_levels, sum_up
from paani_tools.faults.severity_curves import draw_severity_curves


class FaultReport(msgspec.Struct, frozen=True):
    """What `--json` writes. without_water: pictures of which every one must be refused, none where not asked for."""

    totals: Totals
    cells: tuple[LevelFigures, ...]
    clean: tuple[CleanFigures, ...]
    without_water: CleanFigures


class PictureModels:
    """The segmenter and the image-quality check, each on one picture alone."""

    def __init__(self, config: PerceptionConfig) -> None:
        """Raises UserError for a model that cannot be used."""
        self._config = config
        self._segmenter = load_network("segmenter", config, config.intra_op_threads)
        self._table = lookup_tables_for(self._segmenter.contract)
        self._fitness = load_fitness(config, config.intra_op_threads)

    def segment(self, bgr: U8) -> U8:
        """Classes uint8 [64, 80]."""
        height, width = self._segmenter.contract.size_hw
        return classify_cells(
            self._segmenter.run(stretch_picture(bgr, height, width, self._table)), self._config.temperature
        )[0]

    def judge(self, bgr: U8) -> UnusableCause:
        """Verdict of the image-quality check, as on the first picture of a camera."""
        return check_image_quality(ImageQualityState(), bgr, 0, self._config.image_quality, self._fitness)[1]


def main(argv: list[str]) -> int:
    """Measure, print, write what was asked for. Raises UserError naming the file or folder."""
    parser = argparse.ArgumentParser(prog="paani faults", description=__doc__)
    parser.add_argument("data", type=input_folder(), help="folder of annotated sources, each with a manifest.json")
    parser.add_argument(
        "--pictures", type=input_file("--pictures"), metavar="FILE", help="only pictures listed here, one path a line"
    )
    parser.add_argument(
        "--without-water", type=input_file("--without-water"), metavar="FILE", help="pictures listed here show no water"
    )
    parser.add_argument("--scenes", type=whole_number(), default=16, help="segmented pictures per source (default: 16)")
    parser.add_argument(
        "--clean", type=whole_number(0), default=200, help="pictures per source as they are (default: 200)"
    )
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE")
    parser.add_argument("--svg", type=output_file("--svg"), metavar="FILE", help="the curves")
    add_config_arguments(parser)
    options = parser.parse_args(argv)
    require_apart({"--json": options.json, "--svg": options.svg}, (options.pictures, options.without_water))
    models = PictureModels(config_from(options).perception)
    folders = find_source_folders(options.data)
    only = _read_list("--pictures", options.pictures) if options.pictures else None
    named = _read_list("--without-water", options.without_water) if options.without_water else frozenset()
    spoiled = [scene for folder in folders for scene in read_scenes(folder, options.scenes, only)]
    dry = read_listed_pictures(options.data, named)
    if not spoiled:
        raise UserError(f"{options.data}: no picture with a mask of three classes")
    clean = tuple(
        measure_clean(folder.name, pictures, models.judge)
        for folder in folders
        if (pictures := read_clean_pictures(folder, options.clean, only))
    )
    cells = []
    for cell in measure_levels(spoiled, models.segment, models.judge):
        cells.append(cell)
        sys.stderr.write(f"\r{len(cells):4} cells  {cell.fault:20}")
    sys.stderr.write("\r" + " " * 40 + "\r")
    report = FaultReport(sum_up(cells, clean), tuple(cells), clean, measure_clean("without_water", dry, models.judge))
    sys.stdout.write(format_table(report))
    if options.json is not None:
        write_json(options.json, report, "--json")
    if options.svg is not None:
        write_whole(options.svg, draw_severity_curves(cells).encode(), "--svg")
    return 0


def format_table(report: FaultReport) -> str:
    """The report as text."""
    lines = ["fault            severity    n   mIoU  refused  must"]
    lines += [
        f"{c.fault:16} {c.severity:8} {c.n:4} {c.miou:6.3f} {c.rejected / max(1, c.n):8.3f}  {c.verdict}"
        for c in report.cells
    ]
    lines += ["", "clean pictures         n  refused"]
    lines += [f"{s.source:18} {s.n:5} {s.rejected:8}  {', '.join(s.causes)}" for s in report.clean]
    if report.without_water.n:
        lines.append(f"\npictures without water: {report.without_water.rejected} of {report.without_water.n} refused")
    t = report.totals
    lines.append(
        f"\nlet through where it must refuse {t.false_accept_frac:.4f}; refused where it must not "
        f"{t.false_reject_frac:.4f}; clean pictures refused {t.clean_reject_frac:.4f}\n"
    )
    return "\n".join(lines)


def _read_list(option: str, path: Path) -> frozenset[str]:
    try:
        return frozenset(line.strip() for line in path.read_text(encoding="utf-8").splitlines() if line.strip())
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{option} {path}: {error}") from error
