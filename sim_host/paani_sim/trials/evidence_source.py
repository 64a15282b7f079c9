"""Sources of a drive's evidence: rendered pictures through the boat's own perception, or ground truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from paani import messages as m
from paani.arrays import U8
from paani.config import Config
from paani.cores import load_perceiver
from paani_sim.eye.camera_faults import CameraFaults
from paani_sim.eye.configured_camera import boat_pose, open_eye
from paani_sim.worlds import Fault, World


class EvidenceSource(Protocol):
    """Gives evidence once per frame. Not thread-safe."""

    def observe(self, truth: m.TruePose, header: m.PictureHeader, roll_rad: float) -> EvidenceFrame | None:
        """Evidence at this pose and time; None if no picture came. `roll_rad` is the estimated roll."""
        ...

    def close(self) -> None:
        """Release its resources."""
        ...


@dataclass(frozen=True, eq=False)
class EvidenceFrame:
    """Evidence, and the picture `bgr` uint8 [H, W, 3] and `mask` uint8 [64, 80] that it came from, if any."""

    evidence: m.Evidence
    bgr: U8 | None = None
    mask: U8 | None = None


class CameraEvidenceSource:
    """Renders the picture, applies camera faults and runs perception. Raises UserError where OpenGL is missing."""

    def __init__(self, world: World, faults: Sequence[Fault], config: Config) -> None:
        self._faults = CameraFaults(faults)
        self._perceiver = load_perceiver(config.perception, _frozen_stopwatch_ms)
        self._renderer = open_eye(world, config.eye)

    def observe(self, truth: m.TruePose, header: m.PictureHeader, roll_rad: float) -> EvidenceFrame | None:
        """See `EvidenceSource`."""
        t_s = truth.sim_us * 1e-6
        bgr = self._faults.apply(self._renderer.render(boat_pose(truth), t_s, truth.actors_along_m).bgr, t_s)
        if bgr is None:
            return None
        evidence, mask = self._perceiver.perceive(bgr, header, 0.0, roll_rad)
        return EvidenceFrame(evidence, bgr, mask)

    def close(self) -> None:
        """See `EvidenceSource`."""
        self._perceiver.close()
        self._renderer.close()


def _frozen_stopwatch_ms() -> float:
    """A stopwatch that stands still, so that the durations in evidence are equal in equal drives."""
    return 0.0
