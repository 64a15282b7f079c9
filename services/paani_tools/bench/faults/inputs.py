"""Faults of what the boat is told: by its camera, by peers with a process's own credentials, and by its clock."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import msgspec

from paani import keys
from paani.bus import Bus
from paani_tools.bench.faults.fault import ZERO_S, Drive, Expected, Fault
from paani_tools.bench.faults.hostile import hostile_topics
from paani_tools.bench.faults.running import Loop, until

# Of the scenario's faults, by its own clock, which begins before the last process is alive: by 30 s the boat is under
# way on two busy cores too.
WINDOW_S, FIRST_S, APART_S = 2.5, 30.0, 9.0
# Evidence counts for 0.6 s (advisor.evidence_max_age_s), so a picture that does not come, or comes late and black, is
# missed by then; that they are frozen is known after three that are alike, at 5 Hz (perception.image_quality).
MISSED_S = 0.65
CAMERA_KINDS = {"camera_black": MISSED_S, "camera_frozen": 1.1, "camera_dropped": MISSED_S, "link_loss": ZERO_S}
WORDS = {
    "camera_black": "black picture",
    "camera_frozen": "frozen picture",
    "camera_dropped": "no picture",
    "link_loss": "no radio link",
}
TIMES, PERIOD_S = 20, 0.05
JUMP_S = 3600.0
SEED = 1


def scenario_text() -> str:
    """The river, whose camera and link fail one after the other."""
    parts = ['seed = 4\n\n[world]\nkind = "river"\nactors = false\n']
    parts += [
        f'\n[[faults]]\nkind = "{kind}"\nstart_s = {FIRST_S + APART_S * index}\nduration_s = {WINDOW_S}\n'
        for index, kind in enumerate(CAMERA_KINDS)
    ]
    return "".join(parts)


def scenario_faults() -> list[Fault]:
    """Those of `scenario_text`, in its order; each is waited for."""
    return [_window(kind, FIRST_S + APART_S * index) for index, kind in enumerate(CAMERA_KINDS)]


def _window(kind: str, start_s: float) -> Fault:
    async def begin(loop: Loop) -> None:
        if loop.watch.sim_s > start_s:
            raise TimeoutError(f"it began at {start_s} s of the drive, before the boat was under way")
        await until(lambda: loop.watch.sim_s >= start_s, start_s + APART_S)
        loop.mark()

    async def end(loop: Loop) -> None:
        await until(lambda: loop.watch.sim_s >= start_s + WINDOW_S, WINDOW_S + APART_S)

    return Fault(
        name=WORDS[kind], expected=Expected.STOPS, begin=begin, end=end, zero_s=CAMERA_KINDS[kind], lasts_s=1.5
    )


def peer_faults() -> list[Fault]:
    """Messages by somebody with the credentials of whoever may write them, beside the real ones."""
    return [
        _garbage(),
        _forged("thrust that is not a number", lambda text: text.replace(b'"left":', b'"left":NaN,"was":', 1)),
        _forged("thrust beyond its range", lambda text: _changed(text, left=7.5, seq=10**9)),
        _forged("thrust of another domain", lambda text: _changed(text, domain=44, seq=10**9)),
        _forged("thrust without its fields", lambda text: _changed(text, echo_us=None, left=None, seq=10**9)),
        _forged("old thrust again", lambda text: text),
    ]


def _garbage() -> Fault:
    """What no receiver may take, on every key, by its own producer. No process ends."""

    async def begin(loop: Loop) -> None:
        loop.mark()
        await flood(loop, 40, refused=True)

    async def end(loop: Loop) -> None:
        if ended := ended_since(loop, loop.hit_us):
            raise ChildProcessError(f"ended: {', '.join(ended)}")

    return Fault(name="garbage on every key", expected=Expected.GOES_ON, begin=begin, end=end, lasts_s=0.5)


async def flood(loop: Loop, each: int, *, refused: bool, spared: Collection[str] = ()) -> int:
    """As many hostile messages on each key, by whoever may write it, as fast as they go; returns how many.

    refused: only such as no receiver may take. Others may take the place of what the real producer says. spared: names
    of topics on which nothing is said.
    """
    hostile = hostile_topics(loop.config.bus.graph, loop.config.bus.domain, random.Random(SEED))
    for name in (keys.THRUST.name, keys.COMMAND.name, keys.ARMING.name):
        hostile[name].heard_epoch = 2  # everything real is of a later one
    by_producer: dict[str, list[keys.Topic[Any]]] = {}
    for topic in keys.every_topic(loop.config.bus.graph):
        if topic.producer in loop.config.services and topic.name not in spared:
            by_producer.setdefault(topic.producer, []).append(topic)
    sent = 0
    for producer, topics in by_producer.items():
        async with loop.joined(producer) as bus:
            for topic in topics:
                publisher = bus.publisher(topic)
                for _ in range(each):
                    publisher.forward(hostile[topic.name].next(loop.clock.now_us(), refused=refused).data)
                    sent += 1
                await asyncio.sleep(0)
    return sent


def ended_since(loop: Loop, at_us: int) -> list[str]:
    """Processes that have ended since then, whether they were started again or not."""
    return sorted(name for name, changed_us in loop.watch.changed_us.items() if changed_us > at_us)


def _forged(name: str, change: Callable[[bytes], bytes]) -> Fault:
    async def begin(loop: Loop) -> None:
        async with loop.joined("observer") as ear, loop.joined("controller") as peer:
            heard = ear.raw(keys.THRUST, 64)
            await asyncio.sleep(0.5)
            texts = [raw.data for raw in heard.drain()]
            if not texts:
                raise TimeoutError("no thrust was heard that could be forged")
            await _say(loop, peer, [change(text) for text in texts])

    return Fault(name=name, expected=Expected.GOES_ON, begin=begin, end=_nothing)


async def _say(loop: Loop, peer: Bus, texts: list[bytes]) -> None:
    publisher = peer.publisher(keys.THRUST)
    loop.mark()
    for index in range(TIMES):
        publisher.forward(texts[index % len(texts)])
        await asyncio.sleep(PERIOD_S)


def _changed(text: bytes, **fields: object) -> bytes:
    """The message with other values; None: without this field."""
    message = msgspec.json.decode(text, type=dict[str, object])
    message.update(fields)
    return msgspec.json.encode({name: value for name, value in message.items() if value is not None})


async def _nothing(loop: Loop) -> None:
    """The fault has ended by itself."""


def clock_faults(file: Path) -> list[Fault]:
    """The machine's clock set back, to before the drive began, and ahead again, by the file that libfaketime reads."""
    return [_jump(file, "set back", -JUMP_S), _jump(file, "set ahead", JUMP_S)]


def _jump(file: Path, words: str, by_s: float) -> Fault:
    async def begin(loop: Loop) -> None:
        shift_s = loop.clock.shift_us * 1e-6 + by_s
        await asyncio.to_thread(file.write_text, f"{shift_s:+.0f}\n", encoding="ascii")
        loop.mark()
        loop.clock.shift_us = round(shift_s * 1e6)

    # By the operator's process, which disarms then, the page has been silent for an hour, or has begun again.
    name = f"clock {words} by an hour"
    return Fault(name=name, expected=Expected.MAY_STAND, begin=begin, end=_nothing, lasts_s=1.0, drive=Drive.CLOCK)
