"""`paani look PATH...`: judge pictures, folders and videos; no bus, no simulator."""

import argparse
import itertools
import sys
from collections.abc import Iterable
from pathlib import Path

import cv2
import msgspec

from paani.cli import add_config_arguments, config_from
from paani.clock import stopwatch_ms
from paani.errors import UserError
from paani.messages import Detection, Direction, LaneRisk, Reason, Text, Unit, UnusableCause
from paani.option_paths import input_path, output_folder, output_picture, require_apart
from paani.whole_file import json_line, write_whole
from paani_services.camera.picture_sources import list_pictures
from paani_services.perception.pipeline import Perceiver
from paani_tools.look.annotate import annotate_picture
from paani_tools.look.contact_sheet import ContactSheet
from paani_tools.look.verdict import Verdict, judge_path

EPOCHS_PER_PATH = 1_000_000
DEFAULT_OUT = Path("runs/look")
JPEG_QUALITY = 90
ANNOTATED_SUFFIX = ".jpg"


class Lanes(msgspec.Struct, frozen=True):
    left: LaneRisk
    center: LaneRisk
    right: LaneRisk


class JsonLine(msgspec.Struct, frozen=True):
    """One line of `--json`: these fields, in this order. `risk` is left, centre, right; boxes are normalised xyxy."""

    path: Text
    usable: bool
    cause: UnusableCause
    direction: Direction
    reason: Reason
    risk: tuple[Unit, Unit, Unit]
    lanes: Lanes
    detections: tuple[Detection, ...]
    explanation: Text


def main(argv: list[str]) -> int:
    """Judge every path in turn. Raises UserError naming a path that cannot be read."""
    options = _parser().parse_args(argv)
    config = config_from(options)
    out: Path | None = options.out or (None if options.json or options.sheet else DEFAULT_OUT)
    read = [file for path in options.paths for file in (list_pictures(path) if path.is_dir() else [path])]
    require_apart({"--sheet": options.sheet}, read)
    if out is not None:
        _require_other_folder(out, read)
    sheet = ContactSheet()
    perceiver = Perceiver(config.perception, stopwatch_ms)
    taken: set[str] = set()
    count = 0
    try:
        if out is not None:
            _make(out)
        for index, path in enumerate(options.paths):
            for verdict in judge_path(path, index * EPOCHS_PER_PATH, perceiver, config):
                count += 1
                sys.stdout.write(json_text(verdict) if options.json else readable_line(verdict))
                if (out or options.sheet) and verdict.bgr is not None:
                    picture = annotate_picture(
                        verdict.bgr,
                        verdict.mask,
                        verdict.evidence,
                        verdict.advisory,
                        config.perception.corridors,
                    )
                    if out is not None:
                        _save(out / file_name(verdict.name, taken), picture)
                    if options.sheet is not None:
                        sheet.add(picture)
                _progress(f"{count}  {verdict.advisory.direction:12}  {verdict.name[-60:]}")
    finally:
        perceiver.close()
        _progress(None)
    if options.sheet is not None and (drawn := sheet.compose()) is not None:
        write_whole(options.sheet, cv2.imencode(options.sheet.suffix, drawn)[1].tobytes(), "--sheet")
    if out is not None and sys.stderr.isatty():
        sys.stderr.write(f"{count} judged, annotated pictures in {out}\n")
    return 0


def file_name(name: str, taken: set[str]) -> str:
    """A name for the annotated picture that no other of this run has; `clip.mp4#7` becomes `clip_000007.jpg`."""
    stem, _, number = Path(name).name.rpartition("#")
    is_frame = number.isdecimal() and bool(stem)
    base = Path(stem).stem + f"_{int(number):06d}" if is_frame else Path(name).stem
    for attempt in itertools.count(1):
        candidate = f"{base}{ANNOTATED_SUFFIX}" if attempt == 1 else f"{base}_{attempt}{ANNOTATED_SUFFIX}"
        if candidate not in taken:
            taken.add(candidate)
            return candidate
    raise AssertionError("count never ends")


def readable_line(verdict: Verdict) -> str:
    """One line for people: picture, direction, reason (and what is wrong with the picture), risks, why in words."""
    advice, evidence = verdict.advisory, verdict.evidence
    reason = advice.reason.value if evidence.usable else f"{advice.reason.value} ({evidence.cause.value})"
    risks = " ".join(f"{lane.risk:.2f}" for lane in (advice.left, advice.center, advice.right))
    count = risks if evidence.usable else "-"
    return f"{verdict.name}  {advice.direction.value:<12}  {reason}  risk {count}  {advice.explanation}\n"


def json_text(verdict: Verdict) -> str:
    """One line for programs: `JsonLine`."""
    advice = verdict.advisory
    lanes = (advice.left, advice.center, advice.right)
    line = JsonLine(
        path=verdict.name,
        usable=verdict.evidence.usable,
        cause=verdict.evidence.cause,
        direction=advice.direction,
        reason=advice.reason,
        risk=(lanes[0].risk, lanes[1].risk, lanes[2].risk),
        lanes=Lanes(*lanes),
        detections=verdict.evidence.detections,
        explanation=advice.explanation,
    )
    return json_line(line).decode()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani look",
        description="Judge pictures, folders of pictures and videos as the boat would. Each still is judged alone, "
        "shown to the advisor eight times 0.1 s apart; a video is judged in sequence.",
    )
    parser.add_argument("paths", nargs="+", type=input_path(), metavar="PATH", help="picture, folder or video")
    parser.add_argument("--json", action="store_true", help="a JSON line per picture, no annotated pictures")
    parser.add_argument(
        "--out", type=output_folder("--out"), metavar="DIR", help="where annotated pictures go (default: runs/look)"
    )
    parser.add_argument(
        "--sheet",
        type=output_picture("--sheet"),
        metavar="FILE",
        help="a few dozen annotated pictures in one; alone, no --out",
    )
    add_config_arguments(parser)
    return parser


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out {folder}: {error.strerror}") from error


def _require_other_folder(out: Path, read: Iterable[Path]) -> None:
    """Raises UserError where an annotated picture could take the place of one that is read."""
    for file in read:
        if file.suffix == ANNOTATED_SUFFIX and file.resolve().parent == out.resolve():
            raise UserError(f"--out {out}: {file} is read from there, and would be lost")


def _save(file: Path, picture: object) -> None:
    _, data = cv2.imencode(file.suffix, picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    write_whole(file, data.tobytes(), "--out")


def _progress(text: str | None) -> None:
    if sys.stderr.isatty():
        sys.stderr.write("\r\x1b[K" + (text or ""))
        sys.stderr.flush()
