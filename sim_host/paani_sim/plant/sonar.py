"""A single-beam echo sounder that looks straight down. Pure: depth, time and generator in."""

import math

import numpy as np

from paani.config import SensorsConfig
from paani_sim.worlds.faults import Fault, FaultKind, find_active_fault

RESOLUTION_DIGITS = 3  # millimetres, as such devices report them


class Sonar:
    """Measures from its transducer at the keel, `draught_m` under the water's surface at rest."""

    def __init__(self, config: SensorsConfig, draught_m: float, rng: np.random.Generator) -> None:
        self._config, self._draught_m, self._rng = config, draught_m, rng
        self._last_m = math.nan

    def measure(self, depth_m: float, heave_m: float, faults: tuple[Fault, ...], t_s: float) -> float | None:
        """Depth of the water as the device has it, which knows of no heave; None where no echo comes back.

        depth_m: of the water at rest. heave_m: how far the hull is above where it floats at rest.
        """
        config = self._config
        draw = float(self._rng.standard_normal())
        frozen = find_active_fault(faults, FaultKind.SONAR_FROZEN, t_s)
        if frozen is not None and (frozen.amount > 0.0 or math.isfinite(self._last_m)):
            return frozen.amount if frozen.amount > 0.0 else self._last_m
        range_m = depth_m - self._draught_m + heave_m
        if not config.sonar_min_m <= range_m <= config.sonar_max_m:
            return None
        measured_m = range_m + math.hypot(config.sonar_std_m, config.sonar_std_frac * range_m) * draw
        self._last_m = round(max(measured_m, 0.0) + self._draught_m, RESOLUTION_DIGITS)
        return self._last_m
