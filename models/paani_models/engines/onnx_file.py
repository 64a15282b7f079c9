"""Reading ONNX files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from paani.errors import UserError

if TYPE_CHECKING:
    from onnx import ModelProto


def read_onnx(path: Path) -> ModelProto:
    """The net in a file. Raises UserError naming a file that is not ONNX; ModuleNotFoundError without onnx."""
    import onnx  # noqa: PLC0415 - not on the board

    try:
        return onnx.load(str(path))
    except Exception as error:
        raise UserError(f"{path}: not a readable ONNX file ({type(error).__name__})") from error
