"""A hardware button on a real bus stops the boat when pressed or gone, and nobody arms past it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.clock import WallClock
from paani.config import ButtonConfig, Config
from paani.thrust_adapter import ThrustAdapter
from paani_services.button.service import run
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn
from tests.integration.test_operator import Boat, boat, station

__all__ = ["boat"]  # a fixture
pytestmark = [pytest.mark.integration, pytest.mark.timeout(90)]


@contextlib.asynccontextmanager
async def pressing(path: Path, open_as: OpenAs, config: Config) -> AsyncIterator[None]:
    bus = await open_as(keys.BUTTON)
    async with at_work(run(bus, WallClock(), replace(config, button=ButtonConfig(line=f"level:{path}")))):
        yield


async def test_a_press_stops_and_nobody_arms_past_a_button_that_is_down_or_gone(
    spawn: Spawn, boat: Boat, config: Config, open_as: OpenAs, tmp_path: Path
) -> None:
    level = tmp_path / "value"

    def stopped_by_button() -> bool:
        state = boat.state.value
        return state is not None and state.stopped and state.by == "button" and not boat.is_armed

    await asyncio.to_thread(level.write_text, "1\n")
    async with spawn("operator"), station(config) as hand, pressing(level, open_as, config):
        for why in ("0\n", None, "torn"):
            assert await hand.hold_to_arm() is m.ArmRefusal.NONE
            await boat.until(lambda: boat.is_armed, "armed")
            await (asyncio.to_thread(level.unlink) if why is None else asyncio.to_thread(level.write_text, why))
            await boat.until(stopped_by_button, f"stopped by {why!r}")
            stops = boat.state.value.stops if boat.state.value is not None else 0
            assert await hand.hold_to_arm() is not m.ArmRefusal.NONE
            assert not boat.is_armed
            assert boat.state.value is not None
            assert boat.state.value.stops - stops < 5, "asked where somebody holds, not all the time"
            await asyncio.to_thread(level.write_text, "1\n")
            await boat.stays_disarmed()


async def test_thrust_is_zero_without_the_process_of_a_button_that_is_configured(
    config: Config, open_as: OpenAs, tmp_path: Path
) -> None:
    with_button = replace(config, button=ButtonConfig(line=f"level:{tmp_path / 'value'}"))
    adapter = ThrustAdapter(with_button.adapter, config.bus.domain)
    heard = (await open_as("plant")).latest(keys.pulse(keys.BUTTON))
    now_us = 1_000_000
    async with pressing(tmp_path / "value", open_as, config):
        async with asyncio.timeout(10.0):
            await heard.next()
        adapter.receive_arming(m.Arming(source_us=now_us, armed=True, stopped=False), now_us)
        for service in config.adapter.require_pulses:
            adapter.receive_pulse(service, now_us)
        assert adapter.decide(now_us).zero_cause is m.ZeroCause.PULSE_LOST
        adapter.receive_pulse(keys.BUTTON, now_us)
        assert adapter.decide(now_us).zero_cause is not m.ZeroCause.PULSE_LOST
    await asyncio.sleep(keys.pulse(keys.BUTTON).fresh_s + 0.2)
    assert heard.fresh(keys.pulse(keys.BUTTON).fresh_s) is None
