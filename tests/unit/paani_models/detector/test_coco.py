"""Our average precision against an independent evaluator on random boxes (U1, U2)."""

from __future__ import annotations

import numpy as np
import pytest
from faster_coco_eval import COCO, COCOeval_faster
from hypothesis import given, settings
from hypothesis import strategies as st

from paani_models.detector.metrics import Detections, class_figures

pytestmark = pytest.mark.slow

SIDE = 200.0


def random_boxes(rng: np.random.Generator, n: int) -> np.ndarray:
    low = rng.uniform(0, SIDE * 0.7, (n, 2))
    return np.hstack([low, low + rng.uniform(2, SIDE * 0.3, (n, 2))]).astype(np.float32)


def random_case(seed: int, pictures: int) -> tuple[list[Detections], list[np.ndarray]]:
    """Truth of two classes; of what is found, some boxes are true ones moved a little, and some are anywhere."""
    rng = np.random.default_rng(seed)
    found, truths = [], []
    for _ in range(pictures):
        truth = random_boxes(rng, int(rng.integers(0, 7)))
        near = truth[rng.random(len(truth)) < 0.8]
        moved = near + rng.normal(0, 4, near.shape).astype(np.float32)
        ordered = np.sort(moved.reshape(-1, 2, 2), 1).reshape(-1, 4)
        boxes = np.vstack([ordered, random_boxes(rng, 3)]).astype(np.float32)
        scores = (rng.permutation(len(boxes) * 100)[: len(boxes)] / 1000).astype(np.float32)
        found.append(Detections(boxes, scores, rng.integers(0, 2, len(boxes))))
        kinds = rng.integers(0, 2, len(truth)).astype(np.float32)
        truths.append(np.hstack([kinds[:, None], truth]))
    return found, truths


def coco(found: list[Detections], truths: list[np.ndarray], kind: int) -> tuple[float, float]:
    """AP50:95 and AP50 by the other evaluator; -1 without a true box."""

    def rows(boxes: np.ndarray) -> list[list[float]]:
        wide = boxes.astype(np.float64)
        listed: list[list[float]] = np.hstack([wide[:, :2], wide[:, 2:] - wide[:, :2]]).tolist()
        return listed

    annotations, results = [], []
    for picture, (f, truth) in enumerate(zip(found, truths, strict=True), 1):
        mine = truth[truth[:, 0] == kind, 1:]
        annotations += [
            {"image_id": picture, "bbox": box, "area": box[2] * box[3], "category_id": 1, "iscrowd": 0}
            for box in rows(mine)
        ]
        chosen = f.classes == kind
        results += [
            {"image_id": picture, "bbox": box, "score": score, "category_id": 1}
            for box, score in zip(rows(f.boxes[chosen]), f.scores[chosen].tolist(), strict=True)
        ]
    truth_set = COCO(
        {
            "images": [{"id": i, "width": SIDE, "height": SIDE} for i in range(1, len(found) + 1)],
            "categories": [{"id": 1, "name": "one"}],
            "annotations": [{"id": i, **row} for i, row in enumerate(annotations, 1)],
        }
    )
    evaluator = COCOeval_faster(truth_set, truth_set.loadRes(results), "bbox")
    evaluator.evaluate()
    evaluator.accumulate()
    precision = evaluator.eval["precision"][:, :, 0, 0, -1]
    return float(precision.mean()), float(precision[0].mean())


@given(st.integers(0, 2**31), st.integers(1, 12))
@settings(max_examples=60, deadline=None)
def test_average_precision_equals_the_coco_evaluators_u1_u2(seed: int, pictures: int) -> None:
    found, truths = random_case(seed, pictures)
    for kind in (0, 1):
        figures = class_figures(found, truths, kind)
        if figures["n"] == 0 or not any((f.classes == kind).any() for f in found):
            continue
        assert (figures["ap50_95"], figures["ap50"]) == pytest.approx(coco(found, truths, kind), abs=1e-6)


def test_a_box_exactly_at_the_threshold_hits_u2() -> None:
    """IoU 1/2 and 4/5 without rounding: seven and one of the ten thresholds."""
    truth = [np.array([[0, 0, 0, 10, 10]], np.float32)]
    for height, expected in ((5, 0.1), (8, 0.7)):
        box = np.array([[0, 0, 10, height]], np.float32)
        found = [Detections(box, np.array([0.9], np.float32), np.array([0]))]
        assert class_figures(found, truth, 0)["ap50_95"] == pytest.approx(expected)
        assert coco(found, truth, 0)[0] == pytest.approx(expected)
