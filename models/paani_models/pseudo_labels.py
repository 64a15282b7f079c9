"""Masks by the teacher for pictures that people boxed but did not segment."""

from __future__ import annotations

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

from paani_models.network_input import SIZE_WH, segmenter_batch
from paani_models.segmenter import CLASSES
from paani_models.sources import IGNORE, Sample, read_boxes, read_picture
from paani_models.train_segmenter import CACHE_WH, CachedPicture
from paani_models.training import to_device

PSEUDO = "pseudo"
MIN_CONFIDENCE = 0.8
WATER = CLASSES.index("water")


@torch.no_grad()
def pseudo_labelled(teacher: torch.nn.Module, samples: list[Sample]) -> list[CachedPicture]:
    """The samples' pictures with the teacher's labels; what it is unsure of is ignored.

    Water inside a box that a person drew around a boat, person, pier or buoy is ignored too.
    """
    teacher.eval()
    cached = []
    for sample in tqdm(samples, desc="labelling", unit="picture", mininterval=5.0):
        rgb = read_picture(sample.picture)
        mask = teacher_mask(teacher, rgb)
        if sample.label is not None:
            mask = without_boxed_water(mask, read_boxes(sample.label))
        small = np.asarray(cv2.resize(rgb, CACHE_WH, interpolation=cv2.INTER_AREA), np.uint8)
        cached.append(CachedPicture(PSEUDO, small, mask))
    return cached


def teacher_mask(teacher: torch.nn.Module, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Labels CACHE_WH of one RGB picture, from the mean of it and its mirror image."""
    resized = np.asarray(cv2.resize(picture, SIZE_WH), np.uint8)
    pair = np.stack([resized, resized[:, ::-1]])
    share = torch.softmax(teacher(to_device(torch.from_numpy(segmenter_batch(pair)))), 1).cpu()
    confidence, label = ((share[0] + share[1].flip(2)) / 2).max(0)
    mask = torch.where(confidence >= MIN_CONFIDENCE, label, IGNORE).numpy().astype(np.uint8)
    return np.asarray(cv2.resize(mask, CACHE_WH, interpolation=cv2.INTER_NEAREST), np.uint8)


def without_boxed_water(mask: NDArray[np.uint8], boxes: NDArray[np.float32]) -> NDArray[np.uint8]:
    """The mask with water ignored inside the boxes float32 [n,5] (class, corners normalised)."""
    height, width = mask.shape
    mask = mask.copy()
    for x1, y1, x2, y2 in boxes[:, 1:] * (width, height, width, height):
        inside = mask[int(y1) : int(np.ceil(y2)), int(x1) : int(np.ceil(x2))]
        inside[inside == WATER] = IGNORE
    return mask
