"""The image-quality network: MobileNetV2 (Sandler et al. 2018) down to stride 16, then two dense layers.

It estimates a picture's fitness to be evidence: 1 where the segmenter can be trusted on it.
"""

from __future__ import annotations

from pathlib import Path

import torch
from onnx import numpy_helper
from torch import Tensor, nn

from paani.errors import UserError
from paani_models.engines.onnx_file import read_onnx
from paani_models.segmenter.shipped_network import ShippedSegmenter, load_imagenet_encoder

INPUT_HEIGHT_PX, INPUT_WIDTH_PX = 120, 160
FRONT_STAGES, FRONT_CHANNELS = 4, 64  # of MobileNetV2, down to stride 16
MIXED_CHANNELS, HIDDEN = 48, 48
ROWS, COLUMNS = 3, 5  # of the last map, after pooling
FROZEN_STAGES = 2  # not trained, as in the segmenter: the most general features, and the costliest to train


class ImageQualityNetwork(nn.Module):
    """RGB / 255 [N,3,120,160] -> fitness [N,1] in 0..1.

    The dense layers see where in the picture each feature lies: sky belongs above water, so a picture upside down is
    unfit. Attribute names are those of stored checkpoints.
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


def start_from_imagenet(network: ImageQualityNetwork, path: Path) -> None:
    """Fill the convolutional front from ImageNet weights and freeze its first stages.

    Raises UserError where the file does not fit.
    """
    whole = ShippedSegmenter()
    load_imagenet_encoder(whole, path)
    for layer, pretrained_layer in zip(network.front, (whole.stem, *whole.stages), strict=False):
        layer.load_state_dict(pretrained_layer.state_dict())
    for frozen_layer in list(network.front)[: 1 + FROZEN_STAGES]:
        frozen_layer.requires_grad_(False)


def start_from_export(network: ImageQualityNetwork, path: Path) -> None:
    """Fill the network from its own export, which has no normalisation to fold and so keeps every weight's name.

    Raises UserError where the file is no export of it.
    """
    stored = read_onnx(path).graph.initializer
    try:
        network.load_state_dict({each.name: torch.tensor(numpy_helper.to_array(each)) for each in stored})
    except RuntimeError as error:
        raise UserError(f"{path}: no export of the image-quality network") from error
