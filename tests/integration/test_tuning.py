"""`paani tune` on running processes: tried beside, promoted while disarmed, taken back, forgotten by a restart."""

from __future__ import annotations

import asyncio
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
from tests.at_work import at_work
from tests.conftest import OpenAs, Spawn, find_free_port, put_raw
from tests.paani_command import paani
from tests.unit.paani_services.advisor.advisor_evidence import water

pytestmark = [pytest.mark.integration, pytest.mark.timeout(120)]
CLOCK = WallClock()
BETWEEN = water(0.3, 0.47, 0.4)  # clear at 0.48, blocked at 0.46
ADVISOR = decider_of("advisor")
HEADER = ("seq", "epoch", "domain", "producer", "sent_us", "topic")
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

    async with at_work(speak()):
        yield bus


async def until(inbox: Any, wanted: Any) -> Any:
    async with asyncio.timeout(15):
        while True:
            value = await inbox.next()
            if wanted(value):
                return value


@pytest.mark.rotating(cpu_s=6)
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


@pytest.mark.rotating(cpu_s=3)
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
        async with asyncio.TaskGroup() as group:
            request = client.post(f"{page}/api/tune/promote", json={"proposal": "7f3a"}, headers=ours)
            asking = group.create_task(request)  # ended with the group where that fails
            await asyncio.sleep(0.5)
            status, text = await hold_on_page(page, config.bus, press=1)
            assert (status, "a tuning request waits" in text) == (409, True)
        async with asking.result() as answer:
            assert (answer.status, (await answer.json())["field"]) == (503, keys.SHADOW.name)
        await arm_on_page(page, config.bus, press=2)


async def test_what_a_ground_station_writes_is_on_trial_until_the_page_promotes_it(
    open_as: OpenAs, spawn: Spawn, perception: Bus, private_sets: tuple[str, ...]
) -> None:
    """A trial is no change: the advice stays what it was. Another's trial does not make room for it."""
    common: Any = pytest.importorskip("pymavlink.dialects.v20.common", reason="needs pymavlink")
    observer = await open_as("observer")
    shadow, advisory = observer.latest(keys.SHADOW), observer.latest(keys.ADVISORY)
    tcp, name = find_free_port(), "advisor.policy.center_block_risk"
    change = m.Change(path="advisor.policy.tie", value="0.1")
    async with spawn("operator"), spawn("dashboard"), spawn("advisor", FEW):
        client = await open_as("mavlink")
        proposals = client.publisher(keys.TUNING_PROPOSALS["mavlink"])
        await shadow.next()
        for proposal in ("7f3a", "mavlink1"):  # a name that is not the client's own, and one that is
            proposals.put(m.TuningProposal(source_us=CLOCK.now_us(), proposal=proposal, changes=(change,)))
        assert (await until(shadow, lambda s: s.answered)).proposal == "mavlink1"
        code, out, _ = await paani(private_sets, "tune", "propose", f"{name}=0.47", "--json")
        theirs = msgspec.json.decode(out, type=m.Shadow).proposal
        proposals.put(m.TuningProposal(source_us=CLOCK.now_us(), proposal="mavlink2", changes=(change,)))
        await until(shadow, lambda s: s.frames >= 5)
        assert ((await shadow.next()).proposal, code) == (theirs, 0)
        await client.close()
        async with spawn("mavlink", f"mavlink.tcp=127.0.0.1:{tcp}", 'mavlink.udp=""'), asyncio.timeout(30.0):
            reader, writer = await asyncio.open_connection("127.0.0.1", tcp)
            codec = common.MAVLink(None, 255, 190)
            received: list[Any] = []
            texts: list[str] = []

            async def answer(kind: str, **fields: Any) -> Any:
                """The next message of this kind with these fields."""
                while True:
                    while received:
                        message = received.pop(0)
                        texts.extend([message.text] if message.get_type() == "STATUSTEXT" else [])
                        if message.get_type() == kind and fields.items() <= message.to_dict().items():
                            return message
                    received.extend(codec.parse_buffer(await reader.readexactly(1)) or ())

            def write(parameter: bytes, value: float) -> None:
                writer.write(common.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(codec))
                writer.write(common.MAVLink_param_set_message(1, 1, parameter, value, 9).pack(codec))

            while f"parameter: the page tries {theirs} now" not in texts:
                write(b"POL_CEN_BLO_RIS", 0.46)
                await answer("PARAM_ERROR")
            assert (await paani(private_sets, "tune", "rollback", theirs))[0] == 0
            await until(shadow, lambda s: not s.proposal)
            write(b"POL_TIE", 5.0)  # no such margin
            write(b"POL_CEN_BLO_RIS", 0.46)
            error = await answer("PARAM_ERROR", param_id="POL_TIE")
            assert error.error == common.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
            trial = await until(shadow, lambda s: s.frames >= 5)
            assert (trial.changes, trial.active) == ((m.Change(path=name, value="0.46"),), "")
            assert trial.recent[-1].shadow_direction is m.Direction.LEFT
            assert (await advisory.next()).direction is m.Direction.STRAIGHT
            await answer("STATUSTEXT", text=f"on trial as {trial.proposal}: promote it on the page")
            assert (await answer("PARAM_VALUE", param_id="POL_CEN_BLO_RIS")).param_value == pytest.approx(0.48)
            write(b"POL_CEN_BLO_RIS", 0.46)  # on trial already, and still
            assert (await answer("PARAM_VALUE", param_id="POL_CEN_BLO_RIS")).param_value == pytest.approx(0.48)
            assert (await shadow.next()).frames >= trial.frames
            assert (await paani(private_sets, "tune", "promote", trial.proposal))[0] == 0
            assert (await answer("PARAM_VALUE", param_id="POL_CEN_BLO_RIS")).param_value == pytest.approx(0.46)
            writer.close()


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
        forged = msgspec.structs.replace(
            wanted, producer="dashboard", topic=keys.TUNING.name, epoch=CLOCK.now_us() // 1000
        )
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
            header = {name: getattr(recorded, name) for name in HEADER}
            again = msgspec.structs.replace(outputs[sent.topic], **header)
            assert msgspec.json.encode(again) == msgspec.json.encode(recorded)
            if isinstance(recorded, m.Advisory):
                limits.append(recorded.center_block_risk)
    assert [limit for limit, _ in itertools.groupby(limits)] == [0.48, 0.46, 0.48]
