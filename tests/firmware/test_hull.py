"""`paani up --profile hull` with serial devices that are pseudo-terminals: everything of a real boat but the boat."""

from __future__ import annotations

import asyncio
import contextlib
import os
import tty
from collections.abc import AsyncIterator
from pathlib import Path

import cv2
import pytest

from paani import keys
from paani import messages as m
from paani.bus import open_bus
from paani.clock import WallClock
from paani.config import load_config
from tests.arming import arm_on_page
from tests.at_work import at_work
from tests.conftest import find_free_port
from tests.firmware.emulator import open_emulator
from tests.firmware.test_hardware_in_the_loop import running
from tests.mcu_peer import until
from tests.pictures import river

pytestmark = [pytest.mark.firmware, pytest.mark.timeout(300)]


@contextlib.asynccontextmanager
async def gps() -> AsyncIterator[str]:
    """A receiver on a serial line, at rest."""
    far, near = os.openpty()
    tty.setraw(near)

    async def speak() -> None:
        for number in range(100_000):
            body = (
                f"GPRMC,{number // 25 % 24:02}{number // 5 % 60:02}00.00,A,5200.0000,N,00400.0000,E,0.0,0.0,010126,,,A"
            )
            checksum = 0
            for byte in body.encode():
                checksum ^= byte
            os.write(far, f"${body}*{checksum:02X}\r\n".encode())
            await asyncio.sleep(0.2)

    try:
        async with at_work(speak()):
            yield f"serial:{os.ttyname(near)}@9600"
    finally:
        for descriptor in (far, near):
            os.close(descriptor)


@pytest.mark.rotating(cpu_s=20)
async def test_a_hull_starts_disarmed_and_without_a_simulator(tmp_path: Path) -> None:
    """A7: and without an estimate of its motion it does not move once it is armed either."""
    cv2.imwrite(str(tmp_path / "river.png"), river())
    route, page = tmp_path / "route.toml", find_free_port()
    await asyncio.to_thread(
        route.write_text, 'name = "out"\nwaypoints = [{ x_m = 0.0, y_m = 0.0 }, { x_m = 9.0, y_m = 0.0 }]\n'
    )
    async with open_emulator(pty=True) as mcu, gps() as line:
        sets = (
            f"bus.router=tcp/127.0.0.1:{find_free_port()}", f"bus.runtime_dir={tmp_path}", f"dashboard.port={page}",
            f"thrusters.line={mcu.thrust}", f"sensors.gps.line={line}", f"bridge.line={mcu.guide}",
            f"navigator.route={route}", f"camera.source={tmp_path}",
        )  # fmt: skip
        words = [word for setting in ("profile=hull", *sets) for word in ("--set", setting)]
        async with running("--for", "60", *words) as process:
            assert process.returncode is None
            config = load_config(sets=("profile=hull", *sets))
            bus = await open_bus(config.bus, "observer", WallClock())
            applied, state = bus.latest(keys.THRUST_APPLIED), bus.latest(keys.THRUSTERS_STATE)
            fixes, alive = bus.latest(keys.GPS), set[str]()

            async def watch() -> None:
                async for name, is_alive in bus.alive_events():
                    (alive.add if is_alive else alive.discard)(name)

            try:
                async with at_work(watch()):
                    await until(lambda: alive >= set(config.services), 20.0)
                    assert not alive & {"plant", "eye"}
                    await until(lambda: fixes.value is not None and fixes.value.producer == "sensors", 10.0)
                    await until(lambda: applied.value is not None and applied.value.zero_cause is m.ZeroCause.NOT_ARMED)
                    await until(lambda: state.value is not None)
                    assert state.value is not None
                    assert not state.value.armed
                    await arm_on_page(f"http://127.0.0.1:{page}", config.bus)
                    await until(lambda: state.value is not None and state.value.armed and state.value.enabled, 10.0)
                    assert applied.value is not None
                    assert applied.value.zero_cause is not m.ZeroCause.NONE
                    assert {pins[:2] for pins in mcu.history} == {(1500, 1500)}
            finally:
                await bus.close()
