"""Where a drive's evidence comes from: rendered pictures through the boat's own perception, or truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from paani import messages as m
from paani.arrays import U8
from paani.config import Config
from paani.cores import perceiver_of
from paani_sim.eye.camera_faults import CameraFaults
from paani_sim.eye.configured_camera import boat_pose, open_eye
from paani_sim.worlds import Fault, World


class EvidenceSource(Protocol):
    """Looks once per frame. Not for two threads."""

    def observe(self, truth: m.TruePose, header: m.PictureHeader, roll_rad: float) -> EvidenceFrame | None:
        """Evidence at this pose and time; None where no picture came. roll_rad: as the boat believes it to be."""
        ...

    def close(self) -> None:
        """Gives back what it holds."""
        ...


@dataclass(frozen=True, eq=False)
class EvidenceFrame:
    """`bgr` uint8 [H, W, 3] and `mask` uint8 [64, 80] where there are any."""

    evidence: m.Evidence
    bgr: U8 | None = None
    mask: U8 | None = None


class CameraEvidenceSource:
    """Renders, breaks the picture where a fault says so, and perceives it. Raises UserError where OpenGL is missing."""

    def __init__(self, world: World, faults: Sequence[Fault], config: Config) -> None:
        self._faults = CameraFaults(faults)
        self._perceiver = perceiver_of(config.perception, _frozen_stopwatch_ms)
        self._renderer = open_eye(world, config.eye)

    def observe(self, truth: m.TruePose, header: m.PictureHeader, roll_rad: float) -> EvidenceFrame | None:
        """See `Eyes`."""
        t_s = truth.sim_us * 1e-6
        bgr = self._faults.apply(self._renderer.render(boat_pose(truth), t_s, truth.actors_along_m).bgr, t_s)
        if bgr is None:
            return None
        evidence, mask = self._perceiver.perceive(bgr, header, 0.0, roll_rad)
        return EvidenceFrame(evidence, bgr, mask)

    def close(self) -> None:
        """See `Eyes`."""
        self._perceiver.close()
        self._renderer.close()


def _frozen_stopwatch_ms() -> float:
    """Evidence says how long its steps took; equal drives are equal, so in a drive they take none."""
    return 0.0
