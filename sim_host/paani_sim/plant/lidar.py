"""A planar range scanner on the boat: beams all round, in the plane of its deck. Pure but for MuJoCo's ray casting.

It sees what rises above its plane: hulls, people who stand or sit, banks, piers and piles, but no swimmer.
"""

import math

import mujoco
import numpy as np

BEAMS = 360  # one a degree, as the common scanners of one turret have at 10 turns a second, or more
MIN_RANGE_M, MAX_RANGE_M = 0.1, 20.0  # of the same on dark hulls in daylight; on white ones they reach 25 to 40 m
RANGE_STD_M = 0.03  # of one echo, as their data sheets say
HEIGHT_M, FORWARD_M = 0.45, 0.0  # on a mast in the boat's middle, above whatever stands on deck
FIRST_BEARING_RAD, STEP_RAD = -math.pi, 2.0 * math.pi / BEAMS


class RangeScanner:
    """Casts the beams in a compiled model; the boat's own body is invisible to it."""

    def __init__(self, model: mujoco.MjModel, boat: int, floating_z_m: float, rng: np.random.Generator) -> None:
        """boat: number of its body, whose origin is `floating_z_m` above the water."""
        self._model, self._boat, self._rng = model, boat, rng
        self._mount_m = np.array([FORWARD_M, 0.0, HEIGHT_M - floating_z_m])
        bearings_rad = FIRST_BEARING_RAD + STEP_RAD * np.arange(BEAMS)
        self._beams = np.column_stack([np.cos(bearings_rad), np.sin(bearings_rad), np.zeros(BEAMS)])
        self._geoms, self._ranges_m = np.zeros(BEAMS, np.int32), np.zeros(BEAMS)

    def scan(self, data: mujoco.MjData) -> tuple[float, ...]:
        """The ranges [m] of one turn, by bearing; 0 where nothing was met. Noise is drawn for every beam."""
        rotation = data.xmat[self._boat].reshape(3, 3)
        mujoco.mj_multiRay(
            self._model,
            data,
            data.xpos[self._boat] + rotation @ self._mount_m,
            np.ravel(self._beams @ rotation.T),
            None,
            True,
            self._boat,
            self._geoms,
            self._ranges_m,
            None,
            BEAMS,
            MAX_RANGE_M,
        )
        measured_m = self._ranges_m + RANGE_STD_M * self._rng.standard_normal(BEAMS)
        is_met = (self._geoms >= 0) & (measured_m >= MIN_RANGE_M) & (measured_m <= MAX_RANGE_M)
        return tuple(np.where(is_met, np.round(measured_m, 3), 0.0).tolist())
