"""The paper's detector: YOLO11n's published architecture, 2,582,932 parameters once batch norm is folded (C12).

Written from the architecture's description, with no code or weights of its authors. Same contract as
`paani_models.detector.shipped_network`: RGB 0..1 float32 [N,3,H,W] (H, W multiples of 32) -> float32 [N,8,A], rows
cx, cy, w, h in input pixels, then the scores of person, vessel, pier, buoy in 0..1; candidates over strides 8, 16,
32, row by row.
"""

from __future__ import annotations

from copy import deepcopy
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from paani_models.datasets.sources import DETECTOR_CLASSES
from paani_models.detector.shipped_network import cell_corners

STRIDES = (8, 16, 32)
FUSED_PARAMETERS = 2_582_932  # C12
BINS = 16  # of the distribution over each side's distance, one stride each (Li et al. 2020, GFL)
HEAD_CHANNELS = 64
SCORE_PRIOR = 0.01  # of an untrained network, so that background does not swamp the first steps


class Conv(nn.Module):
    """Convolution, batch norm, SiLU unless linear."""

    def __init__(
        self, cin: int, cout: int, kernel: int = 1, stride: int = 1, groups: int = 1, linear: bool = False
    ) -> None:
        super().__init__()
        self.conv = nn.Conv2d(cin, cout, kernel, stride, kernel // 2, groups=groups, bias=False)
        self.norm = nn.BatchNorm2d(cout, eps=1e-3, momentum=0.03)
        self.linear = linear

    def forward(self, x: Tensor) -> Tensor:
        y = self.norm(self.conv(x))
        return cast(Tensor, y if self.linear else F.silu(y))


class ResidualBlock(nn.Module):
    """Two 3x3 convolutions beside the identity."""

    def __init__(self, channels: int, inner: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(Conv(channels, inner, 3), Conv(inner, channels, 3))

    def forward(self, x: Tensor) -> Tensor:
        return x + cast(Tensor, self.layers(x))


class NestedCspBlock(nn.Module):
    """Nested cross-stage partial block (C3k): half of the channels through two residual blocks, half past them."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        half = channels // 2
        self.through, self.past = Conv(channels, half), Conv(channels, half)
        self.blocks = nn.Sequential(ResidualBlock(half, half), ResidualBlock(half, half))
        self.join = Conv(channels, channels)

    def forward(self, x: Tensor) -> Tensor:
        return cast(Tensor, self.join(torch.cat([self.blocks(self.through(x)), self.past(x)], 1)))


class CspBlock(nn.Module):
    """Cross-stage partial block (C3k2): two halves, one also through a block, all joined. deep: the block is nested."""

    def __init__(self, cin: int, cout: int, deep: bool, inner_frac: float = 0.5) -> None:
        super().__init__()
        self.inner = inner = int(cout * inner_frac)
        self.open = Conv(cin, 2 * inner)
        self.block = NestedCspBlock(inner) if deep else ResidualBlock(inner, inner // 2)
        self.join = Conv(3 * inner, cout)

    def forward(self, x: Tensor) -> Tensor:
        kept, last = self.open(x).split([self.inner, self.inner], 1)
        return cast(Tensor, self.join(torch.cat([kept, last, self.block(last)], 1)))


class PyramidPooling(nn.Module):
    """Spatial pyramid pooling (SPPF): one 5x5 maximum after another, all kept."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.reduce, self.join = Conv(channels, channels // 2), Conv(2 * channels, channels)

    def forward(self, x: Tensor) -> Tensor:
        levels = [self.reduce(x)]
        for _ in range(3):
            levels.append(F.max_pool2d(levels[-1], 5, 1, 2))
        return cast(Tensor, self.join(torch.cat(levels, 1)))


class Attention(nn.Module):
    """Multi-head self-attention over cells (Vaswani et al. 2017); a depthwise convolution encodes their position."""

    def __init__(self, channels: int, heads: int) -> None:
        super().__init__()
        self.heads, self.value, self.key = heads, channels // heads, channels // heads // 2
        self.project_in = Conv(channels, channels + 2 * heads * self.key, linear=True)
        self.project_out = Conv(channels, channels, linear=True)
        self.place = Conv(channels, channels, 3, groups=channels, linear=True)

    def forward(self, x: Tensor) -> Tensor:
        count, channels, height, width = (int(side) for side in x.shape)
        mixed = self.project_in(x).view(count, self.heads, 2 * self.key + self.value, height * width)
        query, key, value = mixed.split([self.key, self.key, self.value], 2)
        weight = torch.softmax(query.transpose(2, 3) @ key * self.key**-0.5, 3)
        seen = (value @ weight.transpose(2, 3)).reshape(count, channels, height, width)
        return cast(Tensor, self.project_out(seen + self.place(value.reshape(count, channels, height, width))))


class PartialAttention(nn.Module):
    """Half of the channels past, half through self-attention and a small dense network (C2PSA)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.half = half = channels // 2
        self.open, self.join = Conv(channels, channels), Conv(channels, channels)
        self.attention = Attention(half, max(1, half // 64))
        self.dense = nn.Sequential(Conv(half, 2 * half), Conv(2 * half, half, linear=True))

    def forward(self, x: Tensor) -> Tensor:
        past, through = self.open(x).split([self.half, self.half], 1)
        through = through + self.attention(through)
        return cast(Tensor, self.join(torch.cat([past, through + self.dense(through)], 1)))


class Head(nn.Module):
    """One scale: distances' distributions [N, 4 * BINS, H, W] and class logits [N, 4, H, W]."""

    def __init__(self, cin: int) -> None:
        super().__init__()
        width, kinds = HEAD_CHANNELS, len(DETECTOR_CLASSES)
        self.box = nn.Sequential(Conv(cin, width, 3), Conv(width, width, 3), nn.Conv2d(width, 4 * BINS, 1))
        self.kind = nn.Sequential(
            *(Conv(cin, cin, 3, groups=cin), Conv(cin, width)),
            *(Conv(width, width, 3, groups=width), Conv(width, width)),
            nn.Conv2d(width, kinds, 1),
        )
        nn.init.constant_(self.box[-1].bias, 1.0)
        nn.init.constant_(self.kind[-1].bias, float(torch.logit(torch.tensor(SCORE_PRIOR))))

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        return self.box(x), self.kind(x)


class Yolo11n(nn.Module):
    """Backbone to stride 32, a path up and a path down again, one head per stride."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Sequential(Conv(3, 16, 3, 2), Conv(16, 32, 3, 2), CspBlock(32, 64, False, 0.25))
        self.to8 = nn.Sequential(Conv(64, 64, 3, 2), CspBlock(64, 128, False, 0.25))
        self.to16 = nn.Sequential(Conv(128, 128, 3, 2), CspBlock(128, 128, True))
        self.to32 = nn.Sequential(
            Conv(128, 256, 3, 2), CspBlock(256, 256, True), PyramidPooling(256), PartialAttention(256)
        )
        self.up16, self.up8 = CspBlock(384, 128, False), CspBlock(256, 64, False)
        self.down16, self.out16 = Conv(64, 64, 3, 2), CspBlock(192, 128, False)
        self.down32, self.out32 = Conv(128, 128, 3, 2), CspBlock(384, 256, True)
        self.heads = nn.ModuleList(Head(channels) for channels in (64, 128, 256))
        # The expected distance is a fixed convolution in the paper's count of parameters.
        self.bins = nn.Parameter(torch.arange(BINS, dtype=torch.float32).view(1, BINS, 1, 1), requires_grad=False)

    def features(self, x: Tensor) -> list[Tensor]:
        """Fused feature maps at strides 8, 16, 32 (64, 128, 256 channels)."""
        c3 = self.to8(self.stem(x))
        c4 = self.to16(c3)
        c5 = self.to32(c4)
        p4 = self.up16(torch.cat([F.interpolate(c5, scale_factor=2.0), c4], 1))
        p3 = self.up8(torch.cat([F.interpolate(p4, scale_factor=2.0), c3], 1))
        n4 = self.out16(torch.cat([self.down16(p3), p4], 1))
        n5 = self.out32(torch.cat([self.down32(n4), c5], 1))
        return [p3, n4, n5]

    def raw(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Corner boxes in pixels [N,A,4], distributions over the distances to the four sides as logits
        [N,A,4,BINS], class logits [N,A,4]."""
        boxes, bins, kinds = [], [], []
        for feature, head, stride in zip(self.features(x), self.heads, STRIDES, strict=True):
            box, kind = head(feature)
            count, _, height, width = (int(side) for side in box.shape)
            spread = box.view(count, 4, BINS, height * width)
            distance = F.conv2d(torch.softmax(spread.transpose(1, 2), 1), self.bins).squeeze(1).transpose(1, 2)
            centre = cell_corners(height, width, x.device) + 0.5
            boxes.append(torch.cat([centre - distance[..., :2], centre + distance[..., 2:]], 2) * stride)
            bins.append(spread.permute(0, 3, 1, 2))
            kinds.append(kind.flatten(2).transpose(1, 2))
        return torch.cat(boxes, 1), torch.cat(bins, 1), torch.cat(kinds, 1)

    def forward(self, x: Tensor) -> Tensor:
        boxes, _, kinds = self.raw(x)
        low, high = boxes.chunk(2, 2)
        return torch.cat([(low + high) / 2, high - low, torch.sigmoid(kinds)], 2).transpose(1, 2)


def fuse_batch_norm(net: Yolo11n) -> Yolo11n:
    """A copy that computes the same with every batch norm folded into its convolution; for counting and running."""
    net = deepcopy(net).eval()
    for module in net.modules():
        if isinstance(module, Conv):
            module.conv = torch.nn.utils.fusion.fuse_conv_bn_eval(module.conv, module.norm)
            module.norm = nn.Identity()
    return net
