"""The operator's process on a real bus: nothing but a hand arms again, and `paani stop` needs no page."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus, open_bus
from paani.clock import WallClock
from paani.config import Config
from paani.operator_client import OperatorClient
from paani.runtime import runtime_dir
from paani_services.operator.latch import LATCH_FILE
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn
from tests.paani_command import paani

pytestmark = [pytest.mark.integration, pytest.mark.timeout(90)]
CLOCK = WallClock()
SETTLES_S = 1.0


class Boat:
    """Applies thrust whenever it is armed, as the plant does, and says so."""

    def __init__(self, bus: Bus) -> None:
        self._applied, self.arming = bus.publisher(keys.THRUST_APPLIED), bus.latest(keys.ARMING)
        self.state = bus.latest(keys.OPERATOR_STATE)

    async def report_forever(self) -> None:
        while True:
            thrust, cause = (0.1, m.ZeroCause.NONE) if self.is_armed else (0.0, m.ZeroCause.NOT_ARMED)
            self._applied.put(
                m.ThrustApplied(
                    source_us=CLOCK.now_us(), left=thrust, right=thrust, left_n=thrust, right_n=thrust, zero_cause=cause
                )
            )
            await asyncio.sleep(0.05)

    @property
    def is_armed(self) -> bool:
        fresh = self.arming.receipt_age_s() <= keys.ARMING.fresh_s
        return fresh and self.arming.value is not None and self.arming.value.armed

    async def until(self, condition: Callable[[], bool], what: str) -> None:
        try:
            async with asyncio.timeout(10):
                while not condition():
                    await asyncio.sleep(0.02)
        except TimeoutError:
            pytest.fail(f"not within 10 s: {what}; {self.arming.value} {self.state.value}")

    async def stays_disarmed(self) -> None:
        async with asyncio.timeout(10):
            for _ in range(round(SETTLES_S / 0.05)):
                assert not self.is_armed
                await asyncio.sleep(0.05)


@pytest.fixture
async def boat(open_as: OpenAs) -> AsyncIterator[Boat]:
    boat = Boat(await open_as("plant"))
    async with at_work(boat.report_forever()):
        yield boat


@contextlib.asynccontextmanager
async def station(config: Config) -> AsyncIterator[OperatorClient]:
    """The page's process: its pulse, and its hand."""
    bus = await open_bus(config.bus, keys.STATION, CLOCK)
    try:
        with bus.alive():
            await asyncio.sleep(0.3)
            yield OperatorClient(bus, CLOCK)
    finally:
        await bus.close()


async def test_a_page_that_begins_again_finds_the_boat_disarmed(spawn: Spawn, boat: Boat, config: Config) -> None:
    async with spawn("operator"):
        async with station(config) as hand:
            assert await hand.hold_to_arm() is m.ArmRefusal.NONE
            await boat.until(lambda: boat.is_armed, "armed")
        async with station(config) as hand:
            await boat.until(lambda: not boat.is_armed, "disarmed by the page's return")
            await boat.stays_disarmed()
            assert await hand.hold_to_arm() is m.ArmRefusal.NONE
            await boat.until(lambda: boat.is_armed, "armed by a hand")


async def test_an_operators_process_that_is_killed_comes_back_stopped(
    spawn: Spawn, boat: Boat, config: Config, open_as: OpenAs
) -> None:
    async with station(config) as hand:
        with pytest.raises(AssertionError, match="operator exited -9"):  # noqa: PT012  # raised at the end of `spawn`
            async with spawn("operator") as process:
                assert await hand.hold_to_arm() is m.ArmRefusal.NONE
                await boat.until(lambda: boat.is_armed, "armed")
                process.kill()
                await boat.until(lambda: not boat.is_armed, "the operator's word out of date")
        async with spawn("operator"):
            await boat.until(lambda: boat.state.value is not None and boat.state.value.stopped, "stopped")
            await boat.stays_disarmed()
            command = OperatorClient(await open_as("arm"), CLOCK)
            assert await command.hold_to_arm() is m.ArmRefusal.LATCHED, "a command releases no STOP"
            assert await hand.hold_to_arm() is m.ArmRefusal.NONE


async def test_a_latch_that_cannot_be_written_arms_nobody_and_is_said(spawn: Spawn, boat: Boat, config: Config) -> None:
    latch = await asyncio.to_thread(runtime_dir, config.bus) / LATCH_FILE
    async with station(config) as hand:
        async with spawn("operator"):
            assert await hand.hold_to_arm() is m.ArmRefusal.NONE
            await boat.until(lambda: boat.is_armed, "armed")
            await asyncio.to_thread(spoil, latch)
            state = await hand.stop(5.0)
            assert state is not None
            await boat.until(lambda: not boat.is_armed, "stopped")
            await boat.until(lambda: not (boat.state.value is None or boat.state.value.latch_kept), "it says so")
            assert await hand.hold_to_arm() is m.ArmRefusal.NOT_WRITTEN
        async with spawn("operator"):
            await boat.until(lambda: boat.state.value is not None and boat.state.value.stopped, "still stopped")
            await boat.stays_disarmed()


def spoil(latch: Path) -> None:
    """A folder in the latch's place: no file can be moved there, as root or not."""
    latch.unlink()
    (latch / "x").mkdir(parents=True)


async def test_paani_stop_needs_no_page(
    spawn: Spawn, boat: Boat, config: Config, private_sets: tuple[str, ...]
) -> None:
    async with station(config) as hand, spawn("operator"):
        assert await hand.hold_to_arm() is m.ArmRefusal.NONE
        await boat.until(lambda: boat.is_armed, "armed")
        code, out, errors = await paani(private_sets, "stop")
        output = out + errors
        assert (code, output.startswith("stopped: zero thrust after ")) == (0, True), output
        assert boat.state.value is not None
        assert (boat.state.value.stopped, boat.state.value.by) == (True, "stop")
    code, out, errors = await paani(private_sets, "stop")
    output = out + errors
    assert (code, output.startswith("NOT LATCHED: ")) == (1, True), output


async def test_paani_stop_without_a_router_is_one_line(private_sets: tuple[str, ...]) -> None:
    code, out, errors = await paani(private_sets, "stop")
    output = out + errors
    assert (code, output.count("\n")) == (2, 1)
    assert "bus.r" in output or "credentials" in output


async def test_a_stop_is_latched_once_it_was_heard_and_not_because_one_held_before(open_as: OpenAs) -> None:
    """Of a request that is lost nobody is told that it was done."""
    operator, client = await open_as("operator"), OperatorClient(await open_as("dashboard"), CLOCK)
    states, requests = operator.publisher(keys.OPERATOR_STATE), operator.queue(keys.REQUESTS["dashboard"])
    stops = 3

    async def speak_forever() -> None:
        while True:
            states.put(m.OperatorState(source_us=CLOCK.now_us(), armed=False, stopped=True, by="stop", stops=stops))
            await asyncio.sleep(0.05)

    async with at_work(speak_forever()), asyncio.timeout(20):
        while client.state is None:
            await asyncio.sleep(0.01)
        assert await client.stop(0.5) is None
        assert len(requests.drain()) > 1, "it is said again"
        asking = asyncio.create_task(client.stop(10.0))
        await requests.get()
        stops = 4
        answer = await asking
        assert answer is not None
        assert answer.stops == 4
