"""Detector output to boxes, against numbers computed by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paani.config import DetectorConfig, load_config
from paani.messages import Label
from paani_services.perception.box_decoding import decode_boxes, suppress_overlaps
from paani_services.perception.preprocessing import (
    LetterboxTransform,
    build_lookup_tables,
    letterbox_picture,
    stretch_picture,
)
from tests.pictures import solid

UNITY = build_lookup_tables((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
SAME = LetterboxTransform(1.0, 1.0, 0, 8, 320, 240)
RULES = DetectorConfig()


def output(*candidates: tuple[float, ...]) -> np.ndarray:
    """Raw detector output [1, 8, 1680] with these columns and nothing else."""
    raw = np.zeros((1, 8, 1680), np.float32)
    for i, column in enumerate(candidates):
        raw[0, :, i] = column
    return raw


def test_a_box_corner_and_a_mask_column_meet_at_the_same_source_pixel() -> None:
    """Letterboxed boxes and stretched masks land on the same source pixel, within one."""
    picture = solid(0, 0, 0)
    picture[100:180, 120:200] = 255
    boxed, place = letterbox_picture(picture, 256, 320, 114, UNITY)
    bright = np.argwhere(boxed[0, 0] > 0.9)
    (top, left), (bottom, right) = bright.min(axis=0), bright.max(axis=0) + 1
    raw = output(((left + right) / 2, (top + bottom) / 2, right - left, bottom - top, 0.9, 0, 0, 0))
    x1, y1, x2, y2 = decode_boxes(raw, place, RULES)[0].box_xyxy
    columns = np.argwhere(stretch_picture(picture, 256, 320, UNITY)[0, 0] > 0.5)
    mask_y, mask_x = columns.min(axis=0) / (256, 320)
    assert (x1 * 320, y1 * 240, x2 * 320, y2 * 240) == pytest.approx((120, 100, 200, 180), abs=1.0)
    assert (mask_x * 320, mask_y * 240) == pytest.approx((x1 * 320, y1 * 240), abs=1.0)


def test_c5_non_finite_candidates_are_dropped() -> None:
    """C5."""
    good = (160.0, 128.0, 40.0, 40.0, 0.0, 0.9, 0.0, 0.0)
    bad = [(*good[:i], value, *good[i + 1 :]) for i in range(8) for value in (math.nan, math.inf, -math.inf)]
    found = decode_boxes(output(good, *bad), SAME, RULES)
    assert [d.label for d in found] == [Label.VESSEL]
    assert [decode_boxes(output(each), SAME, RULES) for each in bad] == [()] * len(bad), "each of them alone"


@pytest.mark.parametrize(("score", "n"), [(0.40, 0), (0.4001, 1), (0.39, 0)])
def test_c6_threshold_is_exclusive(score: float, n: int) -> None:
    """C6: more than 0.40."""
    exact = DetectorConfig(confidence=float(np.float32(RULES.confidence)))
    assert len(decode_boxes(output((160, 128, 40, 40, score, 0, 0, 0)), SAME, exact)) == n


def test_a_class_counts_above_its_own_threshold_and_the_others_above_the_common_one() -> None:
    """A person at 0.30 counts, and so does one that a vessel outdoes which is not sure enough to count itself."""
    config = DetectorConfig(person_confidence=0.25, buoy_confidence=0.6)
    columns = [
        (40, 128, 30, 30, 0.30, 0.0, 0.0, 0.0),
        (110, 128, 30, 30, 0.30, 0.35, 0.0, 0.0),
        (180, 128, 30, 30, 0.30, 0.45, 0.0, 0.0),
        (250, 128, 30, 30, 0.0, 0.0, 0.0, 0.55),
    ]
    found = decode_boxes(output(*columns), SAME, config)
    assert [(d.label, round(d.confidence, 2)) for d in found] == [
        (Label.VESSEL, 0.45),
        (Label.PERSON, 0.30),
        (Label.PERSON, 0.30),
    ]
    assert [d.label for d in decode_boxes(output(*columns), SAME, RULES)] == [Label.BUOY, Label.VESSEL]


def test_c2_class_order() -> None:
    """C2: person, vessel, pier, buoy."""
    rows = [(40.0 + 70 * i, 128.0, 30.0, 30.0, *np.eye(4)[i] * 0.9) for i in range(4)]
    labels = {round(d.box_xyxy[0] * 320): d.label.value for d in decode_boxes(output(*rows), SAME, RULES)}
    assert labels == {25: "person", 95: "vessel", 165: "pier", 235: "buoy"}


def test_c8_suppression_ignores_the_class() -> None:
    """C8: IoU above 0.45 keeps the better box whatever its class."""
    boxes = np.array([[0, 0, 10, 10], [0, 3, 10, 13], [0, 4, 10, 14]], float).T  # IoU with the first .54, .43
    assert suppress_overlaps(boxes, 0.45) == [0, 2]
    found = decode_boxes(output((100, 100, 40, 40, 0.8, 0, 0, 0), (102, 100, 40, 40, 0, 0.9, 0, 0)), SAME, RULES)
    assert [(d.label, round(d.confidence, 3)) for d in found] == [(Label.VESSEL, 0.9)]


def test_c7_c9_caps() -> None:
    """C7: 256 into suppression; C9: 24 out, the most confident first."""
    grid = [(8.0 * (i % 40), 8.0 * (i // 40) + 12, 6.0, 6.0, 0.41 + i / 2000, 0, 0, 0) for i in range(800)]
    found = decode_boxes(output(*grid), SAME, RULES)
    assert len(found) == 24
    assert [d.confidence for d in found] == sorted((d.confidence for d in found), reverse=True)
    stacked = [(160.0, 128.0, 40.0, 40.0, 0.9, 0, 0, 0)] * 300 + [(40.0, 128.0, 20.0, 20.0, 0.5, 0, 0, 0)]
    assert len(decode_boxes(output(*stacked), SAME, RULES)) == 1  # the 301st never reached suppression


def test_c10_boxes_are_cut_at_the_picture() -> None:
    """C10: normalised to the source; what lies in the grey bars is cut off, what lies in them whole is dropped."""
    found = decode_boxes(output((0, 8, 100, 100, 0.9, 0, 0, 0), (200, 3, 20, 6, 0.9, 0, 0, 0)), SAME, RULES)
    assert [d.box_xyxy for d in found] == [pytest.approx((0.0, 0.0, 50 / 320, 50 / 240))]
    beyond = decode_boxes(output((320, 248, 100, 100, 0.9, 0, 0, 0)), SAME, RULES)
    assert [d.box_xyxy for d in beyond] == [pytest.approx((270 / 320, 190 / 240, 1.0, 1.0))]


def test_c10_a_scaled_picture_between_bars_at_its_sides_gives_fractions_of_itself() -> None:
    """C10: 640 x 600 pixels at a scale of 0.4, with 32 pixels of bar on the left and 8 at the top."""
    transform = LetterboxTransform(0.4, 0.4, 32, 8, 640, 600)
    found = decode_boxes(output((32 + 0.4 * 320, 8 + 0.4 * 150, 0.4 * 64, 0.4 * 120, 0.9, 0, 0, 0)), transform, RULES)
    assert [d.box_xyxy for d in found] == [pytest.approx((288 / 640, 90 / 600, 352 / 640, 210 / 600))]


def test_c10_each_axis_has_its_own_scale() -> None:
    """C10: both sides of a picture are rounded to pixels of the input, each for itself."""
    transform = LetterboxTransform(0.5, 0.25, 0, 4, 200, 400)
    found = decode_boxes(output((50, 54, 20, 20, 0.9, 0, 0, 0)), transform, RULES)
    assert [d.box_xyxy for d in found] == [pytest.approx((80 / 200, 160 / 400, 120 / 200, 240 / 400))]


def test_c11_scores_are_of_the_classes_by_their_names() -> None:
    """C11: a detector of another maker has its classes in an order of its own, and some that nobody asked for."""
    column = (160.0, 128.0, 40.0, 40.0)
    for row, label in ((0, Label.BUOY), (1, None), (2, Label.PERSON)):
        scores = [0.9 if row == k else 0.0 for k in range(3)]
        found = decode_boxes(output((*column, *scores, 0.0))[:, :7], SAME, RULES, ("buoy", "car", "person"))
        assert [d.label for d in found] == [label] * (label is not None)


@pytest.mark.parametrize(("distinct", "n"), [(255, 2), (256, 1)])
def test_c7_the_best_256_are_suppressed(distinct: int, n: int) -> None:
    """C7: a box apart from the others is found as the 256th of the ranking, and not as the 257th."""
    stacked = [(160.0, 128.0, 40.0, 40.0, 0.9, 0, 0, 0)] * distinct + [(40.0, 128.0, 20.0, 20.0, 0.5, 0, 0, 0)]
    assert len(decode_boxes(output(*stacked), SAME, RULES)) == n


@pytest.mark.parametrize(("shift", "n"), [(15.0, 1), (15.4, 2)])
def test_c8_boxes_overlap_by_more_than_0_45(shift: float, n: int) -> None:
    """C8: boxes of width 40 with an IoU of 25 / 55 = 0.4545 and of 24.6 / 55.4 = 0.4440."""
    pair = ((100, 100, 40, 40, 0.8, 0, 0, 0), (100 + shift, 100, 40, 40, 0, 0.9, 0, 0))
    assert len(decode_boxes(output(*pair), SAME, RULES)) == n


@pytest.mark.parametrize("label", Label)
def test_c6_every_class_counts_from_the_common_threshold_on(label: Label) -> None:
    for rules in (RULES, load_config(profile="paper").perception.detections):
        assert rules.threshold(label) == 0.40


def test_c7_the_best_candidates_are_taken_wherever_they_stand() -> None:
    """256 weak ones stand before a vessel."""
    weak = [(8.0 + 4 * (i % 70), 20.0 + 40 * (i // 70), 3.0, 3.0, 0.41, 0, 0, 0) for i in range(256)]
    best = (40.0, 200.0, 20.0, 20.0, 0, 0.9, 0, 0)
    assert decode_boxes(output(*weak, best), SAME, RULES)[0].label is Label.VESSEL


def test_c8_overlap_is_of_the_union_of_boxes_of_any_size() -> None:
    """The second covers 0.46 of the first, the third 0.44, and the fourth lies diagonally apart."""
    boxes = np.array([[0, 0, 10, 10], [0, 0, 10, 4.6], [0, 0, 10, 4.4], [20, 20, 30, 30]], np.float64).T
    assert list(suppress_overlaps(boxes, 0.45)) == [0, 2, 3]
    assert list(suppress_overlaps(boxes[:, [0, 3]], 0.45)) == [0, 1]
