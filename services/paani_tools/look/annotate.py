"""Draws what was seen and advised onto the picture. Pure: arrays in, array out."""

import cv2
import numpy as np

from paani.arrays import U8
from paani.config import CorridorConfig
from paani.messages import Advisory, Detection, Direction, Evidence, LaneRisk

Colour = tuple[int, int, int]

WIDTH_PX, BANNER_PX, LINE_PX, MARGIN_PX = 800, 142, 24, 14
MAX_HEIGHT_PX = 8000  # nobody looks at more, and no JPEG is higher than 65,535
TEXT_SCALE = 0.6
TINTS = np.array([(230, 200, 40), (40, 140, 255), (120, 50, 20)], np.float32)  # BGR: water, obstacle, sky
TINT_SHARE = 0.32
INK, PAPER = (245, 245, 245), (28, 24, 22)
FREE, BLOCKED, BOX = (120, 220, 90), (70, 70, 245), (60, 220, 255)
FONT = cv2.FONT_HERSHEY_SIMPLEX
ADVICE_COLOURS = {Direction.STRAIGHT: FREE, Direction.STOP: BLOCKED, Direction.NO_DATA: BLOCKED}


def annotate_picture(bgr: U8, mask: U8 | None, evidence: Evidence, advisory: Advisory, corridors: CorridorConfig) -> U8:
    """The picture, 800 px wide and at most 8000 high, with mask tint, corridors, boxes, and the advice below it.

    bgr: uint8 [H, W, 3]. mask: uint8 classes (0 water, 1 obstacle, 2 sky) of any size, or None.
    """
    height_px = min(max(1, round(bgr.shape[0] * WIDTH_PX / bgr.shape[1])), MAX_HEIGHT_PX)
    canvas = np.asarray(cv2.resize(bgr, (WIDTH_PX, height_px), interpolation=cv2.INTER_LINEAR), np.uint8)
    if mask is not None:
        classes = cv2.resize(mask, (WIDTH_PX, height_px), interpolation=cv2.INTER_NEAREST)
        canvas = np.asarray(canvas * (1.0 - TINT_SHARE) + TINTS[classes] * TINT_SHARE, np.uint8)
    lanes = (
        []
        if mask is None
        else [(corridors.left, advisory.left), (corridors.right, advisory.right), (corridors.center, advisory.center)]
    )
    for span, lane in lanes:
        _corridor(canvas, span, corridors.top, lane, span == corridors.center)
    for detection in evidence.detections:
        _box(canvas, detection)
    for span, lane in lanes:
        text = f"{lane.risk:.2f}" + (" occupied" if lane.occupied else "")
        middle = round((span[0] + span[1]) / 2 * WIDTH_PX)
        _label(canvas, text, (middle, height_px - 14), 0.62, _lane_colour(lane), centred=True)
    return np.vstack((canvas, _banner(evidence, advisory)))


def _corridor(canvas: U8, span: tuple[float, float], top: float, lane: LaneRisk, inner: bool) -> None:
    height, width = canvas.shape[:2]
    inset = 4 if inner else 0  # so that overlapping corridors stay apart
    corners = (round(span[0] * width), round(top * height) + inset), (round(span[1] * width), height - 2 - inset)
    cv2.rectangle(canvas, *corners, _lane_colour(lane), 2 if inner else 1, cv2.LINE_AA)


def _lane_colour(lane: LaneRisk) -> Colour:
    return BLOCKED if lane.blocked else FREE


def _box(canvas: U8, detection: Detection) -> None:
    height, width = canvas.shape[:2]
    x1, y1, x2, y2 = detection.box_xyxy
    left, top, right, bottom = round(x1 * width), round(y1 * height), round(x2 * width), round(y2 * height)
    cv2.rectangle(canvas, (left, top), (right, bottom), BOX, 2, cv2.LINE_AA)
    _label(canvas, f"{detection.label} {detection.confidence:.2f}", (left, max(top - 5, 15)), 0.5, BOX)


def _label(
    canvas: U8, text: str, at_px: tuple[int, int], scale: float, colour: Colour, *, centred: bool = False
) -> None:
    """Text on a dark plate, kept inside the picture."""
    (width, height), base = cv2.getTextSize(text, FONT, scale, 1)
    left = at_px[0] - (width // 2 if centred else 0)
    left = min(max(left, 2), canvas.shape[1] - width - 2)
    cv2.rectangle(canvas, (left - 2, at_px[1] - height - 3), (left + width + 2, at_px[1] + base), PAPER, -1)
    cv2.putText(canvas, text, (left, at_px[1]), FONT, scale, colour, 1, cv2.LINE_AA)


def _banner(evidence: Evidence, advisory: Advisory) -> U8:
    banner = np.full((BANNER_PX, WIDTH_PX, 3), PAPER, np.uint8)
    colour = ADVICE_COLOURS.get(advisory.direction, BOX)
    cv2.putText(banner, advisory.direction.replace("_", " "), (MARGIN_PX, 46), FONT, 1.35, colour, 3, cv2.LINE_AA)
    reason = advisory.reason.replace("_", " ")
    if not evidence.usable:
        reason += f" ({evidence.cause.replace('_', ' ')})"
    (width, _), _ = cv2.getTextSize(reason, FONT, 0.7, 1)
    cv2.putText(banner, reason, (WIDTH_PX - width - MARGIN_PX, 40), FONT, 0.7, INK, 1, cv2.LINE_AA)
    for i, line in enumerate(wrap_text(advisory.explanation, TEXT_SCALE, WIDTH_PX - 2 * MARGIN_PX)[:3]):
        cv2.putText(banner, line, (MARGIN_PX, 80 + i * LINE_PX), FONT, TEXT_SCALE, INK, 1, cv2.LINE_AA)
    return banner


def wrap_text(text: str, scale: float, width_px: int) -> list[str]:
    """Lines of whole words, none drawn wider than `width_px` unless a single word is."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        (drawn_px, _), _ = cv2.getTextSize(longer, FONT, scale, 1)
        if lines and drawn_px <= width_px:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines
