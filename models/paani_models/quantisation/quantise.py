"""Static post-training quantisation of an FP32 ONNX file to INT8, by a named recipe (T4; Jacob et al. 2018)."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import onnx
from onnxruntime.quantization import CalibrationDataReader, CalibrationMethod, QuantFormat, QuantType, quantize_static

from paani.arrays import F32
from paani.whole_file import replacement_file
from paani_models.engines.onnx_file import read_onnx
from paani_models.quantisation.equalisation import equalise_layers


@dataclass(frozen=True)
class QuantisationRecipe:
    """How a network becomes INT8: QDQ, MinMax, signed weights of 8 bits.

    operators: types of nodes that are quantised, () for all that can be. float_decoding: the last convolutions and
    all nodes behind them stay float. float_depthwise: so do depthwise
    convolutions. float_above_rows: and steps whose output has more rows than this (0: none). spread: calibrated on
    pictures from the whole training side, not on the first by name.
    """

    name: str
    equalised: bool = False
    per_channel: bool = False
    unsigned_activations: bool = False
    operators: tuple[str, ...] = ()
    float_decoding: bool = False
    float_depthwise: bool = False
    float_above_rows: int = 0
    spread: bool = False


PAPER = QuantisationRecipe("paper")  # T4
_EQUALISED = QuantisationRecipe(
    "equalised", equalised=True, per_channel=True, unsigned_activations=True, float_decoding=True, spread=True
)
RECIPES = {
    "paper": {"segmenter": PAPER, "detector": PAPER},
    "equalised": {
        "segmenter": replace(_EQUALISED, operators=("Conv", "Add", "Clip", "Relu", "Resize", "Pad")),
        # SiLU does not commute with a factor, so what equalisation cannot reach stays float: without, AP50 loses 20
        # points.
        "detector": replace(
            _EQUALISED,
            operators=("Conv", "Concat", "Mul", "Sigmoid", "Add", "MaxPool", "Resize"),
            float_depthwise=True,
            float_above_rows=16,
        ),
    },
}


class _CalibrationInputs(CalibrationDataReader):
    def __init__(self, name: str, inputs: Sequence[F32]) -> None:
        self._next: Iterator[dict[str, F32]] = iter([{name: x} for x in inputs])

    def get_next(self) -> dict[str, F32] | None:
        return next(self._next, None)


def quantise_network(net: Path, target: Path, recipe: QuantisationRecipe, inputs: Sequence[F32]) -> None:
    """Write `target`, whole or not at all.

    inputs: calibration inputs as the network gets them, [1,3,H,W] each. Raises UserError naming a file that is no ONNX
    net.
    """
    model = read_onnx(net)
    if recipe.equalised:
        equalise_layers(model)
    model = onnx.shape_inference.infer_shapes(model)
    target.parent.mkdir(parents=True, exist_ok=True)
    float_net = target.with_suffix(".float.partial")
    onnx.save(model, str(float_net))
    options: dict[str, Any] = {"nodes_to_exclude": find_float_steps(model, recipe)}
    if recipe.operators:
        options["op_types_to_quantize"] = list(recipe.operators)
    logging.getLogger().addFilter(_is_other_than_advice)
    try:
        with replacement_file(target) as beside:
            quantize_static(
                str(float_net),
                str(beside),
                _CalibrationInputs(model.graph.input[0].name, inputs),
                quant_format=QuantFormat.QDQ,
                calibrate_method=CalibrationMethod.MinMax,
                activation_type=QuantType.QUInt8 if recipe.unsigned_activations else QuantType.QInt8,
                weight_type=QuantType.QInt8,
                per_channel=recipe.per_channel,
                **options,
            )
            _drop_unused_constants(beside)
    finally:
        logging.getLogger().removeFilter(_is_other_than_advice)
        float_net.unlink(missing_ok=True)


def _is_other_than_advice(record: logging.LogRecord) -> bool:
    """`quantize_static` recommends, through the root logger, a pre-processing that export has done already."""
    return "pre-processing" not in record.getMessage()


def _drop_unused_constants(path: Path) -> None:
    """Constants that only float steps used would each be announced at every start."""
    model = onnx.load(str(path))
    used = {name for node in model.graph.node for name in node.input}
    kept = [tensor for tensor in model.graph.initializer if tensor.name in used]
    del model.graph.initializer[:]
    model.graph.initializer.extend(kept)
    onnx.save(model, str(path))


def find_float_steps(model: onnx.ModelProto, recipe: QuantisationRecipe) -> list[str]:
    """Names of the steps that a recipe leaves in float. model: with its shapes inferred."""
    kept = find_decoding_steps(model) if recipe.float_decoding else []
    weights = {tensor.name: tensor.dims for tensor in model.graph.initializer}
    rows = {
        value.name: value.type.tensor_type.shape.dim[2].dim_value
        for value in model.graph.value_info
        if len(value.type.tensor_type.shape.dim) == 4
    }
    for node in model.graph.node:
        depthwise = node.op_type == "Conv" and node.input[1] in weights and weights[node.input[1]][1] == 1
        if recipe.float_depthwise and depthwise:
            kept.append(node.name)
        if recipe.float_above_rows and rows.get(node.output[0], 0) > recipe.float_above_rows:
            kept.append(node.name)
    return kept


def find_decoding_steps(model: onnx.ModelProto) -> list[str]:
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
