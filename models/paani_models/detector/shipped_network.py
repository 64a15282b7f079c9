"""The shipped detector: YOLOX-nano (Ge et al. 2021) with batch norm folded away, four classes, joint scores.

Input RGB 0..1 float32 [N,3,H,W], sides multiples of 32; output float32 [N,8,A]: cx, cy, w, h in input pixels, then
the scores of person, vessel, pier, buoy, each objectness times class, in 0..1 (C1, C2, C4). Candidates run over
strides 8, 16, 32 in that order, row by row.
"""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from paani.errors import UserError
from paani_models.datasets.sources import DETECTOR_CLASSES
from paani_models.engines.onnx_file import read_onnx

STRIDES = (8, 16, 32)
HEAD_CHANNELS = 64
FOCUS_SHAPE = (12, 3, 3)  # of the first convolution's weights behind YOLOX's focus layer
FIRST_STAGES = ("stem", "dark2", "dark3")  # edges and parts, not objects; half of a pass

# Which of the 80 COCO rows each class of ours starts from: the nearest in kind, or in shape where COCO has no kind.
COCO_ROWS = {
    "person": (0,),
    "vessel": (8,),  # boat
    "pier": (13,),  # bench
    "buoy": (9, 10, 32),  # traffic light, fire hydrant, sports ball
}


class Conv(nn.Module):
    """Convolution with bias, then SiLU."""

    def __init__(self, cin: int, cout: int, kernel: int = 1, stride: int = 1, groups: int = 1) -> None:
        super().__init__()
        self.conv = nn.Conv2d(cin, cout, kernel, stride, (kernel - 1) // 2, groups=groups)

    def forward(self, x: Tensor) -> Tensor:
        return F.silu(self.conv(x))


def separable_conv(cin: int, cout: int, stride: int = 1) -> nn.Sequential:
    """Depthwise 3x3, then pointwise."""
    return nn.Sequential(Conv(cin, cin, 3, stride, groups=cin), Conv(cin, cout))


class Bottleneck(nn.Module):
    """Pointwise, separable 3x3; residual on request."""

    def __init__(self, channels: int, residual: bool) -> None:
        super().__init__()
        self.reduce = Conv(channels, channels)
        self.expand = separable_conv(channels, channels)
        self.residual = residual

    def forward(self, x: Tensor) -> Tensor:
        y = cast(Tensor, self.expand(self.reduce(x)))
        return x + y if self.residual else y


class CspLayer(nn.Module):
    """Cross-stage partial layer: half of the channels through `depth` bottlenecks, half past them."""

    def __init__(self, cin: int, cout: int, depth: int, residual: bool) -> None:
        super().__init__()
        half = cout // 2
        self.through = Conv(cin, half)
        self.past = Conv(cin, half)
        self.blocks = nn.Sequential(*(Bottleneck(half, residual) for _ in range(depth)))
        self.join = Conv(cout, cout)

    def forward(self, x: Tensor) -> Tensor:
        return cast(Tensor, self.join(torch.cat([self.blocks(self.through(x)), self.past(x)], 1)))


class PyramidPooling(nn.Module):
    """Spatial pyramid pooling over 5, 9 and 13 cells."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.reduce = Conv(channels, channels // 2)
        self.join = Conv(channels * 2, channels)

    def forward(self, x: Tensor) -> Tensor:
        y = self.reduce(x)
        return cast(
            Tensor,
            self.join(torch.cat([y, *(F.max_pool2d(y, k, 1, k // 2) for k in (5, 9, 13))], 1)),
        )


class Head(nn.Module):
    """One scale's predictions: [N, 4 box + 1 objectness + 4 class, H, W], all raw."""

    def __init__(self, cin: int) -> None:
        super().__init__()
        width = HEAD_CHANNELS
        self.stem = Conv(cin, width)
        self.class_tower = nn.Sequential(separable_conv(width, width), separable_conv(width, width))
        self.class_out = nn.Conv2d(width, len(DETECTOR_CLASSES), 1)
        self.box_tower = nn.Sequential(separable_conv(width, width), separable_conv(width, width))
        self.box_out = nn.Conv2d(width, 4, 1)
        self.object_out = nn.Conv2d(width, 1, 1)

    def forward(self, x: Tensor) -> Tensor:
        x = self.stem(x)
        classes = self.class_out(self.class_tower(x))
        box = self.box_tower(x)
        return torch.cat([self.box_out(box), self.object_out(box), classes], 1)


class Detector(nn.Module):
    """Modules are registered in the order in which they run, which `load_yolox_weights` relies on."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = Conv(3, 16, 6, 2)
        self.dark2 = nn.Sequential(separable_conv(16, 32, 2), CspLayer(32, 32, 1, residual=True))
        self.dark3 = nn.Sequential(separable_conv(32, 64, 2), CspLayer(64, 64, 3, residual=True))
        self.dark4 = nn.Sequential(separable_conv(64, 128, 2), CspLayer(128, 128, 3, residual=True))
        self.dark5 = nn.Sequential(
            separable_conv(128, 256, 2), PyramidPooling(256), CspLayer(256, 256, 1, residual=False)
        )
        self.narrow5 = Conv(256, 128)
        self.merge4 = CspLayer(256, 128, 1, residual=False)
        self.narrow4 = Conv(128, 64)
        self.merge3 = CspLayer(128, 64, 1, residual=False)
        self.down3 = separable_conv(64, 64, 2)
        self.out4 = CspLayer(128, 128, 1, residual=False)
        self.down4 = separable_conv(128, 128, 2)
        self.out5 = CspLayer(256, 256, 1, residual=False)
        self.heads = nn.ModuleList(Head(channels) for channels in (64, 128, 256))

    def first_stages(self, x: Tensor) -> Tensor:
        """Feature map at stride 8 (64 channels) of pictures [N,3,H,W], by the parts in FIRST_STAGES."""
        return cast(Tensor, self.dark3(self.dark2(self.stem(x))))

    def features(self, c3: Tensor) -> list[Tensor]:
        """What `first_stages` gives -> fused feature maps at strides 8, 16, 32 (64, 128, 256 channels)."""
        c4 = self.dark4(c3)
        c5 = self.narrow5(self.dark5(c4))
        p4 = self.narrow4(self.merge4(torch.cat([F.interpolate(c5, scale_factor=2.0), c4], 1)))
        p3 = self.merge3(torch.cat([F.interpolate(p4, scale_factor=2.0), c3], 1))
        n4 = self.out4(torch.cat([self.down3(p3), p4], 1))
        n5 = self.out5(torch.cat([self.down4(n4), c5], 1))
        return [p3, n4, n5]

    def raw(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Boxes cx, cy, w, h in input pixels [N,A,4], and logits [N,A,5]: objectness, then the classes."""
        return self.raw_after(self.first_stages(x))

    def raw_after(self, c3: Tensor) -> tuple[Tensor, Tensor]:
        """`raw` from what `first_stages` gives."""
        boxes, logits = [], []
        for feature, head, stride in zip(self.features(c3), self.heads, STRIDES, strict=True):
            output = head(feature)
            flat = output.flatten(2).transpose(1, 2)
            cells = cell_corners(output.shape[2], output.shape[3], output.device)
            centre = (flat[..., :2] + cells) * stride
            size = flat[..., 2:4].clamp(max=6.0).exp() * stride
            boxes.append(torch.cat([centre, size], 2))
            logits.append(flat[..., 4:])
        return torch.cat(boxes, 1), torch.cat(logits, 1)

    def forward(self, x: Tensor) -> Tensor:
        boxes, logits = self.raw(x)
        scores = torch.sigmoid(logits[..., :1]) * torch.sigmoid(logits[..., 1:])
        return torch.cat([boxes, scores], 2).transpose(1, 2)


def cell_corners(rows: int, columns: int, device: torch.device) -> Tensor:
    """Upper left corner (x, y) of every cell of a grid, in cells, row by row: float32 [rows * columns, 2]."""
    y, x = torch.meshgrid(torch.arange(rows, device=device), torch.arange(columns, device=device), indexing="ij")
    return torch.stack([x, y], 2).reshape(-1, 2).float()


def unfold_focus(weight: Tensor) -> Tensor:
    """The first convolution over whole pictures [N,3,6,6] that does what YOLOX's does over their quarters [N,12,3,3].

    Its focus layer takes every other row and column, four times, as twelve channels; without it the network is 8 %
    faster on a core.
    """
    by_column_and_row = weight.reshape(-1, 2, 2, 3, 3, 3)  # then colour, row, column
    return by_column_and_row.permute(0, 3, 4, 2, 5, 1).reshape(-1, 3, 6, 6)


def load_yolox_weights(model: Detector, path: Path) -> None:
    """Start from a YOLOX-nano ONNX file of 80 COCO classes, whose input is BGR 0..255.

    Its colour order and range go into the first convolution, so that the input here is RGB 0..1.
    Raises UserError where the file's convolutions are not those of this net.
    """
    from onnx import numpy_helper  # noqa: PLC0415

    graph = read_onnx(path).graph
    constants = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    theirs = [[constants[name] for name in node.input[1:3]] for node in graph.node if node.op_type == "Conv"]
    ours = [module for module in model.modules() if isinstance(module, nn.Conv2d)]
    if len(theirs) != len(ours):
        raise UserError(f"{path}: {len(theirs)} convolutions, expected {len(ours)}")
    rows = list(COCO_ROWS.values())
    class_convs = {id(cast(Head, head).class_out) for head in model.heads}
    for index, (conv, (stored, stored_bias)) in enumerate(zip(ours, theirs, strict=True)):
        weight, bias = stored, stored_bias
        if index == 0 and weight.shape[1:] == FOCUS_SHAPE:
            weight = unfold_focus(torch.tensor(weight)).numpy()[:, ::-1] * 255.0
        elif id(conv) in class_convs:
            weight = np.stack([weight[list(chosen)].mean(0) for chosen in rows])
            bias = np.stack([bias[list(chosen)].mean() for chosen in rows])
        expected = tuple(conv.weight.shape)
        if expected != weight.shape or conv.bias is None:
            raise UserError(f"{path}: convolution {index} has shape {weight.shape}, expected {expected}")
        conv.weight.data = torch.tensor(np.ascontiguousarray(weight, np.float32))
        conv.bias.data = torch.tensor(np.ascontiguousarray(bias, np.float32))


def count_candidates(height_px: int, width_px: int) -> int:
    """Candidates of an input size: 1,680 of the paper's 256x320 (C4)."""
    return sum((height_px // stride) * (width_px // stride) for stride in STRIDES)


def candidate_grid(height_px: int, width_px: int) -> tuple[Tensor, Tensor]:
    """Centre (x, y) in pixels [A,2] and stride [A] of every candidate of an input size."""
    centres, strides = [], []
    for stride in STRIDES:
        cells = cell_corners(height_px // stride, width_px // stride, torch.device("cpu"))
        centres.append((cells + 0.5) * stride)
        strides.append(torch.full((len(cells),), float(stride)))
    return torch.cat(centres), torch.cat(strides)
