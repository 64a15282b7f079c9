"""A small net that says whether a picture is fit to be evidence: 1 where the segmenter can be trusted on it."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor, nn

from paani_models.segmenter.shipped_network import ShippedSegmenter, load_imagenet_encoder

INPUT_HEIGHT_PX, INPUT_WIDTH_PX = 120, 160
FRONT_STAGES, FRONT_CHANNELS = 4, 64  # of MobileNetV2, down to stride 16
MIXED_CHANNELS, HIDDEN = 48, 48
ROWS, COLUMNS = 3, 5  # of the last map, after pooling
FROZEN_STAGES = 2  # as in the segmenter: general, and the dearest to train


class ImageQualityNetwork(nn.Module):
    """RGB / 255 [N,3,120,160] -> fitness [N,1] in 0..1.

    The last map keeps its place in the picture: sky belongs above water, so a picture upside down is not fit.
    """

    def __init__(self) -> None:
        super().__init__()
        whole = ShippedSegmenter()
        self.front = nn.Sequential(whole.stem, *list(whole.stages)[:FRONT_STAGES])
        self.mix = nn.Sequential(
            nn.Conv2d(FRONT_CHANNELS, MIXED_CHANNELS, 1), nn.ReLU(), nn.AvgPool2d((3, 2), stride=2)
        )
        self.head = nn.Sequential(
            nn.Flatten(),
            nn.Dropout(0.2),
            nn.Linear(MIXED_CHANNELS * ROWS * COLUMNS, HIDDEN),
            nn.ReLU(),
            nn.Linear(HIDDEN, 1),
        )

    def logit(self, x: Tensor) -> Tensor:
        """Fitness before the sigmoid [N,1]."""
        return self.head(self.mix(self.front(2.0 * x - 1.0)))

    def forward(self, x: Tensor) -> Tensor:
        """Fitness [N,1]."""
        return torch.sigmoid(self.logit(x))


def start_from_imagenet(gate: ImageQualityNetwork, path: Path) -> None:
    """Fill the front and freeze its first stages. Raises UserError where the file does not fit."""
    whole = ShippedSegmenter()
    load_imagenet_encoder(whole, path)
    for own, given in zip(gate.front, (whole.stem, *whole.stages), strict=False):
        own.load_state_dict(given.state_dict())
    for frozen in list(gate.front)[: 1 + FROZEN_STAGES]:
        frozen.requires_grad_(False)
