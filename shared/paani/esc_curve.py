"""The curve of an electronic speed controller: from normalised thrust to the width of its pulse, and back.

The microcontroller drives it by the first, and a simulated boat behind its pulses moves by the second, so that both
mean the same. Thrust is proportional to the pulse beyond the deadband on either side of rest.
"""

from __future__ import annotations

from paani.config import EscConfig, ThrustersConfig
from paani.geometry import clip


def rest_us(settings: ThrustersConfig, esc: EscConfig) -> int:
    """The pulse at which this side stands still."""
    return settings.neutral_us + esc.trim_us


def pulse_us(thrust: float, settings: ThrustersConfig, esc: EscConfig) -> float:
    """The pulse for this thrust, -1 to 1."""
    if thrust == 0.0:
        return float(rest_us(settings, esc))
    width_us = esc.deadband_us + abs(thrust) * (settings.span_us - esc.deadband_us)
    return rest_us(settings, esc) + (width_us if (thrust > 0.0) is not esc.reversed else -width_us)


def thrust_of(width_us: float, settings: ThrustersConfig, esc: EscConfig) -> float:
    """The thrust that this pulse gives, -1 to 1; none within the deadband, and none without a pulse."""
    if width_us <= 0.0:
        return 0.0
    from_rest_us = width_us - rest_us(settings, esc)
    beyond_us = abs(from_rest_us) - esc.deadband_us
    if beyond_us <= 0.0:
        return 0.0
    thrust = clip(beyond_us / (settings.span_us - esc.deadband_us), 0.0, 1.0)
    return thrust if (from_rest_us > 0.0) is not esc.reversed else -thrust
