"""How much arithmetic a net costs, read from its graph."""

from __future__ import annotations

import math
from pathlib import Path

import onnx

from paani.errors import UserError


def multiply_adds(path: Path) -> int:
    """Multiply-adds of one run: convolutions and matrix products, which are all but a few per cent of the work.

    Raises UserError naming a file that is not ONNX or whose shapes are not static.
    """
    try:
        model = onnx.shape_inference.infer_shapes(onnx.load(str(path)), data_prop=True)
    except Exception as error:
        raise UserError(f"{path}: not a readable ONNX file ({type(error).__name__})") from error
    graph = model.graph
    shapes = {tensor.name: tuple(tensor.dims) for tensor in graph.initializer}
    for value in (*graph.input, *graph.value_info, *graph.output):
        shapes[value.name] = tuple(side.dim_value for side in value.type.tensor_type.shape.dim)
    total = 0
    for node in graph.node:
        if node.op_type not in {"Conv", "Gemm", "MatMul"}:
            continue
        outputs = math.prod(shapes.get(node.output[0], (0,)))
        if outputs == 0:
            raise UserError(f"{path}: the shape of {node.output[0]!r} is not static")
        if node.op_type == "Conv":
            total += outputs * math.prod(shapes[node.input[1]][1:])
        else:
            transposed = any(a.name == "transA" and a.i for a in node.attribute)
            total += outputs * shapes[node.input[0]][-2 if transposed else -1]
    return total
