"""The mask's palette, against a decoder of pictures."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from paani_services.foxglove.mask_colours import CLASS_RGB, tint_mask

CLASSES = np.arange(48 * 64, dtype=np.uint8).reshape(48, 64) % 3


def png(picture: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> bytes:
    return cv2.imencode(".png", picture)[1].tobytes()


def test_each_class_has_its_colour() -> None:
    tinted = tint_mask(png(CLASSES))
    assert tinted is not None
    bgr = cv2.imdecode(np.frombuffer(tinted, np.uint8), cv2.IMREAD_COLOR)
    assert bgr is not None
    assert (bgr[:, :, ::-1] == np.array(CLASS_RGB, np.uint8)[CLASSES]).all()


@pytest.mark.parametrize(
    "data",
    [
        b"", b"\xff\xd8\xff", png(CLASSES)[:20], png(CLASSES)[:30], png(np.dstack([CLASSES] * 3)),
        cv2.imencode(".png", CLASSES.astype(np.uint16))[1].tobytes(),
    ],
    ids=["empty", "jpeg", "cut in the header", "cut in its checksum", "of colours", "of 16 bits"],
)  # fmt: skip
def test_what_is_no_mask_is_not_shown(data: bytes) -> None:
    assert tint_mask(data) is None
