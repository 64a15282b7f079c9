"""A small net that says whether a picture is fit to be evidence: 1 where the segmenter can be trusted on it."""

from __future__ import annotations

import torch
from torch import Tensor, nn

INPUT_HEIGHT_PX, INPUT_WIDTH_PX = 120, 160
WIDTHS = (16, 28, 40, 56)
HIDDEN = 48


class Gate(nn.Module):
    """RGB / 255 [N,3,120,160] -> fitness [N,1] in 0..1.

    The last map keeps its place in the picture: sky belongs above water, so a picture upside down is not fit.
    """

    def __init__(self) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        channels = 3
        for width in WIDTHS:
            layers += [
                nn.Conv2d(channels, width, 3, stride=2, padding=1, bias=False),
                nn.BatchNorm2d(width),
                nn.ReLU(inplace=True),
            ]
            channels = width
        self.features = nn.Sequential(*layers)
        self.pool = nn.AvgPool2d(2)
        self.head = nn.Sequential(
            nn.Flatten(), nn.Dropout(0.2), nn.Linear(channels * 4 * 5, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 1)
        )

    def logit(self, x: Tensor) -> Tensor:
        """Fitness before the sigmoid [N,1]."""
        return self.head(self.pool(self.features(x - 0.5)))

    def forward(self, x: Tensor) -> Tensor:
        """Fitness [N,1]."""
        return torch.sigmoid(self.logit(x))
