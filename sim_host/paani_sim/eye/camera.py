"""Camera on the bow: its pose, its field of view and the projection of points. Pure.

Pixel coordinates run from the top left corner; body is x forward, y left, z up.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from paani.arrays import F64
from paani_sim.eye.mesh import rotation

NEAR_M = 0.15
REST_Z_M = 0.177  # K6: height of the boat's origin at rest
FAR_M = 3000.0


@dataclass(frozen=True)
class BoatPose:
    """Position of the boat's origin in the map, attitude (roll, then pitch, then yaw) and yaw rate."""

    x_m: float
    y_m: float
    yaw_rad: float
    z_m: float = REST_Z_M
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rate_radps: float = 0.0


@dataclass(frozen=True)
class Camera:
    """A camera on the boat. At rest (origin at 0.177 m) it is 0.9 m above the water.

    `k1` and `k2` are the radial terms of Brown's lens model, over focal length: barrel below zero; a pinhole at zero.
    `shutter_s` is how long a picture is exposed while the boat turns.
    """

    width_px: int = 320
    height_px: int = 240
    hfov_deg: float = 70.0
    forward_m: float = 0.55
    up_m: float = 0.723
    down_deg: float = 6.0
    k1: float = 0.0
    k2: float = 0.0
    shutter_s: float = 0.0

    @property
    def focal_px(self) -> float:
        """Focal length; pixels are square."""
        return 0.5 * self.width_px / float(np.tan(0.5 * np.radians(self.hfov_deg)))


def camera_pose(pose: BoatPose, camera: Camera) -> tuple[F64, F64]:
    """Position `(3,)` and map-from-camera rotation `(3, 3)` (columns right, up, backward)."""
    body = rotation(pose.roll_rad, pose.pitch_rad, pose.yaw_rad)
    mount = rotation(0.0, np.radians(camera.down_deg), 0.0)
    axes = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    position = np.array([pose.x_m, pose.y_m, pose.z_m])
    position = position + body @ np.array([camera.forward_m, 0.0, camera.up_m])
    return position, body @ mount @ axes


def view_projection(pose: BoatPose, camera: Camera) -> F64:
    """Clip-from-map `(4, 4)`, OpenGL convention."""
    position, turn = camera_pose(pose, camera)
    view = np.eye(4)
    view[:3, :3] = turn.T
    view[:3, 3] = -turn.T @ position
    focal = camera.focal_px
    projection = np.zeros((4, 4))
    projection[0, 0] = 2.0 * focal / camera.width_px
    projection[1, 1] = 2.0 * focal / camera.height_px
    projection[2, 2] = -(FAR_M + NEAR_M) / (FAR_M - NEAR_M)
    projection[2, 3] = -2.0 * FAR_M * NEAR_M / (FAR_M - NEAR_M)
    projection[3, 2] = -1.0
    return projection @ view


def distort(points: F64, camera: Camera) -> F64:
    """Brown's radial distortion of pinhole image `points` `(n, 2)`; both from the middle, over focal length."""
    square = (points**2).sum(axis=1, keepdims=True)
    return np.asarray(points * (1.0 + camera.k1 * square + camera.k2 * square**2))


def project(points_m: F64, pose: BoatPose, camera: Camera) -> F64:
    """Pixel positions `(n, 2)` of map points `(n, 3)`; NaN for points behind the camera."""
    clip = np.column_stack([points_m, np.ones(len(points_m))]) @ view_projection(pose, camera).T
    depth = np.where(clip[:, 3] > NEAR_M, clip[:, 3], np.nan)
    u = (0.5 + 0.5 * clip[:, 0] / depth) * camera.width_px
    v = (0.5 - 0.5 * clip[:, 1] / depth) * camera.height_px
    if camera.k1 == 0.0 and camera.k2 == 0.0:
        return np.column_stack([u, v])
    middle = 0.5 * np.array([camera.width_px, camera.height_px])
    seen: F64 = distort((np.column_stack([u, v]) - middle) / camera.focal_px, camera) * camera.focal_px + middle
    return seen


def linear_depth_m(depth: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Distance along the optical axis of values of the depth buffer (0 near, 1 far); infinite for the far end."""
    ahead = 2.0 * FAR_M * NEAR_M / (FAR_M + NEAR_M - (2.0 * depth.astype(np.float64) - 1.0) * (FAR_M - NEAR_M))
    return np.where(depth >= 1.0, np.inf, ahead).astype(np.float32)
