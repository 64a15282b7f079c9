"""Network inputs: letterbox and stretch, against numbers computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from paani_services.perception.preprocessing import (
    LetterboxTransform,
    build_lookup_tables,
    letterbox_picture,
    stretch_picture,
)
from tests.pictures import solid

UNITY = build_lookup_tables((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
IMAGENET = build_lookup_tables((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))


def test_c3_letterbox() -> None:
    """C3: aspect kept, centred on grey, RGB, 1/255."""
    picture = solid(10, 20, 200)
    tensor, place = letterbox_picture(picture, 256, 320, 114, UNITY)
    assert tensor.shape == (1, 3, 256, 320)
    assert tensor.dtype == np.float32
    assert place == LetterboxTransform(1.0, 1.0, 0, 8, 320, 240)
    assert tensor[0, :, 128, 160] == pytest.approx([200 / 255, 20 / 255, 10 / 255])
    assert tensor[0, :, 0, 0] == pytest.approx([114 / 255] * 3)
    _, place = letterbox_picture(np.zeros((480, 480, 3), np.uint8), 256, 320, 114, UNITY)
    assert (place.left_px, place.top_px) == (32, 0)


def test_d7_stretch() -> None:
    """D7: the whole picture fills the input, ImageNet mean and deviation, RGB."""
    tensor = stretch_picture(solid(10, 20, 200), 256, 320, IMAGENET)
    expected = [(200 / 255 - 0.485) / 0.229, (20 / 255 - 0.456) / 0.224, (10 / 255 - 0.406) / 0.225]
    assert tensor[0, :, 100, 100] == pytest.approx(expected, abs=1e-5)
    assert tensor.flags.c_contiguous


def test_d8_the_picture_is_stretched_bilinearly() -> None:
    """D8: from two pixels to four, each centre lies a quarter or three quarters of the way between."""
    picture = np.zeros((2, 2, 3), np.uint8)
    picture[:, 1] = 240
    row = stretch_picture(picture, 2, 4, UNITY)[0, 0, 0] * 255
    assert row == pytest.approx([0.0, 60.0, 180.0, 240.0], abs=1.0)
