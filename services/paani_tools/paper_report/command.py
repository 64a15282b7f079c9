"""`paani paper-report`."""

from __future__ import annotations

import argparse
import itertools
import sys
from pathlib import Path

import msgspec

from paani.config import load_config
from paani.errors import UserError
from paani.option_paths import input_folder, output_file
from paani.statistics.figure_table import FigureTable
from paani.undecodable import UNREADABLE
from paani.whole_file import write_whole
from paani_models.catalogue import PAPER_WEIGHTS, WEIGHTS, load_catalogue
from paani_models.report.experiments import read_experiments
from paani_tools.bench.board.table import BoardRun
from paani_tools.paper_report.recipes import training_table
from paani_tools.paper_report.tables import (
    SHIPPED,
    TRAINED,
    board_tables,
    detector_table,
    network_table,
    quantised_table,
    segmenter_table,
    settings_table,
    stills_table,
    world_table,
)

TITLE = "# The paper's results, and what stands here"
INTRODUCTION = (
    "Each row has the paper's figure, ours, of how many samples, and what differs. A dash: not measured here. Figures "
    "of networks are from their manifests; advice is decided anew as the report is made."
)
BOARD_FILE = "board.json"


class _Kept(msgspec.Struct, frozen=True):
    run: BoardRun


def main(argv: list[str]) -> int:
    """Print the report or write it. Exit codes: 0 done, 2 user's mistake."""
    parser = argparse.ArgumentParser(
        prog="paani paper-report", description="The paper's tables of results beside what stands here, as Markdown."
    )
    parser.add_argument(
        "--board", type=input_folder("--board"), metavar="DIR", help="a run of `paani bench board --profile paper`"
    )
    parser.add_argument("--out", type=output_file("--out"), metavar="FILE", help="write it there")
    options = parser.parse_args(argv)
    text = report_text(read_board(options.board) if options.board else None)
    if options.out:
        write_whole(options.out, text.encode(), "--out")
    else:
        sys.stdout.write(text)
    return 0


def report_text(run: BoardRun | None) -> str:
    """The whole report. run: of the board protocol, where there is one."""
    paper, ours = load_config(profile="paper"), load_config()
    sets = ((SHIPPED, load_catalogue()), (TRAINED, load_catalogue(PAPER_WEIGHTS)))
    networks = (
        (network_table(each["detector"], each["segmenter"], whose), detector_table(each["detector"], whose),
         segmenter_table(each["segmenter"], whose))
        for whose, each in sets
    )  # fmt: skip
    tables = (
        *itertools.chain.from_iterable(zip(*networks, strict=True)),
        quantised_table(read_experiments(WEIGHTS)),
        stills_table(paper, ours),
        settings_table(paper, ours),
        world_table(paper),
        training_table(),
        board_tables(run),
    )
    return "\n".join((TITLE, "", INTRODUCTION, "", *(markdown(table) for table in tables)))


def read_board(folder: Path) -> BoardRun:
    """The run that this folder keeps. Raises UserError naming the file."""
    file = folder / BOARD_FILE
    try:
        return msgspec.json.decode(file.read_bytes(), type=_Kept).run
    except UNREADABLE as error:
        raise UserError(f"--board {file}: {error}") from error


def markdown(table: FigureTable) -> str:
    """A heading, the table, and how to read it."""
    lines = [table.columns, tuple("---" for _ in table.columns), *table.rows]
    rows = "\n".join("| " + " | ".join(_cell(cell) for cell in line) + " |" for line in lines)
    note = f"\n\n{table.note}" if table.note else ""
    return f"## {table.name}\n\n{rows}{note}\n"


def _cell(value: str | float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.4f}" if isinstance(value, float) else str(value).replace("|", "\\|")
