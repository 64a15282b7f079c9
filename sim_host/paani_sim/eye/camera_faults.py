"""Applies the camera faults of a scenario: black, frozen, blurred or no pictures. Deterministic in time."""

from collections.abc import Iterable

import cv2
import numpy as np

from paani.arrays import U8
from paani.picture_faults import black
from paani_sim.worlds.faults import Fault, FaultKind, find_active_fault, is_linked

BLUR_PX = 8.0  # of a blur whose amount is not named: severity 3 of `paani.picture_faults.blur`
DARK_SEVERITY = 3


class CameraFaults:
    """Remembers the last good picture, which a frozen camera shows again."""

    def __init__(self, faults: Iterable[Fault]) -> None:
        self._faults = tuple(faults)
        self._kept: U8 | None = None

    def apply(self, bgr: U8, t_s: float) -> U8 | None:
        """What comes out of the camera at simulated time `t_s`; None: no picture comes, or none crosses the link.

        A camera that is frozen from its first picture on shows that one.
        """
        if find_active_fault(self._faults, FaultKind.CAMERA_DROPPED, t_s) or not is_linked(self._faults, t_s):
            return None
        if self._kept is None or not find_active_fault(self._faults, FaultKind.CAMERA_FROZEN, t_s):
            self._kept = bgr.copy()
        frame = self._kept
        blurred = find_active_fault(self._faults, FaultKind.CAMERA_BLURRED, t_s)
        if blurred:
            sigma_px = (blurred.amount or BLUR_PX) * bgr.shape[1] / 320.0
            frame = np.asarray(cv2.GaussianBlur(frame, (0, 0), sigma_px), np.uint8)
        if find_active_fault(self._faults, FaultKind.CAMERA_BLACK, t_s):
            frame = black(frame, DARK_SEVERITY, np.random.default_rng(round(t_s * 1e6)))
        return frame
