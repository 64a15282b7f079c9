"""Count the multiply-adds of a network from its ONNX graph."""

from __future__ import annotations

from math import prod
from pathlib import Path

from paani_models.engines.onnx_file import read_onnx


def count_multiply_adds(path: Path) -> int | None:
    """Multiply-adds of one run of the convolutions and dense layers, which are all but a few per cent of the work.

    None where the onnx package is not installed, or a shape is not static. Raises UserError naming a file that is not
    ONNX.
    """
    try:
        graph = read_onnx(path, with_shapes=True).graph
    except ModuleNotFoundError:
        return None
    weights = {tensor.name: tuple(tensor.dims) for tensor in graph.initializer}
    for node in graph.node:  # a quantised weight reaches its layer through a step of its own
        if node.op_type == "DequantizeLinear" and node.input[0] in weights:
            weights[node.output[0]] = weights[node.input[0]]
    shapes = {
        value.name: [int(side.dim_value) for side in value.type.tensor_type.shape.dim]
        for value in (*graph.value_info, *graph.output)
    }
    total = 0
    for node in graph.node:
        if node.op_type not in {"Conv", "Gemm"}:
            continue
        outputs, weight = prod(shapes.get(node.output[0], [0])), weights.get(node.input[1])
        if outputs == 0 or weight is None:
            return None
        transposed = node.op_type == "Conv" or any(a.name == "transB" and a.i for a in node.attribute)
        total += outputs * (prod(weight[1:]) if transposed else weight[0])
    return total
