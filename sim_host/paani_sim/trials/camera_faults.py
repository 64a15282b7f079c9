"""What a broken camera delivers instead of the picture."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from paani_sim.worlds import Fault, FaultKind
from paani_sim.worlds.faults import active

Bytes = NDArray[np.uint8]
NOMINAL_WIDTH_PX = 320


class CameraFaults:
    """Remembers the last good picture, which a frozen camera goes on showing."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        self._faults = tuple(faults)
        self._last: Bytes | None = None

    def broken(self, bgr: Bytes, t_s: float) -> Bytes | None:
        """The picture as delivered at simulated time `t_s`; None where none comes."""
        if active(self._faults, FaultKind.CAMERA_DROPPED, t_s):
            return None
        if active(self._faults, FaultKind.CAMERA_BLACK, t_s):
            return np.zeros_like(bgr)
        if active(self._faults, FaultKind.CAMERA_FROZEN, t_s) and self._last is not None:
            return self._last
        self._last = bgr
        blurred = active(self._faults, FaultKind.CAMERA_BLURRED, t_s)
        if blurred and blurred.amount > 0.0:
            sigma_px = blurred.amount * bgr.shape[1] / NOMINAL_WIDTH_PX
            return np.asarray(cv2.GaussianBlur(bgr, (0, 0), sigma_px), np.uint8)
        return bgr
