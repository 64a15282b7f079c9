"""Parity of the engines: how far the outputs of onnxruntime and ncnn differ."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from paani_models.catalogue import Model
from paani_models.datasets.sources import read_picture
from paani_models.engines.contract_check import largest_output_difference, synthetic_inputs, to_network_input
from paani_models.engines.ncnn_runner import NcnnFiles, open_ncnn
from paani_models.engines.onnx_runner import open_network

Inputs = Mapping[str, NDArray[np.float32]]
HELD_OUT_PICTURES = 8


def prepare_inputs(contract: Model, pictures: Sequence[Path]) -> Inputs:
    """Drawn pictures, and some of the given ones, evenly, as inputs of a float32 net.

    They fill the input whatever the network's rule for resizing: both engines get the same. Raises UserError naming a
    picture that cannot be read.
    """
    height, width = contract.size_hw
    step = max(1, len(pictures) // HELD_OUT_PICTURES)
    inputs = synthetic_inputs(contract)
    for path in pictures[::step][:HELD_OUT_PICTURES]:
        resized = np.asarray(cv2.resize(read_picture(path), (width, height)), np.uint8)
        inputs[str(path)] = to_network_input(resized, contract)
    return {name: np.asarray(x, np.float32) for name, x in inputs.items()}


def measure_difference(source: Path, files: NcnnFiles, role: str, contract: Model, inputs: Inputs) -> float:
    """The largest difference of both engines' answers; boxes as shares of the input's sides.

    Infinite where ncnn's answer has another shape or is not finite.
    """
    plain, other = open_network(source, 1), open_ncnn(files, 1)
    worst = 0.0
    for x in inputs.values():
        expected, found = plain(x), other(x)
        if expected.shape != found.shape or not np.isfinite(found).all():
            return math.inf
        worst = max(worst, largest_output_difference(found, expected, role, contract))
    return worst
