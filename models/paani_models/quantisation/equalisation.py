"""Cross-layer equalisation (Nagel et al. 2019): channels are rescaled between layers so that one scale suits all.

ReLU, addition, nearest and linear resizing and pooling commute with a positive factor per channel. So whatever such
steps connect, the convolutions that write into it may be divided, and those that read from it multiplied, by any
factors: the network computes the same. Batch norm must be folded already, as export does. Graphs are changed in place.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
import onnx
from onnx import numpy_helper

from paani.arrays import F32

MAX_ROUNDS = 30
CONVERGED_LOG_FACTOR = 1e-3  # iteration ends when no factor's logarithm is larger
# Steps that keep channels apart and commute with a positive factor, and which of their inputs carry the picture.
_COMMUTING = {"Relu": 1, "Resize": 1, "MaxPool": 1, "AveragePool": 1, "GlobalAveragePool": 1, "ReduceMean": 1, "Add": 2}


@dataclass
class _ChannelGroup:
    """Tensors that share their channels' factors, and the convolutions at their ends."""

    writers: list[onnx.NodeProto] = field(default_factory=list)
    readers: list[onnx.NodeProto] = field(default_factory=list)
    closed: bool = True


def equalise_layers(model: onnx.ModelProto) -> int:
    """Equalise every closed group of channels and return their number. The outputs change by rounding alone."""
    weights = {t.name: numpy_helper.to_array(t).astype(np.float32) for t in model.graph.initializer}
    groups = [group for group in _find_groups(model.graph, weights) if group.closed and group.writers and group.readers]
    for _ in range(MAX_ROUNDS):
        if max((_equalise_group(group, weights) for group in groups), default=0.0) < CONVERGED_LOG_FACTOR:
            break
    touched = {name for group in groups for conv in (*group.writers, *group.readers) for name in conv.input[1:]}
    for tensor in model.graph.initializer:
        if tensor.name in touched:
            tensor.CopyFrom(numpy_helper.from_array(np.ascontiguousarray(weights[tensor.name]), tensor.name))
    return len(groups)


def _find_groups(graph: onnx.GraphProto, weights: dict[str, F32]) -> list[_ChannelGroup]:
    parent: dict[str, str] = {}

    def root(name: str) -> str:
        while parent.setdefault(name, name) != name:
            name = parent[name]
        return name

    def carried(node: onnx.NodeProto) -> list[str]:
        return list(node.input)[: _COMMUTING.get(node.op_type, 0)]

    uses: dict[str, int] = defaultdict(int)
    for node in graph.node:
        for name in node.input:
            uses[name] += 1
        for name in carried(node):
            parent[root(name)] = root(node.output[0])
    found: dict[str, _ChannelGroup] = defaultdict(_ChannelGroup)
    for end in (*graph.input, *graph.output):
        found[root(end.name)].closed = False
    for node in graph.node:
        if node.op_type == "Conv" and _is_equalisable(node, weights, uses):
            found[root(node.input[0])].readers.append(node)
            found[root(node.output[0])].writers.append(node)
            continue
        inside = carried(node)
        for name in (*node.input[len(inside) :], *([] if inside else node.output)):
            found[root(name)].closed = False
        if any(name in weights for name in inside):
            found[root(node.output[0])].closed = False
    return list(found.values())


def _is_equalisable(conv: onnx.NodeProto, weights: dict[str, F32], uses: dict[str, int]) -> bool:
    """Dense or depthwise, with weights of its own."""
    if any(name not in weights or uses[name] > 1 for name in conv.input[1:]):
        return False
    return _is_depthwise(conv, weights) or _group_count(conv) == 1


def _group_count(conv: onnx.NodeProto) -> int:
    return next((int(a.i) for a in conv.attribute if a.name == "group"), 1)


def _is_depthwise(conv: onnx.NodeProto, weights: dict[str, F32]) -> bool:
    weight = weights[conv.input[1]]
    return _group_count(conv) == weight.shape[0] and weight.shape[1] == 1


def _equalise_group(group: _ChannelGroup, weights: dict[str, F32]) -> float:
    """Equalise one group once and return the largest logarithm of a factor."""
    written = np.max([_channel_ranges(weights[conv.input[1]], 0) for conv in group.writers], 0)
    read = np.max([_channel_ranges(weights[conv.input[1]], _input_axis(conv, weights)) for conv in group.readers], 0)
    usable = (written > 0) & (read > 0)
    factor = np.sqrt(np.divide(written, read, out=np.ones_like(written), where=usable))
    factor[~usable] = 1.0
    for conv in group.writers:
        for name in conv.input[1:]:
            weights[name] = weights[name] / _broadcast_along(factor, 0, weights[name].ndim)
    for conv in group.readers:
        name = conv.input[1]
        weights[name] = weights[name] * _broadcast_along(factor, _input_axis(conv, weights), weights[name].ndim)
    return float(np.abs(np.log(factor)).max())


def _input_axis(conv: onnx.NodeProto, weights: dict[str, F32]) -> int:
    return 0 if _is_depthwise(conv, weights) else 1


def _channel_ranges(weight: F32, axis: int) -> F32:
    """Largest absolute weight of each channel, as a share of the largest of all."""
    others = tuple(a for a in range(weight.ndim) if a != axis)
    largest = np.abs(weight).max(axis=others)
    return np.asarray(largest / max(float(largest.max()), 1e-12), np.float32)


def _broadcast_along(factor: F32, axis: int, ndim: int) -> F32:
    shape = [1] * ndim
    shape[axis] = -1
    return factor.reshape(shape)
