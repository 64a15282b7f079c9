"""A process of another version in the place of one of this: it may sign in, and names its fields otherwise."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack

import msgspec

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER
from paani.bus import Bus
from paani_tools.bench.faults.fault import Expected, Fault
from paani_tools.bench.faults.processes import ADAPTER, back_again
from paani_tools.bench.faults.running import Loop, until

CONTROLLER = keys.THRUST.producer
TIMES, PERIOD_S = 13, 0.05  # until after ZERO_S; the controller of this version is back after 0.4 s and its start
HEALTH_S = 3.0  # reported once a second
ZERO_S = 0.55  # the last order of the one before counts for half a second, to the adapter's next step
FORWARD = 0.3
OTHER_NAMES = {"left": "port", "right": "starboard"}


def other_version() -> Fault:
    """The controller is killed, and one of another version speaks until it is started again.

    It gives its pulse, and thrust with the newest echo: nothing but the names of two fields keeps the boat still.
    """
    peers, stamps_us, counts, speaking = AsyncExitStack(), list[int](), list[int](), list[asyncio.Task[None]]()

    async def begin(loop: Loop) -> None:
        ear = await peers.enter_async_context(loop.joined(OBSERVER))
        peer = await peers.enter_async_context(loop.joined(CONTROLLER))
        counts.clear()
        ear.on(keys.SIM_TIME, lambda time: stamps_us.append(time.stamp_us))
        ear.on(keys.health(ADAPTER), lambda health: counts.append(_of_wrong_type(health)))
        await until(lambda: bool(stamps_us and counts), HEALTH_S)
        loop.kill(CONTROLLER)
        speaking.append(asyncio.create_task(_speak(loop, peer, stamps_us)))

    async def end(loop: Loop) -> None:
        async with peers:
            await speaking.pop()
            try:
                await until(lambda: counts[-1] - counts[0] >= TIMES // 2, HEALTH_S)
            except TimeoutError as error:
                raise TimeoutError(f"{ADAPTER} counted {counts[-1] - counts[0]} of {TIMES} messages") from error
        await back_again(loop, CONTROLLER)

    name, lasts_s = f"{CONTROLLER} of another version", TIMES * PERIOD_S
    return Fault(name=name, expected=Expected.STOPS, begin=begin, end=end, lasts_s=lasts_s, zero_s=ZERO_S)


async def _speak(loop: Loop, peer: Bus, stamps_us: list[int]) -> None:
    """Pulses, and orders to go ahead."""
    pulse, thrust = peer.publisher(keys.pulse(CONTROLLER)), peer.publisher(keys.THRUST)
    begun_us = loop.clock.now_us()
    for seq in range(TIMES):
        now_us = loop.clock.now_us()
        pulse.put(m.Pulse(source_us=now_us))
        order = m.Thrust(source_us=now_us, left=FORWARD, right=FORWARD, enabled=True, echo_us=stamps_us[-1])
        domain, epoch = loop.config.bus.domain, begun_us // 1000
        thrust.forward(in_other_words(keys.THRUST.stamp(order, domain=domain, seq=seq, epoch=epoch, sent_us=now_us)))
        await asyncio.sleep(PERIOD_S)


def in_other_words(thrust: m.Thrust) -> bytes:
    """As the other version writes it."""
    fields = msgspec.to_builtins(thrust)
    return msgspec.json.encode({OTHER_NAMES.get(name, name): value for name, value in fields.items()})


def _of_wrong_type(health: m.Health) -> int:
    return sum(drop.count for drop in health.drops if drop.cause == "wrong_type")
