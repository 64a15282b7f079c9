"""Faults of certificates: one expires under way, or has expired when its process is started again.

Who is cut off comes back by itself where a valid one is there within 5 s; after that it is killed as hanging. With an
expired one no process starts: that is a mistake which no restart mends, so `paani up` ends. Then a person puts a valid
one in its place, starts again, and arms.
"""

from __future__ import annotations

import asyncio
import functools
import shutil
from pathlib import Path

from paani.clock import WallClock
from paani.keys import Graph
from paani_tools.bench.faults.fault import Drive, Expected, Fault
from paani_tools.bench.faults.processes import back_again
from paani_tools.bench.faults.running import Loop, until

DAY_US = 86_400_000_000
EXPIRING, KILLED = "controller", "advisor"
LIVES_S = 15  # of a certificate that expires under way: its process is started again, and the boat under way by then
LASTS_S = 2.0
ENDS_S = 30.0  # a killed process is started again, and refused
SECOND_US = 1_000_000  # X.509 knows nothing shorter


class Certificates:
    """Those of a drive, in `live`; each may be replaced by another of the same name, whose rights the router knows."""

    def __init__(self, folder: Path) -> None:
        self._first, self._valid, self.live = folder / "first", folder / "valid", folder / "certificates"

    def make(self) -> None:
        """All of them valid for a day. Raises ModuleNotFoundError without what makes certificates."""
        from paani_tools.certs.folder import make  # noqa: PLC0415  # its library comes with an extra

        make(self._first, Graph.SIMULATION, (), WallClock().now_us(), 1)
        shutil.copytree(self._first, self._valid)
        for name in (EXPIRING, KILLED):
            self._rotate(self._valid, name, WallClock().now_us() + DAY_US)
        self.restore()

    def replace(self, name: str, until_us: int) -> None:
        """Another certificate of this name, valid until then [us, Unix time]."""
        beside = self.live.with_name(f"{name}-{until_us}")
        shutil.copytree(self._first, beside)
        self._rotate(beside, name, until_us)
        shutil.copytree(beside, self.live, dirs_exist_ok=True)

    def restore(self) -> None:
        """The valid ones again."""
        shutil.copytree(self._valid, self.live, dirs_exist_ok=True)

    def _rotate(self, folder: Path, name: str, until_us: int) -> None:
        from paani_tools.certs.folder import rotate  # noqa: PLC0415

        rotate(folder, name, until_us - DAY_US, 1)


def certificate_faults(certificates: Certificates) -> list[Fault]:
    """On a drive whose processes know each other by these."""

    async def expire(loop: Loop) -> None:
        until_us = (WallClock().now_us() // SECOND_US + LIVES_S) * SECOND_US
        await asyncio.to_thread(certificates.replace, EXPIRING, until_us)
        loop.kill(EXPIRING)
        await back_again(loop, EXPIRING)
        if not await loop.settle() or WallClock().now_us() > until_us:
            raise TimeoutError(f"it expired after {LIVES_S} s, before the boat was under way again")
        await until(lambda: WallClock().now_us() >= until_us, LIVES_S)
        loop.mark()

    async def kill(loop: Loop) -> None:
        await asyncio.to_thread(certificates.replace, KILLED, WallClock().now_us() - DAY_US)
        loop.kill(KILLED)

    async def renew(loop: Loop) -> None:
        await asyncio.to_thread(certificates.restore)

    async def start_again(loop: Loop) -> None:
        await loop.wait_for_end(ENDS_S)
        await asyncio.to_thread(certificates.restore)
        await loop.start_again()

    fault = functools.partial(Fault, lasts_s=LASTS_S, drive=Drive.CERTIFICATES)
    return [
        fault(name=f"{EXPIRING}'s certificate expires", expected=Expected.STOPS, begin=expire, end=renew),
        fault(name=f"{KILLED} killed, its certificate expired", expected=Expected.HAND, begin=kill, end=start_again),
    ]
