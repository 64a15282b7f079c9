"""What a picture costs whatever the machine: the bytes of its nets and their multiplications."""

from collections.abc import Iterable
from math import prod
from pathlib import Path

import msgspec


class Work(msgspec.Struct, frozen=True):
    """Of a pair of nets. `multiply_adds`: of their convolutions, None where the onnx package is not installed."""

    name: str
    bytes: int
    multiply_adds: int | None


def work(name: str, files: Iterable[Path]) -> Work:
    """Of all the files together."""
    paths = list(files)
    counts = [multiply_adds(path) for path in paths]
    total = None if None in counts else sum(count for count in counts if count is not None)
    return Work(name, sum(path.stat().st_size for path in paths), total)


def multiply_adds(path: Path) -> int | None:
    """Multiplications in an ONNX file's convolutions; None without the onnx package or where a shape is untold."""
    try:
        import onnx  # noqa: PLC0415 - not on the board
    except ModuleNotFoundError:
        return None
    graph = onnx.shape_inference.infer_shapes(onnx.load(str(path)), data_prop=True).graph
    weights = {tensor.name: tuple(tensor.dims) for tensor in graph.initializer}
    for node in graph.node:  # a quantised weight reaches its convolution through a step of its own
        if node.op_type == "DequantizeLinear" and node.input[0] in weights:
            weights[node.output[0]] = weights[node.input[0]]
    shapes = {
        value.name: [side.dim_value for side in value.type.tensor_type.shape.dim]
        for value in (*graph.value_info, *graph.output)
    }
    convolutions = [node for node in graph.node if node.op_type == "Conv"]
    if any(0 in shapes.get(node.output[0], [0]) or node.input[1] not in weights for node in convolutions):
        return None
    return sum(prod(shapes[node.output[0]]) * prod(weights[node.input[1]][1:]) for node in convolutions)
