"""Labels over the picture, in the engine that draws them: none hides another, as far as there is room."""

from __future__ import annotations

import json
from typing import Any

import pytest

pytestmark = [pytest.mark.browser, pytest.mark.timeout(60)]

DRAW = """async (tracks) => {
  const { drawBoxes } = await import("/static/overlay.js");
  const ctx = new OffscreenCanvas(400, 300).getContext("2d"), drawn = [];
  const fillRect = ctx.fillRect.bind(ctx);
  ctx.fillRect = (x, y, width, height) => { drawn.push([x, y, width, height]); fillRect(x, y, width, height); };
  let leaders = 0;
  ctx.lineTo = () => { leaders++; };
  drawBoxes({ ctx, width: 400, height: 300, unit: 1 }, { detections: [] }, { tracks });
  return [drawn, leaders];
}"""

CORRIDORS = {"left": [0.03, 0.39], "center": [0.31, 0.69], "right": [0.61, 0.97], "top": 0.3}
ADVISORY = {"left": {"risk": 0.8, "blocked": True}, "center": {"risk": 0.8, "blocked": True}, "right": {"risk": 0.25}}
DRAW_CORRIDORS = f"""async ([width, advisory]) => {{
  const {{ drawCorridors }} = await import("/static/overlay.js"), texts = [], boxes = [];
  const ctx = new OffscreenCanvas(width, 180).getContext("2d");
  ctx.fillText = (text) => texts.push(text);
  ctx.fillRect = (...box) => ctx.fillStyle instanceof CanvasGradient || boxes.push(box);
  drawCorridors({{ ctx, width, height: 180, unit: 1 }}, {json.dumps(CORRIDORS)}, advisory ?? undefined);
  return [texts, boxes];
}}"""


def track(number: int, left: float, top: float) -> dict[str, Any]:
    return {
        "id": number, "label": "buoy", "confidence": 0.5, "accepted": True, "held": False, "immediate_danger": False,
        "box_xyxy": [left, top, left + 0.05, top + 0.05],
    }  # fmt: skip


def overlaps(first: list[float], second: list[float]) -> bool:
    return all(
        first[axis] < second[axis] + second[axis + 2] and second[axis] < first[axis] + first[axis + 2]
        for axis in (0, 1)
    )


async def test_no_label_hides_another(scripts_page: Any) -> None:
    for places in (
        [(0.2, 0.5), (0.6, 0.5)],
        [(0.2, 0.5), (0.25, 0.5), (0.3, 0.52), (0.28, 0.48)],
        [(0.2, 0.02), (0.25, 0.02)],
    ):
        drawn, leaders = await scripts_page.evaluate(
            DRAW, [track(number, *place) for number, place in enumerate(places)]
        )
        above_or_in = sum(
            abs(top - 300 * place[1] + 8) < 12 for (_, top, _, _), place in zip(drawn, places, strict=True)
        )
        assert leaders == len(places) - above_or_in, "a label that stands elsewhere is joined to its box"
        assert len(drawn) == len(places)
        assert not any(overlaps(a, b) for index, a in enumerate(drawn) for b in drawn[:index]), drawn
        assert all(0 <= x <= 400 - width and 0 <= y <= 300 - height for x, y, width, height in drawn)


async def test_a_label_with_room_stands_above_its_box(scripts_page: Any) -> None:
    ((_, top, _, height),), leaders = await scripts_page.evaluate(DRAW, [track(1, 0.2, 0.5)])
    assert leaders == 0
    assert top + height <= 150


async def test_no_corridors_label_hides_anothers(scripts_page: Any) -> None:
    for width, words in ((600, ["0.80 blocked", "0.80 blocked", "0.25 clear"]), (240, ["0.80", "0.80", "0.25"])):
        texts, boxes = await scripts_page.evaluate(DRAW_CORRIDORS, [width, ADVISORY])
        assert texts == words
        assert not any(overlaps(a, b) for index, a in enumerate(boxes) for b in boxes[:index]), boxes


async def test_corridors_without_a_verdict_have_their_names(scripts_page: Any) -> None:
    assert (await scripts_page.evaluate(DRAW_CORRIDORS, [600, None]))[0] == ["left", "centre", "right"]
