"""Draw the best and the worst pictures with predictions and truth. They go beside the page and nowhere else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from paani.arrays import U8
from paani.errors import UserError
from paani_models.datasets.sources import DETECTOR_CLASSES, IGNORE, RENDERED, read_picture
from paani_models.detector.metrics import CONFIDENCE
from paani_models.detector.scores import ScoredBoxes
from paani_models.network_input import SIZE_WH, letterbox_picture
from paani_models.segmenter.scores import OBSTACLE, SKY, WATER, ScoredMask, merge_undrawn_sky, read_truth

ScoredPicture = TypeVar("ScoredPicture", ScoredMask, ScoredBoxes)

MAX_PICTURES = 8
PICTURES = "pictures"
_WATER_RGB, _OBSTACLE_RGB, _SKY_RGB, _WRONG_RGB = (0, 114, 178), (230, 159, 0), (204, 121, 167), (220, 0, 0)
_TRUE_RGB, _FOUND_RGB = (0, 200, 120), (255, 140, 0)
_WIDTH_PX = 560


@dataclass(frozen=True)
class DrawnPicture:
    """A picture file beside the page, and its caption."""

    file: str
    caption: str


def draw_masks(
    folder: Path, scored: Sequence[ScoredMask], segment: Callable[[U8, tuple[int, ...]], U8]
) -> list[DrawnPicture]:
    """Draw masks tinted by class, pixels that differ from the truth in red. Writes into `folder`/pictures."""
    drawn = []
    for index, item in enumerate(scored):
        picture, truth = read_picture(item.sample.picture), read_truth(item.sample)
        picture = np.asarray(cv2.resize(picture, (truth.shape[1], truth.shape[0])), np.uint8)
        label = merge_undrawn_sky(segment(picture, truth.shape), item.sample.source)
        tint = np.zeros_like(picture)
        for kind, colour in ((WATER, _WATER_RGB), (OBSTACLE, _OBSTACLE_RGB), (SKY, _SKY_RGB)):
            tint[label == kind] = colour
        overlay = cv2.addWeighted(picture, 0.65, tint, 0.35, 0)
        wrong = (label != truth) & (truth != IGNORE)
        overlay[wrong] = (0.4 * overlay[wrong] + 0.6 * np.array(_WRONG_RGB)).astype(np.uint8)
        caption = f"{item.sample.source.name}, {item.sample.picture.name}: {item.mean_iou:.3f}"
        drawn.append(_save_picture(folder, f"mask_{index:02}_{item.sample.picture.stem}", overlay, caption))
    return drawn


def draw_boxes(folder: Path, scored: Sequence[ScoredBoxes]) -> list[DrawnPicture]:
    """Draw boxes on letterboxed pictures: true boxes thin green, found boxes thick orange with class and score."""
    drawn = []
    for index, item in enumerate(scored):
        overlay = np.repeat(np.repeat(letterbox_picture(read_picture(item.sample.picture), SIZE_WH), 2, 0), 2, 1)
        for kind, *corners in item.truth:
            _draw_rectangle(overlay, np.array(corners), _TRUE_RGB, 1, DETECTOR_CLASSES[int(kind)], below=True)
        confident = item.detections.scores > CONFIDENCE
        for box, score, kind in zip(
            item.detections.boxes[confident],
            item.detections.scores[confident],
            item.detections.classes[confident],
            strict=True,
        ):
            _draw_rectangle(overlay, box, _FOUND_RGB, 2, f"{DETECTOR_CLASSES[int(kind)]} {score:.2f}", below=False)
        mistakes = f"{item.mistakes} mistake{'' if item.mistakes == 1 else 's'}"
        caption = f"{item.sample.source.name}, {item.sample.picture.name}: {mistakes}"
        drawn.append(_save_picture(folder, f"boxes_{index:02}_{item.sample.picture.stem}", overlay, caption))
    return drawn


def choose_extreme_masks(scored: Sequence[ScoredMask]) -> tuple[list[ScoredMask], list[ScoredMask]]:
    """Choose the worst and the best photographs, at most two of a sequence; rendered ones where there is no other."""
    scored = _photographs(scored)
    ordered = sorted(scored, key=lambda item: (item.mean_iou, str(item.sample.picture)))
    return _limit_per_sequence(ordered), _limit_per_sequence(ordered[::-1])


def choose_extreme_boxes(scored: Sequence[ScoredBoxes]) -> tuple[list[ScoredBoxes], list[ScoredBoxes]]:
    """Choose most mistakes first; and without mistakes, most objects first; otherwise as `choose_extreme_masks`."""
    scored = _photographs(scored)
    ordered = sorted(scored, key=lambda item: (-item.mistakes, str(item.sample.picture)))
    right = [item for item in scored if item.mistakes == 0]
    return _limit_per_sequence(ordered), _limit_per_sequence(
        sorted(right, key=lambda item: (-len(item.truth), str(item.sample.picture)))
    )


def render_gallery(drawn: Sequence[DrawnPicture]) -> str:
    """Render pictures with captions as HTML figures."""
    return (
        '<div class="gallery">'
        + "".join(
            f'<figure><a href="{escape(each.file)}">'
            f'<img loading="lazy" src="{escape(each.file)}" alt="{escape(each.caption)}"></a>'
            f"<figcaption>{escape(each.caption)}</figcaption></figure>"
            for each in drawn
        )
        + "</div>"
    )


def _photographs(scored: Sequence[ScoredPicture]) -> Sequence[ScoredPicture]:
    return [item for item in scored if item.sample.source.name != RENDERED] or scored


def _limit_per_sequence(ordered: Sequence[ScoredPicture]) -> list[ScoredPicture]:
    counts: dict[tuple[str, str], int] = {}
    kept: list[ScoredPicture] = []
    for item in ordered:
        key = (item.sample.source.name, item.sample.sequence)
        counts[key] = counts.get(key, 0) + 1
        if counts[key] <= 2 and len(kept) < MAX_PICTURES:
            kept.append(item)
    return kept


def _draw_rectangle(
    picture: U8, box: NDArray[np.float32], colour: tuple[int, int, int], width: int, text: str, *, below: bool
) -> None:
    x1, y1, x2, y2 = (round(2 * float(value)) for value in box)
    cv2.rectangle(picture, (x1, y1), (x2, y2), colour, width)
    spot = (x1, min(picture.shape[0] - 4, y2 + 18) if below else max(14, y1 - 5))
    cv2.putText(picture, text, spot, cv2.FONT_HERSHEY_SIMPLEX, 0.6, (0, 0, 0), 3, cv2.LINE_AA)
    cv2.putText(picture, text, spot, cv2.FONT_HERSHEY_SIMPLEX, 0.6, colour, 1, cv2.LINE_AA)


def _save_picture(folder: Path, stem: str, rgb: U8, caption: str) -> DrawnPicture:
    scale = _WIDTH_PX / rgb.shape[1]
    overlay = cv2.resize(rgb, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    name = f"{PICTURES}/{stem}.jpg"
    (folder / PICTURES).mkdir(exist_ok=True)
    if not cv2.imwrite(str(folder / name), cv2.cvtColor(overlay, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 85]):
        raise UserError(f"{folder / name}: cannot be written")
    return DrawnPicture(name, caption)
