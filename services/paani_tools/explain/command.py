"""`paani explain FILE`."""

from __future__ import annotations

import argparse
import datetime
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.config import CorridorConfig
from paani.errors import UserError
from paani.logs.reader import Log, open_log
from paani.option_paths import input_path, output_picture, require_apart
from paani.whole_file import write_whole
from paani_tools.explain.moment import Moment, last_change_us, moment_at
from paani_tools.explain.narrative import narrative_of
from paani_tools.look.annotate import annotate_picture
from paani_tools.replay.compatibility import provenance_of

DAY_US = 86_400_000_000


def main(argv: list[str]) -> int:
    """Tell one decision. Exit codes: 0 told, 2 user's mistake."""
    parser = argparse.ArgumentParser(prog="paani explain", description="One decision of a recorded drive, explained.")
    parser.add_argument("file", type=input_path(), metavar="FILE", help="a recording, or a folder of its parts")
    parser.add_argument(
        "--at", metavar="T", help="seconds since the start, or UTC (12:30:05, 2027-01-31T12:30:05Z); "
        "default: the last change of direction",
    )  # fmt: skip
    parser.add_argument(
        "--picture", type=output_picture("--picture"), metavar="FILE", help="write the annotated picture (.png or .jpg)"
    )
    options = parser.parse_args(argv)
    log = open_log(options.file)
    require_apart({"--picture": options.picture}, log.files)
    config = provenance_of(log, force=True).config
    moment = moment_at(log, last_change_us(log) if options.at is None else time_us(options.at, log))
    sys.stdout.write(narrative_of(moment, config))
    if options.picture is not None:
        _write(options.picture, picture_of(log, moment, config.perception.corridors))
    return 0


def time_us(text: str, log: Log) -> int:
    """A time of the log. Raises UserError."""
    try:
        seconds = float(text)
    except ValueError:
        return _utc_us(text, log)
    if not 0.0 <= seconds <= 1e9:
        raise UserError(f"--at {text}: expected seconds since the start")
    return log.start_us + round(seconds * 1e6)


def picture_of(log: Log, moment: Moment, corridors: CorridorConfig) -> NDArray[np.uint8]:
    """The annotated frame. Raises UserError where the log has none."""
    if moment.picture is None or moment.evidence is None:
        raise UserError(f"{log.path}: the picture of this decision is not in it")
    bgr = cv2.imdecode(np.frombuffer(moment.picture.data, np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise UserError(f"{log.path}: the picture of this decision cannot be decoded")
    mask = None
    if moment.mask is not None:
        mask = cv2.imdecode(np.frombuffer(moment.mask.data, np.uint8), cv2.IMREAD_GRAYSCALE)
        mask = mask if mask is not None and mask.max() <= 2 else None
    return annotate_picture(
        np.asarray(bgr, np.uint8),
        None if mask is None else np.asarray(mask, np.uint8),
        moment.evidence,
        moment.advisory,
        corridors,
    )


def _utc_us(text: str, log: Log) -> int:
    start = datetime.datetime.fromtimestamp(log.start_us * 1e-6, tz=datetime.UTC)
    try:
        if "T" in text or " " in text:
            moment = datetime.datetime.fromisoformat(text)
            moment = moment.replace(tzinfo=moment.tzinfo or datetime.UTC)
        else:
            clock = datetime.time.fromisoformat(text.removesuffix("Z"))
            moment = datetime.datetime.combine(start.date(), clock, clock.tzinfo or datetime.UTC)
    except ValueError as error:
        raise UserError(f"--at {text}: expected seconds since the start, or a time like 12:30:05") from error
    at_us = round(moment.timestamp() * 1e6)
    return at_us + DAY_US if at_us < log.start_us and "T" not in text and " " not in text else at_us


def _write(path: Path, picture: NDArray[np.uint8]) -> None:
    _, data = cv2.imencode(path.suffix.lower(), picture)
    write_whole(path, data.tobytes(), "--picture")
