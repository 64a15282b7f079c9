"""Fallback segmentation by colour thresholds, for when there is no learned segmenter (F1-F4). Pure.

Its mask is for people to look at and never eligible for navigation: evidence made with it names its source.
"""

import cv2
import numpy as np

from paani.arrays import U8
from paani_services.perception.corridors import OBSTACLE, SKY, WATER

GRID_WH = (80, 64)  # cells of the mask
# OpenCV ranges: hue 0..179, saturation and value 0..255.
WATER_HUE = (80, 135)  # cyan to blue
WATER_MIN_SATURATION = 25
GREY_MAX_SATURATION = 60  # less colour than this is grey, as water under clouds
WATER_MIN_VALUE = 30
SKY_MIN_VALUE = 150
HORIZON = 0.45  # fraction of the height from the top; above it bright cells are sky
FALLBACK_CONFIDENCE = 0.5  # of every cell: thresholds state none


def segment_by_colour(bgr: U8) -> U8:
    """Class mask uint8 [64, 80]: bluish or grey cells below the horizon are water, bright ones above it are sky."""
    small = cv2.resize(bgr, GRID_WH, interpolation=cv2.INTER_AREA)
    hue, saturation, value = cv2.split(cv2.cvtColor(small, cv2.COLOR_BGR2HSV))
    bluish = (hue >= WATER_HUE[0]) & (hue <= WATER_HUE[1]) & (saturation >= WATER_MIN_SATURATION)
    is_water = (bluish | (saturation <= GREY_MAX_SATURATION)) & (value >= WATER_MIN_VALUE)
    is_above = (np.arange(GRID_WH[1]) < HORIZON * GRID_WH[1])[:, None]
    mask = np.full(is_water.shape, OBSTACLE, np.uint8)
    mask[is_water & ~is_above] = WATER
    mask[(value >= SKY_MIN_VALUE) & is_above] = SKY
    return mask
