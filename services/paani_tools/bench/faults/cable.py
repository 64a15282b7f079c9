"""Faults of the serial lines to the microcontroller: a cable that is pulled out and put back."""

from __future__ import annotations

import asyncio
import contextlib
import os
import tty

from paani.port_address import parse_address
from paani_tools.bench.faults.fault import Drive, Expected, Fault
from paani_tools.bench.faults.running import Loop

CHUNK = 4096
TRIES = 16  # pseudo-terminals; the kernel gives the lowest number that is free
# The microcontroller is STALE when its lease of 300 ms is over, and disarmed by itself a second later.
SHORT_S, LONG_S = 0.5, 2.5


class Cable:
    """Carries bytes between a pseudo-terminal, whose address is `address`, and the microcontroller's line.

    Its far end stays where it is: the microcontroller notices nothing but silence.
    """

    def __init__(self, line: str) -> None:
        self._line = os.open(parse_address(line)[0], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self._line)
        self._ends: tuple[int, int] | None = None
        self._name = ""
        self.plug_in()
        asyncio.get_running_loop().add_reader(self._line, self._from_line)

    @property
    def address(self) -> str:
        """As a setting names it."""
        return f"serial:{self._name}@115200"

    def plug_in(self) -> None:
        """The device is there, by the name that it had before. Raises OSError where somebody else has that now."""
        found = [os.openpty()]
        while self._name and os.ttyname(found[-1][1]) != self._name and len(found) < TRIES:
            found.append(os.openpty())
        *others, ends = found
        for descriptor in (each for other in others for each in other):
            os.close(descriptor)
        name = os.ttyname(ends[1])
        if self._name and name != self._name:
            for descriptor in ends:
                os.close(descriptor)
            raise OSError(f"{self._name}: taken by another program")
        self._name, self._ends = name, ends
        tty.setraw(ends[1])
        os.set_blocking(ends[0], False)
        asyncio.get_running_loop().add_reader(ends[0], self._from_device, ends[0])

    def pull_out(self) -> None:
        """The device is gone."""
        if self._ends is not None:
            asyncio.get_running_loop().remove_reader(self._ends[0])
            for descriptor in self._ends:
                os.close(descriptor)
            self._ends = None

    def close(self) -> None:
        """Let both ends go."""
        self.pull_out()
        asyncio.get_running_loop().remove_reader(self._line)
        os.close(self._line)

    def _from_line(self) -> None:
        _pass_on(self._line, self._ends[0] if self._ends is not None else None)

    def _from_device(self, device: int) -> None:
        _pass_on(device, self._line)


def _pass_on(source: int, sink: int | None) -> None:
    """What is sent into a cable that is pulled out, or that nobody reads, is lost."""
    with contextlib.suppress(OSError):
        data = os.read(source, CHUNK)
        if sink is not None:
            os.write(sink, data)


def serial_faults(thrust: Cable | None, advice: Cable | None) -> list[Fault]:
    """By these cables, to the thrusters and to the lights; None: for their names alone."""
    return [
        _unplugged("thrusters' serial line unplugged for half a second", thrust, Expected.STOPS, SHORT_S),
        _unplugged("thrusters' serial line unplugged", thrust, Expected.HAND, LONG_S),
        _unplugged("bridge's serial line unplugged", advice, Expected.GOES_ON, LONG_S),
    ]


def _unplugged(name: str, cable: Cable | None, expected: Expected, lasts_s: float) -> Fault:
    async def begin(loop: Loop) -> None:
        assert cable is not None
        loop.mark()
        cable.pull_out()

    async def end(loop: Loop) -> None:
        assert cable is not None
        cable.plug_in()

    return Fault(name=name, expected=expected, begin=begin, end=end, lasts_s=lasts_s, drive=Drive.SERIAL)
