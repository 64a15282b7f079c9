"""Preprocessing: picture to network input, as the board does it (C3, D7, D8). Pictures are RGB uint8 [H,W,3]."""

from __future__ import annotations

import cv2
import numpy as np

from paani.arrays import F32, U8

MEAN = np.array([0.485, 0.456, 0.406], np.float32)  # D7
STD = np.array([0.229, 0.224, 0.225], np.float32)
SIZE_WH = (320, 256)  # of the segmenter, and of the paper's detector (C1, D5)
DETECTOR_SIZE_WH = (416, 320)  # of the shipped detector: small and far things are lost for want of pixels
PAD_GREY = 114  # grey level around a letterboxed picture, as YOLOX trains with
IMAGE_QUALITY_MIDDLE_WH, IMAGE_QUALITY_WH = (320, 240), (160, 120)


def segmenter_batch(pictures: U8) -> F32:
    """Network-sized pictures [N,H,W,3] -> float32 [N,3,H,W], normalised."""
    scaled = (pictures.astype(np.float32) / 255.0 - MEAN) / STD
    return np.ascontiguousarray(scaled.transpose(0, 3, 1, 2))


def detector_batch(pictures: U8) -> F32:
    """Network-sized pictures [N,H,W,3] -> float32 [N,3,H,W] in 0..1."""
    return np.ascontiguousarray((pictures.astype(np.float32) / 255.0).transpose(0, 3, 1, 2))


def segmenter_input(picture: U8) -> F32:
    """Any picture, stretched bilinearly -> [1,3,256,320]."""
    return segmenter_batch(np.asarray(cv2.resize(picture, SIZE_WH), np.uint8)[None])


def image_quality_input(picture: U8) -> F32:
    """Any picture, averaged down in two steps as the board's image-quality check does it -> [1,3,120,160]."""
    middle = cv2.resize(picture, IMAGE_QUALITY_MIDDLE_WH, interpolation=cv2.INTER_AREA)
    small = np.asarray(cv2.resize(middle, IMAGE_QUALITY_WH, interpolation=cv2.INTER_AREA), np.uint8)
    return detector_batch(small[None])


def letterbox_affine(source_wh: tuple[int, int], target_wh: tuple[int, int]) -> F32:
    """Source pixels -> network pixels, float32 [2,3]: aspect kept, centred (C3)."""
    scale = min(target_wh[0] / source_wh[0], target_wh[1] / source_wh[1])
    x, y = ((t - s * scale) / 2 for s, t in zip(source_wh, target_wh, strict=True))
    return np.array([[scale, 0, x], [0, scale, y]], np.float32)


def letterbox_picture(picture: U8, size_wh: tuple[int, int]) -> U8:
    """Any picture, resized bilinearly into the middle of a grey one of the network's size."""
    height, width = picture.shape[:2]
    scale = min(size_wh[0] / width, size_wh[1] / height)
    inner = (max(1, round(width * scale)), max(1, round(height * scale)))
    left, top = (size_wh[0] - inner[0]) // 2, (size_wh[1] - inner[1]) // 2
    boxed = np.full((size_wh[1], size_wh[0], 3), PAD_GREY, np.uint8)
    boxed[top : top + inner[1], left : left + inner[0]] = cv2.resize(picture, inner)
    return boxed


def detector_input(picture: U8, size_wh: tuple[int, int]) -> F32:
    """Any picture, letterboxed -> [1,3,H,W] in 0..1."""
    return detector_batch(letterbox_picture(picture, size_wh)[None])
