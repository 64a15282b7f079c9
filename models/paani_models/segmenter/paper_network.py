"""The paper's segmenter: MobileNetV3-Small encoder (Howard et al. 2019), 64-channel top-down decoder (D1-D5).

Parameter names of the encoder follow torchvision's `mobilenet_v3_small().features`, so weights saved under
those names load unchanged.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from paani_models.datasets.sources import SEGMENTER_CLASSES

INPUT_HEIGHT_PX, INPUT_WIDTH_PX = 256, 320  # D5
PARAMETERS = 1_082_467  # D9

DECODER_CHANNELS = 64  # D2
TAPS = (1, 3, 8, 12)  # feature indices at strides 4, 8, 16, 32
TAP_CHANNELS = (16, 24, 48, 576)

# (kernel, expanded, out, squeeze-and-excite, hard-swish, stride): Howard et al. 2019, table 2.
_BLOCKS = (
    (3, 16, 16, True, False, 2),
    (3, 72, 24, False, False, 2),
    (3, 88, 24, False, False, 1),
    (5, 96, 40, True, True, 2),
    (5, 240, 40, True, True, 1),
    (5, 240, 40, True, True, 1),
    (5, 120, 48, True, True, 1),
    (5, 144, 48, True, True, 1),
    (5, 288, 96, True, True, 2),
    (5, 576, 96, True, True, 1),
    (5, 576, 96, True, True, 1),
)


def _round_to_multiple(channels: float, divisor: int = 8) -> int:
    rounded = max(divisor, int(channels + divisor / 2) // divisor * divisor)
    return rounded + divisor if rounded < 0.9 * channels else rounded


def _conv_norm(
    cin: int,
    cout: int,
    kernel: int,
    stride: int = 1,
    groups: int = 1,
    activation: nn.Module | None = None,
) -> nn.Sequential:
    layers: list[nn.Module] = [
        nn.Conv2d(cin, cout, kernel, stride, kernel // 2, groups=groups, bias=False),
        nn.BatchNorm2d(cout, eps=1e-3, momentum=0.03),
    ]
    if activation is not None:
        layers.append(activation)
    return nn.Sequential(*layers)


class SqueezeExcite(nn.Module):
    """Squeeze-and-excitation (Hu et al. 2018): each channel is scaled by a hard sigmoid of all channels' means."""

    def __init__(self, channels: int, squeezed: int) -> None:
        super().__init__()
        self.fc1 = nn.Conv2d(channels, squeezed, 1)
        self.fc2 = nn.Conv2d(squeezed, channels, 1)

    def forward(self, x: Tensor) -> Tensor:
        squeezed = F.relu(self.fc1(F.adaptive_avg_pool2d(x, 1)))
        return x * F.hardsigmoid(self.fc2(squeezed))


class InvertedResidual(nn.Module):
    """Expand, depthwise, squeeze-and-excite, project; residual where the shape allows."""

    def __init__(
        self,
        cin: int,
        kernel: int,
        expanded: int,
        cout: int,
        squeeze: bool,
        hard: bool,
        stride: int,
    ) -> None:
        super().__init__()

        def activation() -> nn.Module:
            return nn.Hardswish() if hard else nn.ReLU()

        layers: list[nn.Module] = []
        if expanded != cin:
            layers.append(_conv_norm(cin, expanded, 1, activation=activation()))
        layers.append(_conv_norm(expanded, expanded, kernel, stride, expanded, activation()))
        if squeeze:
            layers.append(SqueezeExcite(expanded, _round_to_multiple(expanded / 4)))
        layers.append(_conv_norm(expanded, cout, 1))
        self.block = nn.Sequential(*layers)
        self.residual = stride == 1 and cin == cout

    def forward(self, x: Tensor) -> Tensor:
        y = cast(Tensor, self.block(x))
        return x + y if self.residual else y


class PaperSegmenter(nn.Module):
    """RGB normalised as in `paani_models.catalogue`, float32 [N,3,H,W] (H, W multiples of 32) -> logits [N,3,H,W]."""

    def __init__(self) -> None:
        super().__init__()
        features: list[nn.Module] = [_conv_norm(3, 16, 3, 2, activation=nn.Hardswish())]
        channels = 16
        for kernel, expanded, cout, squeeze, hard, stride in _BLOCKS:
            features.append(InvertedResidual(channels, kernel, expanded, cout, squeeze, hard, stride))
            channels = cout
        features.append(_conv_norm(channels, 6 * channels, 1, activation=nn.Hardswish()))
        self.features = nn.ModuleList(features)
        width = DECODER_CHANNELS
        self.project = nn.Conv2d(TAP_CHANNELS[-1], width, 1)
        self.laterals = nn.ModuleList(nn.Conv2d(c, width, 1) for c in TAP_CHANNELS[-2::-1])
        self.refines = nn.ModuleList(
            nn.Sequential(nn.Conv2d(width, width, 3, padding=1, bias=False), nn.BatchNorm2d(width), nn.ReLU())
            for _ in TAP_CHANNELS[:-1]
        )
        self.head = nn.Conv2d(width, len(SEGMENTER_CLASSES), 3, padding=1)

    def taps(self, x: Tensor) -> list[Tensor]:
        """Encoder outputs at strides 4, 8, 16, 32."""
        outputs = []
        for index, layer in enumerate(self.features):
            x = layer(x)
            if index in TAPS:
                outputs.append(x)
        return outputs

    def decode(self, taps: list[Tensor]) -> Tensor:
        """Encoder outputs, as `taps` gives them -> logits at the input's size."""
        *shallow, deepest = taps
        y = self.project(deepest)
        for lateral, refine, tap in zip(self.laterals, self.refines, reversed(shallow), strict=True):
            y = refine(F.interpolate(y, scale_factor=2.0, mode="nearest") + lateral(tap))
        return F.interpolate(self.head(y), scale_factor=4.0, mode="nearest")

    def forward(self, x: Tensor) -> Tensor:
        return self.decode(self.taps(x))


def parameter_count(model: nn.Module) -> int:
    """Trainable parameters; batch-norm running statistics are buffers and do not count."""
    return sum(p.numel() for p in model.parameters() if p.requires_grad)


def segmenter_loss(logits: Tensor, target: Tensor) -> Tensor:
    """Cross-entropy plus Dice loss (Milletari et al. 2016), coefficient 1 each (S7).

    logits: float32 [N,3,H,W]. target: int64 [N,H,W], classes 0..2, 255 ignored by both terms.
    """
    valid = (target != 255).unsqueeze(1)
    entropy = F.cross_entropy(logits, target, ignore_index=255, reduction="sum") / valid.sum().clamp(min=1)
    one_hot = F.one_hot(target.clamp(max=logits.shape[1] - 1), logits.shape[1])
    truth = one_hot.permute(0, 3, 1, 2).to(logits.dtype) * valid
    probability = torch.softmax(logits, 1) * valid
    overlap = (probability * truth).sum((0, 2, 3))
    total = (probability + truth).sum((0, 2, 3))
    return entropy + 1.0 - ((2.0 * overlap + 1.0) / (total + 1.0)).mean()
