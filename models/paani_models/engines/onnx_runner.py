"""Run an exported network by onnxruntime for checks and figures: the only importer of it among the models."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from paani.arrays import F32
from paani.errors import UserError

Session = Any  # onnxruntime is untyped


def open_network(path: Path, threads: int = 2) -> Callable[[F32], F32]:
    """A function from input [1,3,H,W] to the first output. Raises UserError naming a file that cannot be loaded."""
    session = open_session(path, threads)
    return lambda x: run_network(session, x)


def open_session(path: Path, threads: int = 2, *, optimised: bool = True) -> Session:
    """A loaded net. Raises UserError naming a file that cannot be loaded."""
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 3
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    if not optimised:
        options.graph_optimization_level = ort.GraphOptimizationLevel.ORT_DISABLE_ALL
    try:
        return ort.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise UserError(f"{path}: not a readable ONNX file ({type(error).__name__})") from error


def input_size_hw(session: Session, path: Path) -> tuple[int, int]:
    """Height and width of the picture that a net takes. Raises UserError naming a file of any other input."""
    found = [(tuple(each.shape), each.type) for each in session.get_inputs()]
    match found:
        case [((1, 3, int(height), int(width)), "tensor(float)")]:
            return height, width
    raise UserError(f"{path}: takes {str(found)[:80]}, not one float32 [1, 3, H, W]")


def run_network(session: Session, x: F32 | NDArray[np.uint8]) -> F32:
    """The first output for one input."""
    return np.asarray(session.run(None, {session.get_inputs()[0].name: x})[0], np.float32)
