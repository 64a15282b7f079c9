"""`paani tune` on running processes: tried beside, promoted while disarmed, taken back, forgotten by a restart."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
from collections.abc import AsyncIterator
from typing import Any

import aiohttp
import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.bus import Bus
from paani.clock import WallClock
from paani.config import Config, load_config
from paani.decider import Input, decider_of
from tests.arming import arm_on_page, headers_of, hold_on_page
from tests.conftest import OpenAs, Spawn, put_raw
from tests.paani_command import paani
from tests.unit.paani_services.advisor.advisor_evidence import water

pytestmark = [pytest.mark.integration, pytest.mark.timeout(120)]
CLOCK = WallClock()
BETWEEN = water(0.3, 0.47, 0.4)  # clear at 0.48, blocked at 0.46
ADVISOR = decider_of("advisor")
FEW = "advisor.tuning.min_frames=5"


@pytest.fixture
async def perception(open_as: OpenAs) -> AsyncIterator[Bus]:
    """Distinct frames at 10 Hz."""
    bus = await open_as("perception")
    evidence = bus.publisher(keys.EVIDENCE)

    async def speak() -> None:
        for seq in range(1_000_000):
            evidence.put(msgspec.structs.replace(BETWEEN, source_us=CLOCK.now_us(), frame_seq=seq))
            await asyncio.sleep(0.1)

    speaking = asyncio.create_task(speak())
    yield bus
    speaking.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await speaking


async def until(inbox: Any, wanted: Any) -> Any:
    async with asyncio.timeout(15):
        while True:
            value = await inbox.next()
            if wanted(value):
                return value


async def test_two_steps_forth_and_one_back(
    open_as: OpenAs, spawn: Spawn, perception: Bus, private_sets: tuple[str, ...], config: Config
) -> None:
    observer = await open_as("observer")
    shadow, advisory = observer.latest(keys.SHADOW), observer.latest(keys.ADVISORY)
    page = f"http://127.0.0.1:{config.dashboard.port}"
    async with spawn("operator"), spawn("dashboard"), spawn("advisor", FEW):
        await arm_on_page(page, config.bus)
        await until(advisory, lambda a: a.direction is m.Direction.STRAIGHT)
        code, out, _ = await paani(private_sets, "tune", "propose", "advisor.policy.center_block_risk=0.46", "--json")
        name = msgspec.json.decode(out, type=m.Shadow).proposal
        assert code == 0
        latest = await until(shadow, lambda s: s.frames >= 5)
        assert (latest.proposal, latest.differing) == (name, latest.frames)
        assert latest.recent[-1].shadow_direction is m.Direction.LEFT
        assert (await advisory.next()).direction is m.Direction.STRAIGHT
        code, out, _ = await paani(private_sets, "tune", "status")
        assert code == 0
        assert "center_block_risk 0.48 -> 0.46" in out
        assert "(100.0%)" in out

        code, _, errors = await paani(private_sets, "tune", "promote", name)
        assert (code, errors.count("\n")) == (2, 1)
        assert "armed; press STOP first" in errors
        async with aiohttp.ClientSession() as client:
            for deed, body in (("propose", {"changes": []}), ("promote", {"proposal": name}), ("rollback", {})):
                async with client.post(f"{page}/api/tune/{deed}", json=body) as answer:
                    assert (answer.status, (await answer.json())["field"]) == (403, "Origin")
            await client.post(f"{page}/api/stop")
        code, _, errors = await paani(private_sets, "tune", "promote", "0000")
        assert (code, "not the proposal" in errors) == (2, True)
        assert (await paani(private_sets, "tune", "promote", name))[0] == 0
        moved = await until(advisory, lambda a: a.direction is m.Direction.LEFT)
        assert moved.center_block_risk == 0.46

        assert (await paani(private_sets, "tune", "rollback", name))[0] == 0
        await until(advisory, lambda a: a.center_block_risk == 0.48)
        code, _, errors = await paani(private_sets, "tune", "rollback", name)
        assert (code, errors.count("\n")) == (2, 1)


async def test_a_restarted_advisor_is_back_at_its_configuration(
    open_as: OpenAs, spawn: Spawn, perception: Bus, private_sets: tuple[str, ...]
) -> None:
    """The promotion is still repeated on the bus; it is refused, and both page and command say so."""
    observer = await open_as("observer")
    shadow, advisory = observer.latest(keys.SHADOW), observer.latest(keys.ADVISORY)
    async with spawn("operator"), spawn("dashboard"):
        async with spawn("advisor", FEW):
            _, out, _ = await paani(private_sets, "tune", "propose", "advisor.policy.center_block_risk=0.46", "--json")
            await until(shadow, lambda s: s.frames >= 5)
            name = msgspec.json.decode(out, type=m.Shadow).proposal
            assert (await paani(private_sets, "tune", "promote", name))[0] == 0
            await until(advisory, lambda a: a.direction is m.Direction.LEFT)
        async with spawn("advisor", FEW):
            after = await until(shadow, lambda s: s.refused > 0)
            assert (after.active, after.refusal) == ("", m.TuningRefusal.NOT_CURRENT)
            assert (await until(advisory, lambda a: a.frame_seq > 0)).direction is m.Direction.STRAIGHT
            _, out, _ = await paani(private_sets, "tune", "status")
            assert "in force  the configuration" in out


async def test_nobody_arms_while_a_request_waits_for_the_advisor(spawn: Spawn, config: Config) -> None:
    """What is promoted wants an arming after it, never one that overtakes it."""
    page = f"http://127.0.0.1:{config.dashboard.port}"
    async with spawn("operator"), spawn("dashboard"), aiohttp.ClientSession() as client:
        ours = await asyncio.to_thread(headers_of, page, config.bus)
        asking = asyncio.create_task(client.post(f"{page}/api/tune/promote", json={"proposal": "7f3a"}, headers=ours))
        await asyncio.sleep(0.5)
        status, text = await hold_on_page(page, config.bus, press=1)
        assert (status, "a tuning request waits" in text) == (409, True)
        async with await asking as answer:
            assert (answer.status, (await answer.json())["field"]) == (503, keys.SHADOW.name)
        await arm_on_page(page, config.bus, press=2)


async def test_only_the_dashboard_may_tune_and_nonsense_is_counted(
    open_as: OpenAs, spawn: Spawn, perception: Bus
) -> None:
    """B13: the router lets nobody else write the key; what the dashboard itself gets wrong is dropped or refused."""
    observer, navigator, dashboard = [await open_as(user) for user in ("observer", "navigator", "dashboard")]
    shadow, health = observer.latest(keys.SHADOW), observer.latest(keys.health("advisor"))
    change = m.Change(path="advisor.policy.tie", value="0.1")
    wanted = m.Tuning(source_us=CLOCK.now_us(), act=m.TuningAct.PROPOSE, request=1, proposal="a", changes=(change,))
    async with spawn("advisor"):
        await shadow.next()
        forged = msgspec.structs.replace(wanted, producer="dashboard", epoch=CLOCK.now_us() // 1000)
        for _ in range(5):
            put_raw(navigator, keys.TUNING.name, msgspec.json.encode(forged))
            await asyncio.sleep(0.1)
        assert (await shadow.next()).proposal == ""
        for nonsense in (b"\xff", b'{"act":"PROPOSE"}', msgspec.json.encode(forged).replace(b'"0.1"', b"NaN")):
            put_raw(dashboard, keys.TUNING.name, nonsense)
        publisher = dashboard.publisher(keys.TUNING)
        bad = m.Change(path="advisor.policy.tie", value="nan")
        publisher.put(msgspec.structs.replace(wanted, changes=(bad,)))
        assert (await until(shadow, lambda s: s.refused)).refused_path == bad.path
        publisher.put(msgspec.structs.replace(wanted, request=2))
        assert (await until(shadow, lambda s: s.proposal)).proposal == "a"

        def counted(report: m.Health) -> bool:
            drops = {drop.cause: drop.count for drop in report.drops}
            return drops.get("refused_tuning") == 1 and sum(drops.values()) == 4

        assert await until(health, counted)


async def test_tuned_advice_is_computed_again_from_the_ledger(open_as: OpenAs, spawn: Spawn, perception: Bus) -> None:
    """What was tried and promoted is in the steps and messages, so a replay gives the same bytes."""
    observer, operator, dashboard = [await open_as(user) for user in ("observer", "operator", "dashboard")]
    topics = (keys.STEPS["advisor"], *ADVISOR.inputs, *ADVISOR.outputs)
    log: dict[str, Any] = {topic.name: observer.queue(topic, 2000) for topic in topics}
    arming, tuning = operator.publisher(keys.ARMING), dashboard.publisher(keys.TUNING)
    change = m.Change(path="advisor.policy.center_block_risk", value="0.46")
    async with spawn("advisor", FEW):
        for request in range(40):
            now_us = CLOCK.now_us()
            arming.put(m.Arming(source_us=now_us, armed=False))
            act = {3: m.TuningAct.PROPOSE, 15: m.TuningAct.PROMOTE, 30: m.TuningAct.ROLLBACK}.get(request)
            if act is not None:
                changes = (change,) if act is m.TuningAct.PROPOSE else ()
                tuning.put(m.Tuning(source_us=now_us, act=act, request=request, proposal="a", changes=changes))
            await asyncio.sleep(0.1)
    received = {name: inbox.drain() for name, inbox in log.items()}
    found = {(name, item.epoch, item.seq): item for name, items in received.items() for item in items}
    config = load_config(sets=(FEW,))
    steps: list[m.Step] = received[keys.STEPS["advisor"].name]
    state = msgspec.json.decode(steps[0].state, type=type(ADVISOR.state()))
    limits: list[float] = []
    for step in steps:
        inputs = {topic.name: Input() for topic in ADVISOR.inputs} | {
            h.topic: Input(found[h.topic, h.epoch, h.seq], h.received_us) for h in step.heard
        }
        if step.state:
            assert msgspec.json.encode(state).decode() == step.state
        state, outputs = ADVISOR.decide(state, inputs, step.source_us, config)
        for sent in step.sent:
            recorded = found[sent.topic, sent.epoch, sent.seq]
            header = {name: getattr(recorded, name) for name in ("seq", "epoch", "domain", "producer", "sent_us")}
            again = msgspec.structs.replace(outputs[sent.topic], **header)
            assert msgspec.json.encode(again) == msgspec.json.encode(recorded)
            if isinstance(recorded, m.Advisory):
                limits.append(recorded.center_block_risk)
    assert [limit for limit, _ in itertools.groupby(limits)] == [0.48, 0.46, 0.48]
