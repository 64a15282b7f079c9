"""Radial lens distortion: the pinhole picture that must be drawn, and the map from its pixels to the lens's."""

import dataclasses

import cv2
import numpy as np
import numpy.typing as npt

from paani.arrays import F64, U8
from paani.errors import UserError
from paani_sim.eye.camera import Camera

STEPS = 40
MAX_SCALE = 4.0  # times the picture's corner: no farther than this does a lens reach


class Optics:
    """`pinhole` is the camera to draw, `scale` times larger each way than the picture of `camera`.

    Raises `UserError` for a distortion that folds the picture over.
    """

    def __init__(self, camera: Camera, scale: float) -> None:
        self._size = (camera.width_px, camera.height_px)
        self._scale = scale
        columns, rows = np.arange(camera.width_px) + 0.5, np.arange(camera.height_px) + 0.5
        self._map: tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]] | None = None
        self.pinhole = camera
        if camera.k1 == 0.0 and camera.k2 == 0.0:
            self._rows = (rows * scale).astype(np.intp)[:, None]
            self._columns = (columns * scale).astype(np.intp)[None, :]
            return
        seen = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        middle = 0.5 * np.array(self._size)
        straight = _undistort((seen - middle) / camera.focal_px, camera)
        edge = np.vstack([np.abs(straight).max(axis=0), [0.5 * s / camera.focal_px for s in self._size]])
        wider = max(1.0, float((edge[0] / edge[1]).max()))
        half = wider * np.tan(0.5 * np.radians(camera.hfov_deg))
        hfov_deg = float(2.0 * np.degrees(np.arctan(half)))
        self.pinhole = dataclasses.replace(camera, hfov_deg=hfov_deg, k1=0.0, k2=0.0)
        drawn = (straight * self.pinhole.focal_px + middle) * scale
        limit = np.array(self._size) * scale - 1.0
        nearest = np.clip(drawn, 0.0, limit).astype(np.intp).reshape(camera.height_px, camera.width_px, 2)
        self._columns, self._rows = nearest[..., 0], nearest[..., 1]
        wide = (drawn - 0.5).astype(np.float32).reshape(camera.height_px, camera.width_px, 2)
        self._map = (np.ascontiguousarray(wide[..., 0]), np.ascontiguousarray(wide[..., 1]))

    def picture(self, drawn: U8) -> U8:
        """The picture of what was drawn, averaged down."""
        if self._map is not None:
            return np.asarray(cv2.remap(drawn, *self._map, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)
        if self._scale == 1.0:
            return drawn
        return np.asarray(cv2.resize(drawn, self._size, interpolation=cv2.INTER_AREA), np.uint8)

    def middle(self, drawn: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        """Of what was drawn, the value at the middle of each of the picture's pixels, between the nearest four."""
        if self._map is not None:
            return np.asarray(cv2.remap(drawn, *self._map, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
        return np.asarray(cv2.resize(drawn, self._size, interpolation=cv2.INTER_LINEAR), np.float32)

    def nearest(self, drawn: npt.NDArray[np.generic]) -> npt.NDArray[np.generic]:
        """Of what was drawn, the pixel in the middle of each of the picture's."""
        return drawn[self._rows, self._columns]


def _undistort(seen: F64, camera: Camera) -> F64:
    """Where a pinhole sees `(n, 2)` what the lens shows at `seen`; both from the middle, over focal length."""
    radius = np.maximum(np.hypot(seen[:, 0], seen[:, 1]), 1e-12)
    low, high = np.zeros_like(radius), np.full_like(radius, MAX_SCALE * radius.max())
    k1, k2 = camera.k1, camera.k2
    grid = np.linspace(0.0, high[0], 2000)
    rising = 1.0 + 3.0 * k1 * grid**2 + 5.0 * k2 * grid**4 > 0.0
    if not rising.all():
        high[:] = grid[max(int(np.argmin(rising)) - 1, 0)]
    if high[0] * (1.0 + k1 * high[0] ** 2 + k2 * high[0] ** 4) < radius.max():
        raise UserError(f"eye: distortion k1={k1:g} k2={k2:g} folds the picture over")
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        over = middle * (1.0 + k1 * middle**2 + k2 * middle**4) > radius
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    return np.asarray(seen * (low / radius)[:, None])
