"""Small obstacles near the boat are counted as MODS counts them: half of a box by the mask, IoU 0.3 by a detector."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from paani.errors import UserError
from paani_models.datasets.sources import SOURCES, Sample
from paani_models.detector.metrics import Detections
from paani_models.report.small_obstacles import (
    above_thresholds,
    format_small_obstacles,
    is_small_and_near,
    measure_small_obstacles,
    see,
)

HEIGHT, WIDTH, SIDE = 300, 400, 12.0


def box(x: float, foot: float, side: float = SIDE) -> list[float]:
    return [x, foot - side, x + side, foot]


def boxes(*rows: list[float]) -> np.ndarray:
    return np.array(rows, np.float32).reshape(-1, 4)


def test_a_box_is_small_by_its_area_and_near_by_its_foot() -> None:
    limit = HEIGHT / 15
    given = boxes(
        box(10, 0.65 * HEIGHT), box(10, 0.65 * HEIGHT - 1), box(10, 290, limit), box(10, 290, limit - 0.1),
        [0, 200, 4 * limit, 200 + limit / 5],
    )  # fmt: skip
    assert is_small_and_near(given, HEIGHT).tolist() == [True, False, False, True, True]


def test_half_of_a_box_or_an_iou_of_a_third_sees_it() -> None:
    label = np.zeros((HEIGHT, WIDTH), np.uint8)
    label[:, :106] = 1  # half of the first, less of the second
    true = boxes(box(100, 250), box(101, 280), box(300, 250))
    found = boxes(box(300, 250 + 6), box(101, 280 + 7))  # IoU 1/3, and 5/19
    assert see(true, label, found).tolist() == [[True, False, True], [False, False, False], [False, True, True]]
    assert see(true, label, boxes()).tolist() == [[True, False, True], [False, False, False], [False, False, False]]


def test_a_box_counts_above_the_threshold_of_its_class() -> None:
    found = Detections(boxes(box(0, 20), box(9, 20)), np.array([0.01, 0.99], np.float32), np.array([0, 3]))
    assert above_thresholds(found).tolist() == [box(9, 20)]


def samples_of(folder: Path, *pictures: tuple[str, list[tuple[int, float, float]]]) -> list[Sample]:
    """Of each picture its sequence, and class, x and foot of its boxes [px]."""
    samples = []
    for number, (sequence, rows) in enumerate(pictures):
        picture, label = folder / f"{number}.png", folder / f"{number}.txt"
        cv2.imwrite(str(picture), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
        lines = (
            f"{kind} {(x + SIDE / 2) / WIDTH} {(foot - SIDE / 2) / HEIGHT} {SIDE / WIDTH} {SIDE / HEIGHT}"
            for kind, x, foot in rows
        )
        label.write_text("\n".join(lines))
        samples.append(Sample(SOURCES[0], sequence, True, picture, None, label))
    return samples


def test_each_class_has_its_share_and_an_interval_over_sequences(tmp_path: Path) -> None:
    samples = samples_of(
        tmp_path,
        ("a", [(0, 20, 250), (0, 200, 250), (1, 20, 280), (1, 20, 100)]),
        ("b", [(0, 20, 250)]),
        ("b", [(0, 20, 250)]),
        ("b", [(3, 20, 20)]),
    )

    def segment(picture: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        label = np.zeros(shape[:2], np.uint8)
        label[:, :50] = 1
        return label

    def find(picture: np.ndarray, confidence: float, limit: int) -> Detections:
        return Detections(boxes(box(200, 250)), np.array([0.9], np.float32), np.array([1]))

    rows = {row.kind: row for row in measure_small_obstacles(samples, segment, find)}
    people, vessels = rows["person"], rows["vessel"]
    assert (people.boxes, people.pictures, people.sequences) == (4, 3, 2)
    assert [each.value for each in people.recall.values()] == pytest.approx([3 / 4, 1 / 4, 1.0])
    assert (people.recall["mask"].low, people.recall["mask"].high) == (0.5, 1.0)
    assert (vessels.pictures, vessels.sequences) == (1, 1)
    assert (vessels.boxes, vessels.recall["mask"].value, vessels.recall["detector"].value) == (1, 1.0, 0.0)
    assert (rows["all"].boxes, rows["buoy"].boxes, rows["all"].recall["either"].value) == (5, 0, 1.0)
    text = format_small_obstacles(list(rows.values()))
    assert [line.split()[0] for line in text.splitlines()[2:]] == ["all", "person", "vessel"]
    with pytest.raises(UserError, match="no small obstacle"):
        measure_small_obstacles(samples[3:], segment, find)
