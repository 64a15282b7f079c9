"""The evaluators against cases worked by hand (U1 - U4, C5 - C9)."""

import numpy as np
import pytest

from paani_models.detector.metrics import (
    Detections,
    average_precision,
    class_figures,
    decode_boxes,
    iou_matrix,
    match_boxes,
)
from paani_models.segmenter.metrics import boundary_pixels, class_iou, confusion_matrix, count_edge_matches, f1_score

BOX = np.array([[0, 0, 10, 10]], np.float32)


def test_iou_ignores_255_u3() -> None:
    truth = np.array([[0, 0, 1, 255]], np.uint8)
    predicted = np.array([[0, 1, 1, 0]], np.uint8)
    iou = class_iou(confusion_matrix(predicted, truth, 3))
    assert iou[:2] == pytest.approx([1 / 2, 1 / 2])
    assert np.isnan(iou[2])


def test_boundary_is_four_connected_u4() -> None:
    mask = np.zeros((5, 5), np.uint8)
    mask[2, 2] = 1
    expected = np.zeros((5, 5), bool)
    expected[2, 1:4] = expected[1:4, 2] = True
    assert np.array_equal(boundary_pixels(mask), expected)


def test_ignored_pixels_make_no_boundary_u4() -> None:
    mask = np.array([[0, 0, 255, 1, 1]], np.uint8)
    assert not boundary_pixels(mask).any()


@pytest.mark.parametrize(("shift", "expected"), [(0, 1.0), (2, 1.0), (3, 0.5), (6, 0.0)])
def test_edge_f1_tolerates_two_pixels_u4(shift: int, expected: float) -> None:
    """A vertical edge is two pixels wide; moved by 3 only its nearer half is still within 2 px."""
    truth, predicted = np.zeros((8, 32), np.uint8), np.zeros((8, 32), np.uint8)
    truth[:, 12:] = 1
    predicted[:, 12 + shift :] = 1
    for ours, theirs in ((predicted, truth), (predicted.T, truth.T)):
        assert f1_score(*count_edge_matches(ours, theirs)) == pytest.approx(expected)


def test_u4_the_tolerance_is_euclidean() -> None:
    """The boundary of one pixel is a cross of five; of another, two to the right and two down, two are within 2 px."""
    truth, predicted = np.zeros((20, 20), np.uint8), np.zeros((20, 20), np.uint8)
    truth[8, 8], predicted[10, 10] = 1, 1
    assert count_edge_matches(predicted, truth) == (2, 5, 2, 5)


def test_u4_edge_f1_is_the_harmonic_mean_of_precision_and_recall() -> None:
    assert f1_score(1, 2, 1, 4) == pytest.approx(1 / 3)
    assert f1_score(0, 2, 0, 4) == 0.0


def test_u4_precision_is_of_the_predicted_edge_and_recall_of_the_true_one() -> None:
    """Per row two true edge pixels; of the predicted, three beside them and two far away."""
    truth, predicted = np.zeros((8, 32), np.uint8), np.zeros((8, 32), np.uint8)
    truth[:, 12:] = 1
    predicted[:, 12], predicted[:, 24:] = 1, 1
    assert count_edge_matches(predicted, truth) == (8 * 3, 8 * 5, 8 * 2, 8 * 2)


def test_average_precision_by_hand_u1() -> None:
    """Hit, miss, hit of two objects: precision 1 up to recall .5 (51 points), then 2/3 (50 points)."""
    scores = np.array([0.9, 0.8, 0.7], np.float32)
    hits = np.array([True, False, True])
    assert average_precision(scores, hits, 2) == pytest.approx((51 + 50 * 2 / 3) / 101)


def test_average_precision_of_half_the_objects_u1() -> None:
    assert average_precision(np.array([0.9], np.float32), np.array([True]), 2) == pytest.approx(51 / 101)
    assert average_precision(np.zeros(0, np.float32), np.zeros(0, bool), 2) == 0.0


def test_ap50_95_averages_the_iou_steps_u2() -> None:
    """IoU 0.8 passes the seven thresholds 0.50 .. 0.80."""
    found = Detections(np.array([[0, 0, 10, 8]], np.float32), np.array([0.9], np.float32), np.array([1]))
    truth = np.array([[1, 0, 0, 10, 10]], np.float32)
    figures = class_figures([found], [truth], kind=1)
    assert figures["ap50"] == pytest.approx(1.0)
    assert figures["ap50_95"] == pytest.approx(0.7)
    assert (figures["n"], figures["recall_at_0.40"], figures["precision_at_0.40"]) == (1, 1.0, 1.0)


@pytest.mark.slow
def test_a_second_box_on_the_same_object_is_a_false_alarm() -> None:
    twice = np.vstack([BOX, BOX])
    assert match_boxes(twice, np.array([0.5, 0.9], np.float32), BOX, 0.5).tolist() == [False, True]


def test_overlap_by_hand() -> None:
    assert iou_matrix(BOX, np.array([[5, 0, 15, 10]], np.float32))[0, 0] == pytest.approx(1 / 3)


def candidates(*rows: tuple[float, ...]) -> np.ndarray:
    return np.array(rows, np.float32).T


def test_decode_drops_what_is_not_finite_c5_and_not_above_the_threshold_c6() -> None:
    output = candidates(
        (50, 50, 20, 20, 0, 0.9, 0, 0),
        (np.nan, 50, 20, 20, 0, 0.9, 0, 0),
        (150, 50, 20, 20, 0.4, 0, 0, 0),
    )
    found = decode_boxes(output, confidence=0.40)
    np.testing.assert_allclose(found.boxes, [[40, 40, 60, 60]])
    assert found.classes.tolist() == [1]


def test_decode_suppresses_across_classes_c8_and_keeps_24_c9() -> None:
    pile = candidates((50, 50, 20, 20, 0, 0.9, 0, 0), (51, 50, 20, 20, 0, 0, 0, 0.8))
    assert decode_boxes(pile, 0.40).classes.tolist() == [1]
    row = candidates(*((10 * i, 50, 5, 5, 0.9, 0, 0, 0) for i in range(40)))
    assert len(decode_boxes(row, 0.40).boxes) == 24


def test_near_objects_are_counted_apart() -> None:
    """One object of 10 px is missed, one of 20 px is found: recall 1/2, near recall 1."""
    found = Detections(np.array([[100, 100, 120, 120]], np.float32), np.array([0.9], np.float32), np.array([0]))
    truth = np.array([[0, 0, 0, 10, 10], [0, 100, 100, 120, 120]], np.float32)
    figures = class_figures([found], [truth], kind=0)
    assert (figures["recall_at_0.40"], figures["recall_16px_at_0.40"]) == (0.5, 1.0)
    flat = np.array([[0, 0, 40, 50, 55.5]], np.float32)  # 15.5 px high
    unsure = Detections(np.array([[200, 0, 230, 30]], np.float32), np.array([0.4], np.float32), np.array([0]))
    more = class_figures([found, unsure], [np.vstack([truth, flat]), np.array([[0, 200, 0, 230, 30]], np.float32)], 0)
    assert (more["recall_at_0.40"], more["recall_16px_at_0.40"]) == (0.25, 0.5)


def test_a_class_without_a_case_has_no_figure() -> None:
    nothing = Detections(np.zeros((0, 4), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int64))
    figures = class_figures([nothing], [np.zeros((0, 5), np.float32)], kind=0)
    assert figures.pop("n") == 0
    assert all(np.isnan(value) for value in figures.values())
