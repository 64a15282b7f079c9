"""One picture of many annotated ones, in order and at even distances: to look at a whole folder at a glance."""

import cv2
import numpy as np

from paani.arrays import U8
from paani_tools.look.annotate import PAPER

COLUMNS, THUMBNAIL_PX, GAP_PX = 4, 480, 6
MOST = 48  # kept at once, an even number; with more, every second one goes


class ContactSheet:
    """Takes annotated pictures one by one and keeps few of them, whatever their number."""

    def __init__(self) -> None:
        self._kept: list[U8] = []
        self._every = 1
        self._seen = 0

    def add(self, bgr: U8) -> None:
        """bgr: uint8 [H, W, 3]."""
        if self._seen % self._every == 0:
            if len(self._kept) == MOST:
                self._kept = self._kept[::2]
                self._every *= 2
            height_px = max(1, round(bgr.shape[0] * THUMBNAIL_PX / bgr.shape[1]))
            small = cv2.resize(bgr, (THUMBNAIL_PX, height_px), interpolation=cv2.INTER_AREA)
            self._kept.append(np.asarray(small, np.uint8))
        self._seen += 1

    def compose(self) -> U8 | None:
        """The sheet, uint8 [H, W, 3]; None where nothing was added."""
        if not self._kept:
            return None
        rows = [self._kept[start : start + COLUMNS] for start in range(0, len(self._kept), COLUMNS)]
        return np.vstack([_row(row) for row in rows])


def _row(pictures: list[U8]) -> U8:
    height_px = max(picture.shape[0] for picture in pictures) + GAP_PX
    row = np.full((height_px, COLUMNS * (THUMBNAIL_PX + GAP_PX), 3), PAPER, np.uint8)
    for column, picture in enumerate(pictures):
        left = column * (THUMBNAIL_PX + GAP_PX)
        row[: picture.shape[0], left : left + THUMBNAIL_PX] = picture
    return row
