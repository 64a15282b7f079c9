"""Pseudo-labels (Lee 2013) for pictures that nobody segmented: confident predictions become masks, the rest is ignored.

Ours: predictions are averaged with those of the mirrored picture, and water or sky in the core of a box is ignored.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from tqdm import tqdm

from paani_models.datasets.sources import IGNORE, Sample, read_boxes
from paani_models.network_input import SIZE_WH, segmenter_batch
from paani_models.segmenter.train import UNSEGMENTED, CachedPicture
from paani_models.training.training_state import to_device, training_device

MIN_PROBABILITY = 0.9  # mean class probability from which a prediction becomes a label
OBSTACLE = 1
BOX_CORE_HALF_FRAC = 0.3  # half side of the part of a box, as a share of its sides, that is surely the boxed thing


@torch.no_grad()
def pseudo_label_pictures(net: nn.Module, pictures: list[CachedPicture], samples: list[Sample]) -> list[CachedPicture]:
    """Give the pictures of UNSEGMENTED masks of the network's confident predictions; the others stay as they are.

    pictures[i] was made of samples[i]; the order stays. In the core of a box only obstacle is accepted.
    """
    net.eval().to(training_device())
    labelled = []
    for item, sample in zip(tqdm(pictures, "labelling", unit="picture", mininterval=2.0), samples, strict=True):
        if item.source != UNSEGMENTED:
            labelled.append(item)
            continue
        resized = np.asarray(cv2.resize(item.picture, SIZE_WH), np.uint8)
        both = torch.from_numpy(segmenter_batch(np.stack([resized, resized[:, ::-1]])))
        share = torch.softmax(net(to_device(both)), 1)
        mean = ((share[0] + share[1].flip(-1)) / 2).cpu().numpy()
        mask = np.where(mean.max(0) >= MIN_PROBABILITY, mean.argmax(0), IGNORE).astype(np.uint8)
        height, width = item.mask.shape
        mask = np.asarray(cv2.resize(mask, (width, height), interpolation=cv2.INTER_NEAREST), np.uint8)
        if sample.label is not None:
            mask = ignore_box_cores(mask, read_boxes(sample.label))
        labelled.append(replace(item, mask=mask))
    return labelled


def ignore_box_cores(mask: NDArray[np.uint8], boxes: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Ignore water and sky in the middle of boxes [n,5] (class, corners, normalised)."""
    height, width = mask.shape
    cleaned = mask.copy()
    for _, x1, y1, x2, y2 in boxes:
        x, y, w, h = (x1 + x2) / 2 * width, (y1 + y2) / 2 * height, (x2 - x1) * width, (y2 - y1) * height
        core = cleaned[
            max(0, int(y - BOX_CORE_HALF_FRAC * h)) : int(y + BOX_CORE_HALF_FRAC * h) + 1,
            max(0, int(x - BOX_CORE_HALF_FRAC * w)) : int(x + BOX_CORE_HALF_FRAC * w) + 1,
        ]
        core[core != OBSTACLE] = IGNORE
    return cleaned
