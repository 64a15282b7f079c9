"""The thrusters process and the emulated microcontroller: pulses as the timer's registers hold them."""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from paani import messages as m
from paani.config import Config, load_config
from paani_services.thrusters.service import run
from tests.at_work import at_work
from tests.conftest import find_free_port
from tests.fake_router import FakeRouter
from tests.firmware.emulator import Emulator, open_emulator
from tests.mcu_peer import until
from tests.thruster_bus import CLOCK, PULSES, ThrusterBus, opened

pytestmark = pytest.mark.firmware
KILLS = int(os.environ.get("THRUSTER_KILLS", "4"))
LEASE_MS = load_config().thrusters.lease_ms
AHEAD_US = (1580, 1580)  # of an order of 0.2


def sets_of(folder: Path) -> tuple[str, ...]:
    return (f"bus.router=tcp/127.0.0.1:{find_free_port()}", f"bus.runtime_dir={folder}", PULSES)


@contextlib.asynccontextmanager
async def speaking(config: Config) -> AsyncIterator[ThrusterBus]:
    """A bus with everybody but the thrusters."""
    async with opened(config) as buses:
        bus = ThrusterBus(config, buses)
        async with at_work(bus.speak()):
            yield bus


def thrusters(bus: ThrusterBus) -> contextlib.AbstractAsyncContextManager[None]:
    """The process's work, within this one."""
    return at_work(run(bus.buses["thrusters"], CLOCK, bus.config))


@contextlib.asynccontextmanager
async def process(*sets: str) -> AsyncIterator[asyncio.subprocess.Process]:
    words = [word for setting in sets for word in ("--set", setting)]
    found = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "paani", "thrusters", *words, stderr=asyncio.subprocess.DEVNULL
    )
    try:
        yield found
    finally:
        if found.returncode is None:
            found.kill()
        await found.wait()


async def test_orders_come_out_as_pulses_and_an_emergency_stop_wins(mcu: Emulator, tmp_path: Path) -> None:
    """W9, O2: the stop needs no software; letting go of it moves nothing, nor does arming without a disarm before."""
    config = load_config(profile="hil", sets=(*sets_of(tmp_path), f"thrusters.line={mcu.thrust}"))
    async with speaking(config) as bus, thrusters(bus):
        await bus.drive()
        await mcu.wait_for_pins(lambda pins: pins[:3] == (*AHEAD_US, True))
        assert await mcu.read_timers() == (*AHEAD_US, True)
        pressed_ms = mcu.pins.mcu_ms
        await mcu.set_pins("estop 1")
        still = await mcu.wait_for_pins(lambda pins: not pins.enable)
        assert still.mcu_ms - pressed_ms <= 100
        assert (await mcu.wait_for_pins(lambda pins: True))[:3] == (1500, 1500, False)
        await bus.until_cause(m.ZeroCause.EMERGENCY_STOP)
        await mcu.set_pins("estop 0")
        begin = len(mcu.history)
        await until(lambda: mcu.pins.mcu_ms > mcu.history[begin - 1].mcu_ms + 1000, 10.0)
        assert not any(pins.enable for pins in mcu.history[begin:]), "nothing re-arms itself"
        await bus.drive()
        await mcu.wait_for_pins(lambda pins: pins[:3] == (*AHEAD_US, True))


@pytest.mark.parametrize(
    ("pins", "sets", "cause"),
    [
        ("rc 1500 1500 1", (), m.ZeroCause.RECEIVER),
        ("battery 9000 0", ("thrusters.min_battery_v=10.5",), m.ZeroCause.BATTERY_LOW),
        ("battery 12000 3000", ("thrusters.max_current_a=20",), m.ZeroCause.OVER_CURRENT),
    ],
)
async def test_what_holds_on_the_microcontroller_is_the_cause(
    tmp_path: Path, pins: str, sets: tuple[str, ...], cause: m.ZeroCause
) -> None:
    async with open_emulator() as mcu:
        await mcu.set_pins("battery 12000 100")
        config = load_config(profile="hil", sets=(*sets_of(tmp_path), *sets, f"thrusters.line={mcu.thrust}"))
        async with speaking(config) as bus, thrusters(bus):
            await bus.drive()
            await mcu.set_pins(pins)
            await bus.until_cause(cause)
            assert bus.applied.value is not None
            assert (bus.applied.value.left, bus.applied.value.right) == (0.0, 0.0)


async def test_a_killed_process_leaves_the_thrusters_still_within_its_lease(tmp_path: Path) -> None:
    """W9: by the microcontroller's clock; the next process does not go on before the operator has armed again."""
    async with open_emulator() as mcu:
        sets = (*sets_of(tmp_path), f"thrusters.line={mcu.thrust}")
        async with speaking(load_config(profile="hil", sets=sets)) as bus:
            for _ in range(KILLS):
                async with process("profile=hil", *sets) as driven:
                    await bus.drive()
                    await mcu.wait_for_pins(lambda pins: pins[:3] == (*AHEAD_US, True))
                    killed_ms = mcu.pins.mcu_ms
                    driven.kill()
                    still = await mcu.wait_for_pins(lambda pins: not pins.enable)
                    assert still.mcu_ms - killed_ms <= LEASE_MS + 100
                    assert (await mcu.wait_for_pins(lambda pins: True))[:2] == (1500, 1500)
            begin = len(mcu.history)
            async with process("profile=hil", *sets):
                received = bus.applied.received
                await until(lambda: bus.applied.received > received + 20, 15.0)
                await bus.until_cause(m.ZeroCause.REARM)
                assert not any(pins.enable for pins in mcu.history[begin:])


async def test_an_emergency_stop_holds_over_a_restart_until_the_operator_speaks(tmp_path: Path) -> None:
    """A disarmed frame is the operator's leave to arm again: a process that has not heard him sends none."""
    async with open_emulator() as mcu:
        config = load_config(profile="hil", sets=(*sets_of(tmp_path), f"thrusters.line={mcu.thrust}"))
        async with speaking(config) as bus:
            async with thrusters(bus):
                await bus.drive()
                await mcu.set_pins("estop 1")
                await bus.until_cause(m.ZeroCause.EMERGENCY_STOP)
            await mcu.set_pins("estop 0")
            bus.armed = None
            async with thrusters(bus):
                begin = bus.state.received
                await until(lambda: bus.state.received > begin + 20, 15.0)
                assert bus.state.value is not None
                assert m.ThrustHold.EMERGENCY_STOP in bus.state.value.holds
                bus.armed = False
                await until(
                    lambda: bus.state.value is not None and m.ThrustHold.EMERGENCY_STOP not in bus.state.value.holds
                )


async def test_a_restart_of_the_microcontroller_moves_nothing(tmp_path: Path) -> None:
    async with open_emulator() as mcu:
        config = load_config(profile="hil", sets=(*sets_of(tmp_path), f"thrusters.line={mcu.thrust}"))
        async with speaking(config) as bus, thrusters(bus):
            await bus.drive()
            await mcu.wait_for_pins(lambda pins: pins.enable)
            await mcu.set_pins("hang")
            await mcu.wait_for_pins(lambda pins: not pins.enable)
            await bus.until_cause(m.ZeroCause.REARM)
            assert bus.buses["thrusters"].drops["microcontroller_restarted"] == 1
            await bus.drive()


async def test_of_two_processes_on_one_microcontroller_the_second_is_refused(tmp_path: Path) -> None:
    """By the board's router, where both reach it: who drives goes on as if alone."""
    async with open_emulator() as mcu, on_a_router(mcu, tmp_path / "router.sock") as line:
        both = [
            load_config(profile="hull", sets=(*sets_of(tmp_path / name), f"thrusters.line={line}"))
            for name in ("first", "second")
        ]
        async with speaking(both[0]) as first, thrusters(first):
            await first.drive()
            await mcu.wait_for_pins(lambda pins: pins[:3] == (*AHEAD_US, True))
            begin = len(mcu.history)
            async with speaking(both[1]) as second, thrusters(second):
                second.thrust, second.armed = 0.9, True
                await second.until_cause(m.ZeroCause.REFUSED)
                await until(lambda: second.state.value is not None and "refused" in second.state.value.problem)
                await until(lambda: mcu.pins.mcu_ms > mcu.history[begin - 1].mcu_ms + 1500, 20.0)
            assert {pins[:3] for pins in mcu.history[begin:]} == {(*AHEAD_US, True)}
            assert first.cause is m.ZeroCause.NONE


@contextlib.asynccontextmanager
async def on_a_router(mcu: Emulator, path: Path) -> AsyncIterator[str]:
    """The microcontroller's line as a client of the board's router, whose address this is."""
    router = FakeRouter(path, random.Random(1))
    await router.start()
    host, _, port = mcu.thrust.removeprefix("socket://").partition(":")
    near = await asyncio.open_connection(host, int(port))
    far = await asyncio.open_unix_connection(path)
    try:
        async with at_work(copy(near[0], far[1]), copy(far[0], near[1])):
            await until(lambda: {"paani_thrust", "paani_esc"} <= router.routes, 15.0)
            yield f"unix:{path}"
    finally:
        await router.stop()
        for _, writer in (near, far):
            writer.close()


async def copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while data := await reader.read(4096):
        writer.write(data)
