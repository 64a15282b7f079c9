"""The temperature that makes a mask's confidence true is found, and each sequence is judged by the others' fit."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from paani_models.datasets.sources import IGNORE, Sample, Source
from paani_models.report import mask_calibration
from paani_models.report.mask_calibration import (
    AS_IT_IS,
    TEMPERATURES,
    calibrate,
    count_cells,
    format_mask_calibration,
)

OVERCONFIDENCE = 2.0


def picture(seed: int, overconfidence: float = OVERCONFIDENCE) -> tuple[np.ndarray, np.ndarray]:
    """Logits, and classes drawn by the probabilities that these have at this temperature."""
    rng = np.random.default_rng(seed)
    logits = (overconfidence * rng.normal(0.0, 2.0, (1, 3, 64, 80))).astype(np.float32)
    chances = np.exp(logits[0] / overconfidence)
    below = np.cumsum(chances / chances.sum(0), axis=0)
    return logits, (rng.random((64, 80)) > below).sum(0).astype(np.uint8).clip(0, 2)


@pytest.mark.slow
def test_the_temperature_is_found_and_lowers_the_error() -> None:
    counted = [count_cells(*picture(seed)) for seed in range(4)]
    found = calibrate(np.array([c.loss for c in counted]), np.array([c.bins for c in counted]), pictures=4)
    assert found.temperature == pytest.approx(OVERCONFIDENCE, rel=0.08)
    assert 0.08 < found.before.value < 0.15
    assert found.before.low > found.after.high
    assert found.after.value < 0.02
    assert (found.sequences, found.pictures, found.cells) == (4, 4, 4 * 64 * 80)
    assert format_mask_calibration(found).startswith(f"perception.temperature = {found.temperature:g}: ")


@pytest.mark.slow
def test_a_sequence_is_judged_by_what_the_other_half_asks_for() -> None:
    """Two sequences that ask for different temperatures: each at the other's is worse than as it is."""
    counted = [count_cells(*picture(1, 2.0)), count_cells(*picture(2, 0.5))]
    loss, bins = np.array([c.loss for c in counted]), np.array([c.bins for c in counted])
    assert TEMPERATURES[loss.argmin(1)] == pytest.approx([2.0, 0.5], rel=0.15)
    assert calibrate(loss, bins, pictures=2).after.value > calibrate(loss, bins, pictures=2).before.value


def test_counts_are_those_of_a_picture_by_hand() -> None:
    """Two cells are judged, one is right, at a confidence of 0.8; what is ignored is none."""
    logits = np.log(np.array([0.8, 0.1, 0.1], np.float32))[None, :, None, None].repeat(3, 3)
    counted = count_cells(logits, np.array([[0, 1, IGNORE]], np.uint8))
    assert counted.loss[AS_IT_IS] == pytest.approx(-np.log(0.8) - np.log(0.1), rel=1e-5)
    assert counted.bins[AS_IT_IS].sum(0) == pytest.approx([2.0, 1.6, 1.0], rel=1e-5)
    large = np.zeros((1, 3, 256, 320), np.float32)
    assert count_cells(large, np.zeros((480, 640), np.uint8)).bins[0, :, 0].sum() == 64 * 80


@pytest.mark.slow
def test_z1_the_error_before_and_after_is_told_in_this_order() -> None:
    cells = [count_cells(*picture(seed)) for seed in range(2)]
    found = calibrate(np.array([each.loss for each in cells]), np.array([each.bins for each in cells]), pictures=2)
    _, before, after = format_mask_calibration(found).splitlines()
    assert f"{found.before.value:.4f}" in before
    assert f"{found.after.value:.4f}" in after


@pytest.mark.slow
def test_z1_every_picture_of_a_sequence_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    cells = [count_cells(*picture(seed)) for seed in range(4)]
    source = Source("river", "river", masks="masks")
    samples = [Sample(source, sequence, True, Path("a.jpg"), Path("a.png"), None) for sequence in "aabb"]
    monkeypatch.setattr(mask_calibration, "score_batches", lambda *_: cells)
    found = mask_calibration.measure_mask_calibration(Path("net"), samples)
    assert (found.cells, found.pictures, found.sequences) == (4 * 64 * 80, 4, 2)


def test_z1_a_mask_that_is_made_smaller_has_no_class_between_two() -> None:
    truth = np.tile(np.array([0, 0, 0, 2, 2, 2], np.uint8), (240, 54))
    logits = np.zeros((1, 3, 64, 80), np.float32)
    logits[0, 1] = -20.0
    assert count_cells(logits, truth).loss[AS_IT_IS] == pytest.approx(64 * 80 * math.log(2.0), rel=1e-3)
