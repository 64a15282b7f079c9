"""The shipped segmenter: MobileNetV2 encoder (Sandler et al. 2018) from ImageNet, top-down decoder, detail branch.

Ours: the encoder sees the picture at 11/16 size, and a thin branch at full size keeps the edges.

The encoder's weights come with batch norm folded in (`convNN.weight`, `convNN.bias` in running order), for RGB in -1..1
and padding on the bottom and right only before a stride.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from paani.errors import UserError
from paani_models.datasets.sources import SEGMENTER_CLASSES

# (expansion, channels, repeats, stride): Sandler et al. 2018, table 2, without its last stage.
_STAGES = (
    (1, 16, 1, 1),
    (6, 24, 2, 2),
    (6, 32, 3, 2),
    (6, 64, 4, 2),
    (6, 96, 3, 1),
    (6, 160, 3, 2),
)
_TAPS = (1, 2, 4, 5)  # stages at strides 4, 8, 16, 32
TAP_CHANNELS = (24, 32, 96, 160)
_FROZEN_STAGES = 2  # not trained: the most general features, and the costliest to train
ENCODER_SCALE = 11 / 16  # of the input's sides: as fast as the network of `paani_models.segmenter.paper_network`
DECODER_CHANNELS = 48
DETAIL_CHANNELS = 16


class PadEnd(torch.autograd.Function):
    """One row of zeros below and one column to the right; exported with constant pads, which runtimes fold away."""

    @staticmethod
    def forward(_ctx: object, x: Tensor) -> Tensor:
        return F.pad(x, (0, 1, 0, 1))

    @staticmethod
    def backward(_ctx: object, gradient: Tensor) -> Tensor:
        return gradient[:, :, :-1, :-1]

    @staticmethod
    def symbolic(graph: Any, x: Any) -> Any:
        pads = graph.op("Constant", value_t=torch.tensor([0, 0, 0, 0, 0, 0, 1, 1]))
        return graph.op("Pad", x, pads, mode_s="constant")


class FoldedConv(nn.Module):
    """Convolution with bias, TensorFlow's SAME padding, and ReLU6 unless linear."""

    def __init__(
        self,
        cin: int,
        cout: int,
        kernel: int,
        stride: int = 1,
        groups: int = 1,
        linear: bool = False,
    ) -> None:
        super().__init__()
        self.conv = nn.Conv2d(cin, cout, kernel, stride, 0 if stride == 2 else kernel // 2, groups=groups)
        self.linear = linear

    def forward(self, x: Tensor) -> Tensor:
        if self.conv.stride[0] == 2:
            x = cast(Tensor, PadEnd.apply(x))
        y = cast(Tensor, self.conv(x))
        return y if self.linear else F.relu6(y)


class Block(nn.Module):
    """Expand, depthwise, linear projection; residual where the shape allows."""

    def __init__(self, cin: int, cout: int, expansion: int, stride: int) -> None:
        super().__init__()
        wide = cin * expansion
        expand = [FoldedConv(cin, wide, 1)] if expansion > 1 else []
        self.layers = nn.Sequential(
            *expand, FoldedConv(wide, wide, 3, stride, wide), FoldedConv(wide, cout, 1, linear=True)
        )
        self.residual = stride == 1 and cin == cout

    def forward(self, x: Tensor) -> Tensor:
        y = cast(Tensor, self.layers(x))
        return x + y if self.residual else y


def _conv_norm(cin: int, cout: int, kernel: int, stride: int = 1, groups: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(cin, cout, kernel, stride, kernel // 2, groups=groups, bias=False), nn.BatchNorm2d(cout), nn.ReLU()
    )


def _refinement(channels: int) -> nn.Sequential:
    return nn.Sequential(_conv_norm(channels, channels, 3, groups=channels), _conv_norm(channels, channels, 1))


class ShippedSegmenter(nn.Module):
    """RGB normalised as in `paani_models.catalogue`, float32 [N,3,H,W] (H, W multiples of 32) -> logits [N,3,H,W].

    The encoder sees a smaller picture; a thin branch at full size keeps the edges. Logits are interpolated between the
    middles of 4x4 pixels.
    """

    def __init__(self) -> None:
        super().__init__()
        self.stem = FoldedConv(3, 32, 3, 2)
        stages, channels = [], 32
        for expansion, width, repeats, stride in _STAGES:
            blocks = [
                Block(channels if n == 0 else width, width, expansion, stride if n == 0 else 1) for n in range(repeats)
            ]
            stages.append(nn.Sequential(*blocks))
            channels = width
        self.stages = nn.ModuleList(stages)
        width = DECODER_CHANNELS
        self.project = nn.Conv2d(TAP_CHANNELS[-1], width, 1)
        self.scene = nn.Conv2d(TAP_CHANNELS[-1], width, 1)
        self.laterals = nn.ModuleList(nn.Conv2d(c, width, 1) for c in TAP_CHANNELS[-2::-1])
        self.refines = nn.ModuleList(_refinement(width) for _ in TAP_CHANNELS[:-1])
        self.detail = nn.Sequential(
            _conv_norm(3, DETAIL_CHANNELS // 2, 3, 2),
            _conv_norm(DETAIL_CHANNELS // 2, DETAIL_CHANNELS, 3, 2),
            nn.Conv2d(DETAIL_CHANNELS, width, 1),
        )
        self.finish = _refinement(width)
        self.head = nn.Conv2d(width, len(SEGMENTER_CLASSES), 3, padding=1)
        self.register_buffer("scale", 2.0 * torch.tensor([0.229, 0.224, 0.225]).view(1, 3, 1, 1))
        self.register_buffer("shift", 2.0 * torch.tensor([0.485, 0.456, 0.406]).view(1, 3, 1, 1) - 1.0)

    def taps(self, x: Tensor) -> list[Tensor]:
        """Encoder outputs at strides 4, 8, 16, 32 of the encoder's own size (TAP_CHANNELS)."""
        height, width = _static_size(x)
        size = (int(height * ENCODER_SCALE), int(width * ENCODER_SCALE))
        x = F.interpolate(x, size=size, mode="bilinear", align_corners=False)
        x = self.stem(x * cast(Tensor, self.scale) + cast(Tensor, self.shift))
        taps = []
        for index, stage in enumerate(self.stages):
            x = stage(x)
            if index in _TAPS:
                taps.append(x)
        return taps

    def decode(self, taps: list[Tensor], x: Tensor) -> Tensor:
        """Encoder outputs, as `taps` gives them, and the input itself -> logits at the input's size."""
        *shallow, deepest = taps
        y = self.project(deepest) + F.relu(self.scene(deepest.mean((2, 3), keepdim=True)))
        for lateral, refine, tap in zip(self.laterals, self.refines, reversed(shallow), strict=True):
            y = refine(F.interpolate(y, size=_static_size(tap), mode="nearest") + lateral(tap))
        detail = self.detail(x)
        y = self.finish(F.interpolate(y, size=_static_size(detail), mode="bilinear", align_corners=False) + detail)
        return F.interpolate(self.head(y), scale_factor=4.0, mode="bilinear", align_corners=False)

    def forward(self, x: Tensor) -> Tensor:
        return self.decode(self.taps(x), x)

    def encoder(self) -> nn.ModuleList:
        """The part that `load_imagenet_encoder` fills."""
        return nn.ModuleList([self.stem, self.stages])


def _static_size(x: Tensor) -> tuple[int, int]:
    """Height and width as plain numbers, so that the exported graph is static."""
    return int(x.shape[2]), int(x.shape[3])


def load_imagenet_encoder(model: ShippedSegmenter, path: Path) -> None:
    """Fill the encoder and freeze its first stages. Raises UserError where the file does not fit."""
    try:
        weights = np.load(path)
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: {error}") from error
    convs = [module for module in model.encoder().modules() if isinstance(module, nn.Conv2d)]
    for index, conv in enumerate(convs):
        weight, bias = (
            torch.tensor(weights[f"conv{index:02d}.{part}"].astype(np.float32)) for part in ("weight", "bias")
        )
        if conv.weight.shape != weight.shape or conv.bias is None:
            raise UserError(
                f"{path}: conv{index:02d} has shape {tuple(weight.shape)}, expected {tuple(conv.weight.shape)}"
            )
        conv.weight.data, conv.bias.data = weight, bias
    for frozen in (model.stem, *list(model.stages)[:_FROZEN_STAGES]):
        frozen.requires_grad_(False)
