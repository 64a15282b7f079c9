"""An exported detector of any input size, as a function from a picture to boxes in the picture's pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from paani.arrays import F32, U8
from paani_models.detector.metrics import Detections, decode_boxes
from paani_models.engines.onnx_runner import input_size_hw, open_session, run_network
from paani_models.network_input import detector_input, letterbox_affine


@dataclass(frozen=True)
class ExportedDetector:
    """run: input [1,3,H,W] -> [1, 4 + classes, A]. size_wh: width and height of that input."""

    run: Callable[[F32], F32]
    size_wh: tuple[int, int]

    def prepare(self, picture: U8) -> F32:
        """RGB picture [H,W,3] -> the network's input."""
        return detector_input(picture, self.size_wh)

    def find(self, picture: U8, confidence: float, limit: int) -> Detections:
        """Boxes of a picture above a score, at most `limit`, in the picture's pixels; they may end outside it."""
        found = decode_boxes(self.run(self.prepare(picture))[0], confidence, limit)
        affine = letterbox_affine((picture.shape[1], picture.shape[0]), self.size_wh)
        corners = (found.boxes.reshape(-1, 2, 2) - affine[:, 2]) / affine[0, 0]
        return Detections(corners.reshape(-1, 4).astype(np.float32), found.scores, found.classes)


def open_detector(path: Path, threads: int = 2) -> ExportedDetector:
    """Raises UserError naming a file that cannot be loaded or does not take a picture of fixed size."""
    session = open_session(path, threads)
    height, width = input_size_hw(session, path)
    return ExportedDetector(lambda x: run_network(session, x), (width, height))
