"""Load an exported network back into PyTorch, so that training can go on from weights without a checkpoint.

Export folds batch norm into the convolutions. Here each normalisation is given the statistics that its convolution
shows on pictures, and the scale and offset that undo them: evaluation equals the exported file, and training, which
normalises by the batch, starts close to it.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import torch
from onnx import numpy_helper
from torch import Tensor, nn
from torch.utils.hooks import RemovableHandle

from paani.errors import UserError
from paani_models.detector.shipped_network import FOCUS_SHAPE, unfold_focus
from paani_models.engines.onnx_file import read_onnx


def load_exported(model: nn.Module, path: Path, pictures: Tensor) -> None:
    """Fill `model` with the weights of its own export, or of one with YOLOX's focus layer.

    pictures: float32 [N,3,H,W] as the network gets them, whose statistics the normalisations take.
    Raises UserError where the file is no export of this net.
    """
    stored = _read_convolutions(path, _find_fixed_weights(model))
    convs = _order_by_execution(model, pictures[:1])
    if len(stored) != len(convs):
        raise UserError(f"{path}: {len(stored)} convolutions, expected {len(convs)}")
    norms = _find_following_norms(model)
    biases: dict[nn.Conv2d, Tensor] = {}
    for index, (conv, (found, bias)) in enumerate(zip(convs, stored, strict=True)):
        weight = unfold_focus(found) if index == 0 and found.shape[1:] == FOCUS_SHAPE else found
        if weight.shape != conv.weight.shape:
            raise UserError(
                f"{path}: convolution {index} has shape {tuple(weight.shape)}, expected {tuple(conv.weight.shape)}"
            )
        conv.weight.data = weight
        if conv in norms:
            _set_identity(norms[conv], bias)
            biases[conv] = bias
        elif conv.bias is not None:
            conv.bias.data = bias
    _take_statistics(model, {conv: norms[conv] for conv in biases}, biases, pictures)


def _find_fixed_weights(model: nn.Module) -> frozenset[str]:
    """Names of the weights that training leaves as they are; an export keeps them, and the model has them already."""
    return frozenset(name for name, weight in model.named_parameters() if not weight.requires_grad)


def _read_convolutions(path: Path, fixed: frozenset[str]) -> list[tuple[Tensor, Tensor]]:
    """Weight and bias of each convolution but those with a fixed weight, in the file's order."""
    graph = read_onnx(path).graph
    constants = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    pairs = []
    for node in graph.node:
        if node.op_type == "Conv" and node.input[1] not in fixed:
            if len(node.input) < 3 or any(name not in constants for name in node.input[1:3]):
                raise UserError(f"{path}: {node.name}: a convolution without stored weight and bias")
            weight, bias = (torch.tensor(constants[name]) for name in node.input[1:3])
            pairs.append((weight, bias))
    return pairs


@torch.no_grad()
def _order_by_execution(model: nn.Module, picture: Tensor) -> list[nn.Conv2d]:
    order: list[nn.Conv2d] = []
    handles: list[RemovableHandle] = [
        module.register_forward_hook(lambda conv, _inputs, _output: order.append(conv))
        for module in model.modules()
        if isinstance(module, nn.Conv2d)
    ]
    model.eval()(picture)
    for handle in handles:
        handle.remove()
    return order


def _find_following_norms(model: nn.Module) -> dict[nn.Conv2d, nn.BatchNorm2d]:
    """Find the normalisation that follows each convolution; both stand side by side in a block."""
    found = {}
    for block in model.modules():
        for first, second in pairwise(block.children()):
            if isinstance(first, nn.Conv2d) and isinstance(second, nn.BatchNorm2d):
                found[first] = second
    return found


def _set_identity(norm: nn.BatchNorm2d, bias: Tensor) -> None:
    _set_statistics(norm, torch.zeros_like(bias), torch.ones_like(bias), bias)


def _set_statistics(norm: nn.BatchNorm2d, mean: Tensor, variance: Tensor, bias: Tensor) -> None:
    assert norm.running_mean is not None
    assert norm.running_var is not None
    norm.running_mean.copy_(mean)
    norm.running_var.copy_(variance)
    norm.weight.data = (variance + norm.eps).sqrt()
    norm.bias.data = bias + mean


@torch.no_grad()
def _take_statistics(
    model: nn.Module, norms: dict[nn.Conv2d, nn.BatchNorm2d], biases: dict[nn.Conv2d, Tensor], pictures: Tensor
) -> None:
    statistics: dict[nn.Conv2d, tuple[Tensor, Tensor]] = {}

    def record_statistics(conv: nn.Module, _inputs: tuple[Tensor, ...], output: Tensor) -> None:
        assert isinstance(conv, nn.Conv2d)
        statistics[conv] = (output.mean((0, 2, 3)), output.var((0, 2, 3), unbiased=False))

    handles = [conv.register_forward_hook(record_statistics) for conv in norms]
    model.eval()(pictures)
    for handle in handles:
        handle.remove()
    for conv, norm in norms.items():
        _set_statistics(norm, *statistics[conv], biases[conv])
