"""Reading ONNX files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from paani.errors import UserError

if TYPE_CHECKING:
    from onnx import ModelProto


def read_onnx(path: Path, *, with_shapes: bool = False) -> ModelProto:
    """The net in a file, with the shapes inside it or as it is.

    Raises UserError naming a file that is not ONNX, or whose shapes cannot be inferred; ModuleNotFoundError without
    onnx.
    """
    import onnx  # noqa: PLC0415 - not on the board

    try:
        model = onnx.load(str(path))
        return onnx.shape_inference.infer_shapes(model, data_prop=True) if with_shapes else model
    except Exception as error:
        raise UserError(f"{path}: not a readable ONNX file ({type(error).__name__})") from error
