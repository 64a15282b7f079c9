"""Where a drive's evidence comes from: rendered pictures through the boat's own perception, or truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from paani import messages as m
from paani.config import Config, EyeConfig
from paani.cores import perceiver_of
from paani_sim.eye.camera import REST_Z_M, BoatPose, Camera
from paani_sim.eye.renderer import Eye
from paani_sim.trials.camera_faults import CameraFaults
from paani_sim.worlds import Fault, World

Bytes = NDArray[np.uint8]


class Eyes(Protocol):
    """Looks once per frame. Not for two threads."""

    def look(self, truth: m.TruePose, header: m.PictureHeader, roll_rad: float) -> Sight | None:
        """Evidence at this pose and time; None where no picture came. roll_rad: as the boat believes it to be."""
        ...

    def close(self) -> None:
        """Gives back what it holds."""
        ...


@dataclass(frozen=True, eq=False)
class Sight:
    """`bgr` uint8 [H, W, 3] and `mask` uint8 [64, 80] where there are any."""

    evidence: m.Evidence
    bgr: Bytes | None = None
    mask: Bytes | None = None


def camera_of(config: EyeConfig) -> Camera:
    """The configured camera."""
    return Camera(
        width_px=config.width_px,
        height_px=config.height_px,
        hfov_deg=config.hfov_deg,
        forward_m=config.camera_forward_m,
        up_m=config.camera_height_m - REST_Z_M,
        down_deg=config.pitch_down_deg,
    )


def pose_of(truth: m.TruePose) -> BoatPose:
    """Where the boat is and how it lies."""
    return BoatPose(truth.x_m, truth.y_m, truth.yaw_rad, truth.z_m, truth.roll_rad, truth.pitch_rad)


class CameraEyes:
    """Renders, breaks the picture where a fault says so, and perceives it. Raises UserError where OpenGL is missing."""

    def __init__(self, world: World, faults: Sequence[Fault], config: Config) -> None:
        self._faults = CameraFaults(faults)
        self._perceiver = perceiver_of(config.perception, _no_time)
        self._eye = Eye(world, camera_of(config.eye))
        self._eye.exposure *= config.eye.exposure_frac

    def look(self, truth: m.TruePose, header: m.PictureHeader, roll_rad: float) -> Sight | None:
        """See `Eyes`."""
        t_s = truth.sim_us * 1e-6
        bgr = self._faults.broken(self._eye.render(pose_of(truth), t_s).bgr, t_s)
        if bgr is None:
            return None
        evidence, mask = self._perceiver.perceive(bgr, header, 0.0, roll_rad)
        return Sight(evidence, bgr, mask)

    def close(self) -> None:
        """See `Eyes`."""
        self._perceiver.close()
        self._eye.close()


def _no_time() -> float:
    """Evidence says how long its steps took; equal drives are equal, so in a drive they take none."""
    return 0.0
