"""What a deciding process writes down is enough to decide the same again."""

from __future__ import annotations

import asyncio
from typing import Any

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.bus import Queue, Stepper, open_bus
from paani.bus.routing import open_router
from paani.clock import ManualClock, WallClock
from paani.config import Config
from paani.decider import Input, decider_of
from tests.conftest import OpenAs

pytestmark = pytest.mark.integration
CLOCK = WallClock()
STEPS = 40
CONTROLLER = decider_of("controller")


async def test_a_step_has_the_state_again_after_the_clock_was_set_back(config: Config) -> None:
    """Otherwise nothing recorded could be decided again until the clock is where it was."""
    clock = ManualClock(CLOCK.now_us())
    router = await open_router(config.bus)
    controller = await open_bus(config.bus, "controller", clock)
    observer = await open_bus(config.bus, "observer", clock)
    stepper, steps = Stepper(controller, clock, config, CONTROLLER), observer.queue(keys.STEPS["controller"], 100)

    def take_step() -> None:
        _, outputs = stepper.decide()
        stepper.conclude(outputs)

    while not steps.received:  # until the observer hears it
        take_step()
        await asyncio.sleep(0.05)
    steps.drain()
    has_state = []
    for seconds in (0.1, -3600.0, 0.1):
        clock.advance(seconds)
        take_step()
        has_state.append(bool((await asyncio.wait_for(steps.get(), 5)).state))
    for bus in (controller, observer):
        await bus.close()
    await asyncio.to_thread(router.close)
    assert has_state == [False, True, False]


async def test_a_ledger_of_steps_gives_the_same_thrust_again(open_as: OpenAs, config: Config) -> None:
    controller, navigator, localization = [await open_as(n) for n in ("controller", "navigator", "localization")]
    observer = await open_as("observer")
    log: dict[str, Queue[Any]] = {
        topic.name: observer.queue(topic, 1000)
        for topic in (keys.STEPS["controller"], keys.THRUST, keys.COMMAND, keys.ODOMETRY)
    }
    stepper = Stepper(controller, CLOCK, config, CONTROLLER)
    command, odometry = navigator.publisher(keys.COMMAND), localization.publisher(keys.ODOMETRY)
    while not (log[keys.ODOMETRY.name].received and log[keys.COMMAND.name].received):  # until the observer hears both
        odometry.put(m.Odometry(source_us=CLOCK.now_us(), x_m=0, y_m=0, yaw_rad=0, surge_mps=0))
        command.put(m.NavCommand(source_us=CLOCK.now_us(), enable=False, heading_rad=0, speed_mps=0))
        await asyncio.sleep(0.05)
    for number in range(STEPS):
        now_us = CLOCK.now_us()
        odometry.put(m.Odometry(source_us=now_us, x_m=0.1 * number, y_m=0.0, yaw_rad=0.3, surge_mps=0.1, healthy=True))
        command.put(
            m.NavCommand(source_us=now_us, enable=number % 7 != 0, heading_rad=0.2 + 0.01 * number, speed_mps=0.15)
        )
        await asyncio.sleep(0.02)
        _, outputs = stepper.decide()
        stepper.conclude(outputs if number % 3 else {})
    await asyncio.sleep(0.1)

    received = {name: inbox.drain() for name, inbox in log.items()}
    found = {(name, item.epoch, item.seq): item for name, items in received.items() for item in items}
    steps: list[m.Step] = received[keys.STEPS["controller"].name]
    assert len(steps) == STEPS
    state = msgspec.json.decode(steps[0].state, type=type(CONTROLLER.state()))
    assert all(not step.state for step in steps[1:])
    compared = moving = 0
    for step in steps:
        inputs = {topic.name: Input() for topic in CONTROLLER.inputs} | {
            h.topic: Input(found[h.topic, h.epoch, h.seq], h.received_us) for h in step.heard
        }
        state, outputs = CONTROLLER.decide(state, inputs, step.source_us, config)
        for sent in step.sent:
            recorded = found[sent.topic, sent.epoch, sent.seq]
            again = msgspec.structs.replace(
                outputs[sent.topic],
                seq=sent.seq,
                epoch=sent.epoch,
                domain=recorded.domain,
                producer=recorded.producer,
                sent_us=sent.sent_us,
                topic=sent.topic,
            )
            assert msgspec.json.encode(again) == msgspec.json.encode(recorded)
            compared += 1
            moving += recorded.left + recorded.right > 0.0
    assert compared == len(received[keys.THRUST.name]) == sum(1 for number in range(STEPS) if number % 3)
    assert moving > 5
