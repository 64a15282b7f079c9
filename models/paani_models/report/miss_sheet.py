"""One page of a detector's misses and false alarms, cut out of the user's own pictures; no part of the product.

The pictures are inside the page, so that it moves and is deleted as one file.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import groupby
from pathlib import Path

import cv2
import numpy as np

from paani.arrays import F32, U8, Bools
from paani.errors import UserError
from paani_models.datasets.sources import DETECTOR_CLASSES, read_picture
from paani_models.detector.metrics import iou_matrix, match_boxes
from paani_models.report.height_scores import MATCH_IOU, DetectorRun, PictureResult, Threshold, common_threshold

MAX_PER_GROUP = 24  # of each class, source and kind of mistake
CONTEXT = 1.0  # of the box's longer side, around it on each side
MIN_CUT_PX, CUT_HEIGHT_PX = 48, 140
_TRUE_BGR, _FOUND_BGR = (120, 200, 0), (0, 140, 255)
_STYLE = (
    "body{font:14px sans-serif;margin:1.5em;max-width:80em}img{display:block;height:140px}"
    "figure{display:inline-block;width:min-content;min-width:140px;margin:.3em .6em .6em 0;vertical-align:top}"
    "figcaption{font-size:12px;overflow-wrap:anywhere}"
)


@dataclass(frozen=True)
class Mistake:
    """A true box that was missed, or a box of an annotated class that is none (`score` above 0)."""

    picture: Path
    source: str
    kind: str
    box: F32
    score: float
    seen_by: tuple[str, ...]

    @property
    def is_miss(self) -> bool:
        """Whether nothing was found, rather than something that is not there."""
        return self.score == 0.0


def refuse_inside_repository(path: Path, option: str) -> None:
    """Raises UserError naming an option whose file would lie in a repository, as it holds pictures of the data."""
    folder = path.resolve().parent
    repository = next((each for each in (folder, *folder.parents) if (each / ".git").exists()), None)
    if repository is not None:
        raise UserError(f"{option}: {path} is inside the repository {repository}; the sheet holds pictures")


def find_mistakes(
    results: Sequence[PictureResult],
    name: str,
    detectors: Sequence[DetectorRun],
    threshold: Threshold = common_threshold,
) -> list[Mistake]:
    """Mistakes of one detector above the threshold and at IoU 0.5, with the others that made the same (or did not).

    For a miss `seen_by` are the detectors that found the object, for a false alarm those that raised it too.
    """
    others = [each for each in detectors if each.name != name]
    return [mistake for result in results for mistake in _mistakes_in(result, name, others, threshold)]


def _mistakes_in(
    result: PictureResult, name: str, others: Sequence[DetectorRun], threshold: Threshold
) -> list[Mistake]:
    mistakes = []
    for kind, label in enumerate(DETECTOR_CLASSES):
        if label not in result.sample.source.annotated:
            continue
        real = result.truth[result.truth[:, 0] == kind, 1:]
        boxes, scores, missed = _judge(result, name, kind, real, threshold(label))
        theirs = {
            each.name: _judge(result, each.name, kind, real, threshold(label)) for each in others if label in each.known
        }
        place = (result.sample.picture, result.sample.source.name, label)
        for index in np.flatnonzero(missed):
            seen = tuple(who for who, (_, _, lost) in theirs.items() if not lost[index])
            mistakes.append(Mistake(*place, real[index], 0.0, seen))
        for index in np.flatnonzero(~match_boxes(boxes, scores, real, MATCH_IOU)):
            same = tuple(
                who
                for who, (other, *_) in theirs.items()
                if iou_matrix(boxes[index : index + 1], other).max(initial=0.0) >= MATCH_IOU
            )
            mistakes.append(Mistake(*place, boxes[index], float(scores[index]), same))
    return mistakes


def _judge(result: PictureResult, name: str, kind: int, real: F32, threshold: float) -> tuple[F32, F32, Bools]:
    """Confident boxes and scores of a class, and which of the true boxes they miss."""
    found = result.found[name]
    mine = (found.classes == kind) & (found.scores > threshold)
    boxes, scores = found.boxes[mine], found.scores[mine]
    missed = np.ones(len(real), np.bool_)
    shared = iou_matrix(boxes, real)
    for row in shared[np.argsort(-scores, kind="stable")]:
        open_rows = np.where(missed, row, 0.0)
        if open_rows.max(initial=0.0) >= MATCH_IOU:
            missed[int(open_rows.argmax())] = False
    return boxes, scores, missed


def render_sheet(title: str, mistakes: Sequence[Mistake]) -> str:
    """The page. Tallest misses and surest false alarms first, MAX_PER_GROUP of each; all are counted."""
    parts = [f"<!doctype html><meta charset=utf-8><title>{escape(title)}</title><style>{_STYLE}</style>"]
    parts.append(
        f"<h1>{escape(title)}</h1><p>Green: a true box that was missed. Orange: a box that is none, with its "
        "score. Drawn from your own data folder; do not pass it on without the pictures' terms.</p>"
    )
    place = DETECTOR_CLASSES.index
    order = sorted(mistakes, key=lambda m: (place(m.kind), m.source, not m.is_miss, -_urgency(m)))
    for (kind, source, is_miss), group in groupby(order, lambda m: (m.kind, m.source, m.is_miss)):
        items = list(group)
        what = "missed" if is_miss else "false alarm" if len(items) == 1 else "false alarms"
        some = f", {MAX_PER_GROUP} shown" if len(items) > MAX_PER_GROUP else ""
        parts.append(f"<h2>{escape(kind)}, {escape(source)}: {len(items)} {what}{some}</h2>")
        parts += [_figure(item) for item in items[:MAX_PER_GROUP]]
    return "\n".join(parts) + "\n"


def _urgency(mistake: Mistake) -> float:
    return float(mistake.box[3] - mistake.box[1]) if mistake.is_miss else mistake.score


def _figure(mistake: Mistake) -> str:
    cut = _cut_out(read_picture(mistake.picture), mistake)
    written, data = cv2.imencode(".jpg", cut, (cv2.IMWRITE_JPEG_QUALITY, 85))
    assert written
    measure = f"{_urgency(mistake):.0f} px high" if mistake.is_miss else f"{mistake.score:.2f}"
    others = (
        f"; {'found' if mistake.is_miss else 'raised too'} by {', '.join(mistake.seen_by)}" if mistake.seen_by else ""
    )
    encoded = base64.b64encode(data.tobytes()).decode()
    return (
        f'<figure><img src="data:image/jpeg;base64,{encoded}" alt="{escape(mistake.kind)}">'
        f"<figcaption>{escape(mistake.picture.name)}: {measure}{escape(others)}</figcaption></figure>"
    )


def _cut_out(picture: U8, mistake: Mistake) -> U8:
    """BGR, the box with its surroundings, drawn."""
    height, width = picture.shape[:2]
    low, high = mistake.box[:2], mistake.box[2:]
    half = max(float((high - low).max()) * (0.5 + CONTEXT), MIN_CUT_PX / 2)
    x, y = (low + high) / 2
    left, top = int(max(0, x - half)), int(max(0, y - half))
    right, bottom = int(min(width, x + half)) or 1, int(min(height, y + half)) or 1
    scale = CUT_HEIGHT_PX / (bottom - top)
    cut = cv2.resize(picture[top:bottom, left:right, ::-1], None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    corners = ((mistake.box - np.array([left, top, left, top])) * scale).round().astype(int).tolist()
    drawn = np.ascontiguousarray(cut)
    cv2.rectangle(drawn, corners[:2], corners[2:], _TRUE_BGR if mistake.is_miss else _FOUND_BGR, 1)
    return np.asarray(drawn, np.uint8)
