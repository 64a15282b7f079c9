"""A mask from colours alone, for when there is no learned segmenter (F1-F4). Pure.

For people to look at. It is not learned and never eligible for navigation: whoever uses it must say so.
"""

import cv2
import numpy as np

from paani.arrays import U8
from paani_services.perception.corridors import OBSTACLE, SKY, WATER

GRID_WH = (80, 64)
# OpenCV ranges: hue 0..179, saturation and value 0..255.
WATER_HUE = (80, 135)
WATER_MIN_SATURATION = 25
GREY_MAX_SATURATION = 60
WATER_MIN_VALUE = 30
SKY_MIN_VALUE = 150
HORIZON = 0.45  # normalised height above which bright cells are sky
CONFIDENCE = 0.5


def colour_mask(bgr: U8) -> U8:
    """uint8 [64, 80]: bluish or greyish cells below the horizon are water, bright ones above it sky."""
    small = cv2.resize(bgr, GRID_WH, interpolation=cv2.INTER_AREA)
    hue, saturation, value = cv2.split(cv2.cvtColor(small, cv2.COLOR_BGR2HSV))
    bluish = (hue >= WATER_HUE[0]) & (hue <= WATER_HUE[1]) & (saturation >= WATER_MIN_SATURATION)
    watery = (bluish | (saturation <= GREY_MAX_SATURATION)) & (value >= WATER_MIN_VALUE)
    above = (np.arange(GRID_WH[1]) < HORIZON * GRID_WH[1])[:, None]
    mask = np.full(watery.shape, OBSTACLE, np.uint8)
    mask[watery & ~above] = WATER
    mask[(value >= SKY_MIN_VALUE) & above] = SKY
    return mask
