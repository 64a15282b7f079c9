"""Force from the pulses that an emulated microcontroller gives its speed controllers (hardware in the loop).

The emulator's bench port is a logic analyser: at 50 Hz, and whenever they change, it writes what its timer and its
enable line hold, as lines `pwm LEFT_US RIGHT_US ENABLE MCU_MS`. No pulses, or none of late, are no force.
"""

from __future__ import annotations

import asyncio
import logging
import re
from typing import NamedTuple

from paani.clock import Clock
from paani.config import Config
from paani.esc_curve import thrust_of
from paani.serial_port import PortError, open_port

LOG = logging.getLogger(__name__)
LINE = re.compile(rb"pwm (\d{1,5}) (\d{1,5}) ([01]) (\d{1,10})")
MISSING_S = 0.1  # five periods of the bench port
MAX_LINE_BYTES = 64
RETRY_S = 0.25


class Pulses(NamedTuple):
    """What the timer and the enable line hold."""

    left_us: int
    right_us: int
    is_enabled: bool
    mcu_ms: int


class PulseInput:
    """The newest pulses, and the force that they give. `run` keeps the line open."""

    def __init__(self, config: Config, clock: Clock) -> None:
        self._config, self._clock = config, clock
        self._pulses: Pulses | None = None
        self._received_us = 0
        self._rest = b""
        self.unreadable = 0

    async def run(self) -> None:
        """Read until cancelled; a line that breaks is opened again."""
        address, last = self._config.plant.pwm_line, ""
        while True:
            try:
                port = await open_port(address)
                try:
                    while True:
                        self.feed(await port.read(), self._clock.now_us())
                finally:
                    await port.close()
            except PortError as error:
                if str(error) != last:
                    LOG.warning("%s", error)
                last = str(error)
            self._rest = b""
            await asyncio.sleep(RETRY_S)

    def feed(self, data: bytes, now_us: int) -> None:
        """Take bytes as they come; a line that is no pulse is counted."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-MAX_LINE_BYTES:]
        for line in lines:
            match = LINE.fullmatch(line.strip())
            if match is None:
                self.unreadable += 1
                continue
            left_us, right_us, enabled, mcu_ms = (int(part) for part in match.groups())
            self._pulses, self._received_us = Pulses(left_us, right_us, bool(enabled), mcu_ms), now_us

    def is_live(self, now_us: int) -> bool:
        """Whether pulses have come lately."""
        return self._pulses is not None and now_us - self._received_us <= MISSING_S * 1e6

    def forces_n(self, now_us: int) -> tuple[float, float]:
        """Force of both fans: zero without pulses, with old ones, and while the enable line is dead."""
        pulses, settings = self._pulses, self._config.thrusters
        if pulses is None or not self.is_live(now_us) or not pulses.is_enabled:
            return 0.0, 0.0
        per_unit_n = self._config.plant.adapter.force_per_unit_n
        return (
            per_unit_n * thrust_of(pulses.left_us, settings, settings.left),
            per_unit_n * thrust_of(pulses.right_us, settings, settings.right),
        )
