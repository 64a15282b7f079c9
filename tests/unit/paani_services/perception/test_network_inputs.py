"""What each network gets of a picture, and what becomes of scores that are no numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from paani import messages as m
from paani.arrays import F32
from paani.clock import stopwatch_ms
from paani.config import load_config
from paani_services.perception.engine import OnnxEngine
from paani_services.perception.pipeline import Perceiver
from paani_services.perception.preprocessing import (
    LetterboxTransform,
    build_lookup_tables,
    letterbox_picture,
    stretch_picture,
)
from tests.pictures import river, solid

HEADER = m.PictureHeader(source_us=1_000_000, frame_seq=7, frame_epoch=3, width_px=320, height_px=240)
UNITY = build_lookup_tables((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
IMAGENET = build_lookup_tables((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))


@pytest.mark.parametrize("profile", ["paani", "paper"])
@pytest.mark.slow
def test_b4_c3_d8_each_network_gets_the_same_picture_by_its_own_preprocessing(
    monkeypatch: pytest.MonkeyPatch, profile: str
) -> None:
    """The detector's is letterboxed and divided by 255, the segmenter's stretched and normalised as ImageNet's."""
    picture = river()[:, :240].copy()
    picture[:, :60] = (10, 20, 200)
    perceiver = Perceiver(load_config(profile=profile).perception, stopwatch_ms)
    given: dict[str, Any] = {}
    run = OnnxEngine.run

    def run_noting(engine: OnnxEngine, tensor: Any) -> F32:
        given.setdefault(engine.info().split()[0], tensor)
        return run(engine, tensor)

    monkeypatch.setattr(OnnxEngine, "run", run_noting)
    perceiver.perceive(picture, HEADER, 0.0)
    height, width = given["detector"].shape[2:]
    np.testing.assert_array_equal(given["detector"], letterbox_picture(picture, height, width, 114, UNITY)[0])
    np.testing.assert_array_equal(given["segmenter"], stretch_picture(picture, 256, 320, IMAGENET))


def test_c3_a_picture_is_enlarged_with_its_aspect_kept() -> None:
    """320x240 into the shipped detector's 320x416."""
    _, place = letterbox_picture(solid(1, 2, 3), 320, 416, 114, UNITY)
    assert place == LetterboxTransform(1.3, 1.3, 0, 4, 320, 240)


def test_c3_a_network_of_bytes_gets_red_first() -> None:
    tensor, _ = letterbox_picture(solid(10, 20, 200), 256, 320, 114, None)
    assert tensor[0, 128, 160].tolist() == [200, 20, 10]


@pytest.mark.slow
def test_f1_f2_scores_that_are_no_numbers_give_a_labelled_fallback(monkeypatch: pytest.MonkeyPatch) -> None:
    run = OnnxEngine.run

    def run_spoilt(engine: OnnxEngine, tensor: Any) -> F32:
        answer = run(engine, tensor)
        return answer * np.float32(math.nan) if engine.info().startswith("segmenter") else answer

    monkeypatch.setattr(OnnxEngine, "run", run_spoilt)
    evidence, _ = Perceiver(load_config().perception, stopwatch_ms).perceive(river(), HEADER, 0.0)
    assert (evidence.segmentation, evidence.navigation_eligible) == (m.SegmentationSource.FALLBACK, False)
