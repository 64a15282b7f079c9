"""Preprocessing, decoding, corridors, the colour fallback: each against numbers made by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from paani.config import CorridorConfig, DetectorConfig
from paani.messages import Label
from paani_services.perception.box_decoding import decode, suppress
from paani_services.perception.corridors import classify, shares, summarise
from paani_services.perception.fallback import colour_mask
from paani_services.perception.preprocess import Letterbox, letterbox, stretch, tables
from tests.pictures import river, solid

UNITY = tables((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
IMAGENET = tables((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))
SAME = Letterbox(1.0, 1.0, 0, 8, 320, 240)
RULES = DetectorConfig()


def output(*candidates: tuple[float, ...]) -> np.ndarray:
    """Raw detector output [1, 8, 1680] with these columns and nothing else."""
    raw = np.zeros((1, 8, 1680), np.float32)
    for i, column in enumerate(candidates):
        raw[0, :, i] = column
    return raw


def test_c3_letterbox() -> None:
    """C3: aspect kept, centred on grey, RGB, 1/255."""
    picture = solid(10, 20, 200)
    tensor, place = letterbox(picture, 256, 320, 114, UNITY)
    assert tensor.shape == (1, 3, 256, 320)
    assert tensor.dtype == np.float32
    assert place == Letterbox(1.0, 1.0, 0, 8, 320, 240)
    assert tensor[0, :, 128, 160] == pytest.approx([200 / 255, 20 / 255, 10 / 255])
    assert tensor[0, :, 0, 0] == pytest.approx([114 / 255] * 3)
    _, place = letterbox(np.zeros((480, 480, 3), np.uint8), 256, 320, 114, UNITY)
    assert (place.left_px, place.top_px) == (32, 0)


def test_d7_stretch() -> None:
    """D7, D8: the whole picture fills the input, ImageNet mean and deviation, RGB."""
    tensor = stretch(solid(10, 20, 200), 256, 320, IMAGENET)
    expected = [(200 / 255 - 0.485) / 0.229, (20 / 255 - 0.456) / 0.224, (10 / 255 - 0.406) / 0.225]
    assert tensor[0, :, 100, 100] == pytest.approx(expected, abs=1e-5)
    assert tensor.flags.c_contiguous


def test_resolution_3_a_box_corner_and_a_mask_column_meet() -> None:
    """Letterboxed boxes and stretched masks land on the same source pixel, within one."""
    picture = solid(0, 0, 0)
    picture[100:180, 120:200] = 255
    boxed, place = letterbox(picture, 256, 320, 114, UNITY)
    bright = np.argwhere(boxed[0, 0] > 0.9)
    (top, left), (bottom, right) = bright.min(axis=0), bright.max(axis=0) + 1
    raw = output(((left + right) / 2, (top + bottom) / 2, right - left, bottom - top, 0.9, 0, 0, 0))
    x1, y1, x2, y2 = decode(raw, place, RULES)[0].box_xyxy
    columns = np.argwhere(stretch(picture, 256, 320, UNITY)[0, 0] > 0.5)
    mask_y, mask_x = columns.min(axis=0) / (256, 320)
    assert (x1 * 320, y1 * 240, x2 * 320, y2 * 240) == pytest.approx((120, 100, 200, 180), abs=1.0)
    assert (mask_x * 320, mask_y * 240) == pytest.approx((x1 * 320, y1 * 240), abs=1.0)


def test_c5_non_finite_candidates_are_dropped() -> None:
    """C5."""
    good = (160.0, 128.0, 40.0, 40.0, 0.0, 0.9, 0.0, 0.0)
    bad = [(*good[:i], value, *good[i + 1 :]) for i in range(8) for value in (math.nan, math.inf, -math.inf)]
    found = decode(output(good, *bad), SAME, RULES)
    assert [d.label for d in found] == [Label.VESSEL]


@pytest.mark.parametrize(("score", "n"), [(0.40, 0), (0.4001, 1), (0.39, 0)])
def test_c6_threshold_is_exclusive(score: float, n: int) -> None:
    """C6: more than 0.40."""
    exact = DetectorConfig(confidence=float(np.float32(0.4)))
    assert len(decode(output((160, 128, 40, 40, score, 0, 0, 0)), SAME, exact)) == n


def test_c2_class_order() -> None:
    """C2: person, vessel, pier, buoy."""
    rows = [(40.0 + 70 * i, 128.0, 30.0, 30.0, *np.eye(4)[i] * 0.9) for i in range(4)]
    labels = {round(d.box_xyxy[0] * 320): d.label.value for d in decode(output(*rows), SAME, RULES)}
    assert labels == {25: "person", 95: "vessel", 165: "pier", 235: "buoy"}


def test_c8_suppression_ignores_the_class() -> None:
    """C8: IoU above 0.45 keeps the better box whatever its class."""
    boxes = np.array([[0, 0, 10, 10], [0, 3, 10, 13], [0, 4, 10, 14]], float).T  # IoU with the first .54, .43
    assert suppress(boxes, 0.45) == [0, 2]
    found = decode(output((100, 100, 40, 40, 0.8, 0, 0, 0), (102, 100, 40, 40, 0, 0.9, 0, 0)), SAME, RULES)
    assert [(d.label, round(d.confidence, 3)) for d in found] == [(Label.VESSEL, 0.9)]


def test_c7_c9_caps() -> None:
    """C7: 256 into suppression; C9: 24 out, the most confident first."""
    grid = [(8.0 * (i % 40), 8.0 * (i // 40) + 12, 6.0, 6.0, 0.41 + i / 2000, 0, 0, 0) for i in range(800)]
    found = decode(output(*grid), SAME, RULES)
    assert len(found) == 24
    assert [d.confidence for d in found] == sorted((d.confidence for d in found), reverse=True)
    stacked = [(160.0, 128.0, 40.0, 40.0, 0.9, 0, 0, 0)] * 300 + [(40.0, 128.0, 20.0, 20.0, 0.5, 0, 0, 0)]
    assert len(decode(output(*stacked), SAME, RULES)) == 1  # the 301st never reached suppression


def test_c10_boxes_are_cut_at_the_picture() -> None:
    """C10: normalised to the source; what lies in the grey bars is cut off, what lies in them whole is dropped."""
    found = decode(output((0, 8, 100, 100, 0.9, 0, 0, 0), (200, 3, 20, 6, 0.9, 0, 0, 0)), SAME, RULES)
    assert [d.box_xyxy for d in found] == [pytest.approx((0.0, 0.0, 50 / 320, 50 / 240))]


def test_e1_softmax() -> None:
    """E1: scores 2, 1, 0: p = e^2 / (e^2 + e + 1) = 0.6652; a temperature flattens it."""
    logits = np.zeros((1, 3, 256, 320), np.float32)
    logits[0, 0], logits[0, 1] = 2.0, 1.0
    mask, confidence = classify(logits, 1.0)
    assert mask.shape == (64, 80)
    assert mask.dtype == np.uint8
    assert mask.max() == 0
    assert confidence == pytest.approx(math.e**2 / (math.e**2 + math.e + 1.0), abs=1e-6)
    assert classify(logits, 2.0)[1] == pytest.approx(math.e / (math.e + math.e**0.5 + 1.0), abs=1e-6)


def test_every_fourth_score_says_everything() -> None:
    """D4: the paper's last step is a nearest resize by four, so argmax and confidence repeat exactly."""
    small = np.random.default_rng(0).normal(size=(1, 3, 64, 80)).astype(np.float32)
    large = small.repeat(4, axis=2).repeat(4, axis=3)
    mask, confidence = classify(large, 1.0)
    exponentials = np.exp(large[0] - large[0].max(axis=0))
    full = (exponentials / exponentials.sum(axis=0)).max(axis=0)
    assert np.array_equal(mask.repeat(4, 0).repeat(4, 1), large[0].argmax(axis=0))
    assert confidence.repeat(4, 0).repeat(4, 1) == pytest.approx(full, abs=1e-6)


def test_e2_e3_cells_on_a_border_count_in_part() -> None:
    """E2, E3: the shares of the cells add up to the exact size of the range."""
    assert shares(64, 0.30, 1.0).sum() / 64 == pytest.approx(0.70)
    assert shares(80, 0.31, 0.69).sum() / 80 == pytest.approx(0.38)
    assert shares(10, 0.25, 0.50) == pytest.approx([0, 0, 0.5, 1, 1, 0, 0, 0, 0, 0])


def test_e4_e5_e6_by_hand() -> None:
    """E4-E6: an obstacle in the right half, from the top of the region to the bottom."""
    mask = np.zeros((64, 80), np.uint8)
    mask[:, 40:] = 1
    confidence = np.full((64, 80), 0.9, np.float32)
    confidence[:, 40:] = 0.6
    lanes = summarise(mask, confidence, CorridorConfig())
    assert (lanes.left.non_water, lanes.right.non_water) == pytest.approx((0.0, 1.0))
    assert lanes.center.non_water == pytest.approx(0.5)
    assert lanes.center.uncertainty == pytest.approx(0.25, abs=1e-6)
    assert lanes.left.uncertainty == pytest.approx(0.1, abs=1e-6)
    assert (lanes.left.clear_width, lanes.center.clear_width, lanes.right.clear_width) == pytest.approx((1.0, 0.5, 0.0))


def test_e2_nothing_above_the_region_counts() -> None:
    mask = np.zeros((64, 80), np.uint8)
    mask[:19] = 2  # 0.297 of the height
    lanes = summarise(mask, np.ones((64, 80), np.float32), CorridorConfig())
    assert [lane.non_water for lane in lanes] == pytest.approx([0.0] * 3)


@pytest.mark.parametrize(("blocked_rows", "clear"), [(17, 1.0), (18, 0.0)])
def test_e6_a_column_is_clear_at_sixty_percent(blocked_rows: int, clear: float) -> None:
    """E6: of the region's 44.8 cell rows 40 % are 17.92."""
    mask = np.zeros((64, 80), np.uint8)
    mask[64 - blocked_rows :] = 1
    lanes = summarise(mask, np.ones((64, 80), np.float32), CorridorConfig())
    assert lanes.center.clear_width == pytest.approx(clear)


def test_e6_the_longest_run_counts() -> None:
    mask = np.zeros((64, 80), np.uint8)
    mask[:, 45] = 1  # centre corridor: columns 24.8 to 55.2
    lanes = summarise(mask, np.ones((64, 80), np.float32), CorridorConfig())
    assert lanes.center.clear_width == pytest.approx((45 - 24.8) / 30.4)


def test_f1_colours_draw_some_water() -> None:
    """F1: sky above, water below on a plain river; a red wall is neither."""
    mask = colour_mask(river())
    assert mask.shape == (64, 80)
    assert (mask[45:] == 0).mean() > 0.8
    assert (mask[:10] == 2).mean() > 0.8
    assert (colour_mask(solid(0, 0, 200)) == 1).mean() > 0.5
