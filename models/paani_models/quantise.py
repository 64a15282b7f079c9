"""FP32 ONNX -> INT8 ONNX by a named recipe, calibrated on training pictures (checklist T4)."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnxruntime.quantization import CalibrationDataReader, CalibrationMethod, QuantFormat, QuantType, quantize_static

from paani.errors import UserError
from paani_models.equalise import equalise

Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Recipe:
    """How a net becomes INT8. QDQ and MinMax throughout.

    unsigned_activations: U8 instead of S8. reduced_range: weights of 7 bits, for processors whose 16-bit sums overflow.
    float_decoding: whatever turns the last convolutions' outputs into boxes, and those convolutions, stay float.
    """

    name: str
    equalised: bool
    per_channel: bool
    unsigned_activations: bool
    reduced_range: bool
    float_decoding: bool


RECIPES = {
    "paper": Recipe("paper", False, False, False, False, False),  # T4
    "equalised": Recipe("equalised", True, True, True, True, True),
}


class _Inputs(CalibrationDataReader):  # type: ignore[misc]
    def __init__(self, name: str, inputs: Sequence[Floats]) -> None:
        self._next: Iterator[dict[str, Floats]] = iter([{name: x} for x in inputs])

    def get_next(self) -> dict[str, Floats] | None:
        return next(self._next, None)


def quantise(net: Path, target: Path, recipe: Recipe, inputs: Sequence[Floats]) -> None:
    """Write `target`, beside and then by renaming.

    inputs: calibration inputs as the net gets them, [1,3,H,W] each. Raises UserError naming a file that is no ONNX net.
    """
    try:
        model = onnx.load(str(net))
    except Exception as error:
        raise UserError(f"{net}: not a readable ONNX file ({type(error).__name__})") from error
    if recipe.equalised:
        equalise(model)
    float_net, beside = target.with_suffix(".float.partial"), target.with_suffix(".partial")
    onnx.save(onnx.shape_inference.infer_shapes(model), str(float_net))
    options: dict[str, Any] = {}
    if recipe.float_decoding:
        options = {"nodes_to_exclude": decoding(model), "op_types_to_quantize": ["Conv"]}
    logging.getLogger().setLevel(logging.ERROR)  # it recommends a pre-processing that export has done already
    try:
        quantize_static(
            str(float_net),
            str(beside),
            _Inputs(model.graph.input[0].name, inputs),
            quant_format=QuantFormat.QDQ,
            calibrate_method=CalibrationMethod.MinMax,
            activation_type=QuantType.QUInt8 if recipe.unsigned_activations else QuantType.QInt8,
            weight_type=QuantType.QInt8,
            per_channel=recipe.per_channel,
            reduce_range=recipe.reduced_range,
            **options,
        )
        beside.replace(target)
    finally:
        for left in (float_net, beside):
            left.unlink(missing_ok=True)


def decoding(model: onnx.ModelProto) -> list[str]:
    """Names of the steps between the last convolutions and the outputs, those convolutions included.

    A convolution that reads a softmax computes an expected distance, and is part of the decoding.
    """
    maker = {name: node for node in model.graph.node for name in node.output}
    waiting = [end.name for end in model.graph.output]
    found: dict[str, None] = {}
    while waiting:
        node = maker.get(waiting.pop())
        if node is None or node.name in found:
            continue
        found[node.name] = None
        fed = maker.get(node.input[0]) if node.input else None
        if node.op_type != "Conv" or (fed is not None and fed.op_type == "Softmax"):
            waiting.extend(node.input)
    return list(found)
