"""Settings of the thrusters of a hull, and of the speed controllers that its microcontroller drives."""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.autopilot import AutopilotConfig
from paani.config.section import Section
from paani.port_address import require_line


class EscConfig(Section, frozen=True):
    """One electronic speed controller; `paani calibrate thrusters` finds all three."""

    reversed: bool = False  # a longer pulse drives the boat astern
    trim_us: Annotated[int, msgspec.Meta(ge=-200, le=200)] = 0  # from `neutral_us` to where this side stands still
    deadband_us: Annotated[int, msgspec.Meta(ge=0, le=100)] = 0  # from there to where it begins to turn


class ThrustersConfig(Section, frozen=True):
    """The `thrusters` process. `line`: its own way to the microcontroller; empty: not known, or an autopilot drives."""

    line: str = ""
    rate_hz: Annotated[float, msgspec.Meta(ge=10.0, le=50.0)] = 20.0  # twice the controller's: one frame may be lost
    # Thrust that is not renewed for so long ends on the microcontroller's own clock; an unanswered call takes 250.
    lease_ms: Annotated[int, msgspec.Meta(ge=100, le=300)] = 300
    neutral_us: Annotated[int, msgspec.Meta(ge=1400, le=1600)] = 1500  # pulse at rest, of hobby speed controllers
    span_us: Annotated[int, msgspec.Meta(ge=100, le=500)] = 400  # from rest to full thrust, as theirs: 1100 to 1900
    # Of normalised thrust, where it grows: well above `controller.slew_per_s`, so that it bounds faults alone.
    slew_per_s: Annotated[float, msgspec.Meta(ge=0.1, le=10.0)] = 2.0
    min_battery_v: Annotated[float, msgspec.Meta(ge=0.0, le=65.0)] = 0.0  # below it no thrust; 0: no limit
    max_current_a: Annotated[float, msgspec.Meta(ge=0.0, le=327.0)] = 0.0  # above it no thrust; 0: no limit
    left: EscConfig = EscConfig()
    right: EscConfig = EscConfig()
    autopilot: AutopilotConfig = AutopilotConfig()

    @property
    def is_connected(self) -> bool:
        """Whether there is a way to the motors at all."""
        return bool(self.line or self.autopilot.line)

    def __post_init__(self) -> None:
        """The line is one, there is no second way to the motors, and a lease outlives two frames."""
        if self.line and self.autopilot.line:
            raise ValueError(
                "autopilot.line: thrusters.line is set too; thrust goes to a microcontroller or an autopilot"
            )
        if self.line:
            try:
                require_line(self.line)
            except ValueError as error:
                raise ValueError(f"line: {error}") from error
        for name, esc in (("left", self.left), ("right", self.right)):
            if esc.deadband_us >= self.span_us:
                raise ValueError(f"{name}.deadband_us {esc.deadband_us}: leaves nothing of span_us {self.span_us}")
        if self.lease_ms * self.rate_hz < 2 * 1000.0:
            raise ValueError(f"lease_ms {self.lease_ms}: shorter than two frames at rate_hz {self.rate_hz:g}")
