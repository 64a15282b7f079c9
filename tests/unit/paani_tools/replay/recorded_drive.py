"""A drive without a bus: the real deciders step on made-up inputs, and leave the ledger that live ones leave."""

from __future__ import annotations

import itertools
import math
import random
import types
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import msgspec
from mcap.writer import Writer

from paani import keys
from paani import messages as m
from paani.bus.stepping import STATE_EVERY_US
from paani.config import Config, encode_config, load_config
from paani.decider import Decider, Input, deciders
from paani.logs.reader import Record
from tests.unit.paani_services.advisor.advisor_evidence import BUOY_AHEAD, CLEAR, water

T0_US = 1_800_000_000_000_000
CONFIG = load_config()
TARGET = m.Waypoint(x_m=40.0, y_m=5.0)  # of every order


class Desk:
    """Messages come and deciders step at `now_us`; `records` is what a recorder would have written."""

    def __init__(self, config: Config = CONFIG) -> None:
        self.config, self.now_us = config, T0_US
        self.records: list[Record] = []
        self._numbers: dict[str, itertools.count[int]] = {}
        self._newest: dict[str, Input] = {}
        self._deciders = deciders()
        self._epochs = dict.fromkeys(self._deciders, T0_US // 1000)
        self._states = {name: decider.state() for name, decider in self._deciders.items()}
        self._state_us: dict[str, int] = {}

    def publish(self, topic: keys.Topic[Any], message: m.Message) -> m.Message:
        numbers = self._numbers.setdefault(topic.name, itertools.count())
        sent: m.Message = topic.stamp(
            message,
            domain=self.config.bus.domain,
            seq=next(numbers),
            epoch=self._epochs.get(topic.producer, T0_US // 1000),
            sent_us=self.now_us,
        )
        self.records.append(Record(topic.name, self.now_us + 200, sent.seq, msgspec.json.encode(sent)))
        self._newest[topic.name] = Input(sent, self.now_us + 150)
        return sent

    def step(self, service: str, *, publishing: bool = True) -> None:
        """What `paani.bus.Stepper` does."""
        decider: Decider[Any] = self._deciders[service]
        inputs = {topic.name: self._newest.get(topic.name, Input()) for topic in decider.inputs}
        inputs |= {topic.name: self._newest[topic.name] for topic in decider.own if topic.name in self._newest}
        before = self._states[service]
        self._states[service], outputs = decider.decide(before, inputs, self.now_us, self.config)
        topics = {topic.name: topic for topic in decider.outputs}
        sent = [self.publish(topics[name], message) for name, message in outputs.items()] if publishing else []
        due = self.now_us - self._state_us.get(service, -STATE_EVERY_US) >= STATE_EVERY_US
        if due:
            self._state_us[service] = self.now_us
        self.publish(
            keys.STEPS[service],
            m.Step(
                source_us=self.now_us,
                heard=tuple(
                    m.InputMessage(topic=n, epoch=i.message.epoch, seq=i.message.seq, received_us=i.received_us)
                    for n, i in inputs.items()
                    if i.message is not None
                ),
                sent=tuple(
                    m.OutputMessage(topic=n, epoch=s.epoch, seq=s.seq, sent_us=s.sent_us)
                    for n, s in zip(outputs, sent, strict=False)
                ),
                state=msgspec.json.encode(before).decode() if due else "",
            ),
        )

    def restart(self, service: str) -> None:
        """The process ends and comes back."""
        self._epochs[service] += 1000 * (self.now_us - T0_US) // 1_000_000 + 1
        self._states[service] = self._deciders[service].state()
        self._state_us.pop(service, None)
        for topic in (*self._deciders[service].outputs, *self._deciders[service].own, keys.STEPS[service]):
            self._numbers.pop(topic.name, None)


def drive(
    seconds: float,
    config: Config = CONFIG,
    seed: int = 1,
    restart_at_s: float | None = None,
    modes: tuple[m.DriveMode, ...] = (),
    missions: tuple[m.Mission, ...] = (),
) -> list[Record]:
    """An armed boat among buoys: evidence at 5 Hz, odometry at 20 Hz, the navigator not always publishing.

    modes: ordered one after the other, each for as long; without any nobody orders one. missions: in force one after
    the other, likewise; without any the route alone is.
    """
    desk, dice = Desk(config), random.Random(seed)
    route = m.Route(
        source_us=T0_US, name="a", waypoints=(m.Waypoint(x_m=60.0, y_m=0.0), m.Waypoint(x_m=60.0, y_m=40.0))
    )
    for tick in range(round(seconds * 20)):
        desk.now_us = T0_US + tick * 50_000 + dice.randrange(2000)
        at_s = tick * 0.05
        if tick % 40 == 0:
            desk.publish(keys.ROUTE, route)
            if missions:
                desk.publish(keys.MISSION, missions[int(at_s / seconds * len(missions))])
        if restart_at_s is not None and math.isclose(at_s, restart_at_s, abs_tol=0.025):
            desk.restart("advisor")
            desk.restart("controller")
        desk.publish(keys.SIM_TIME, m.SimTime(source_us=desk.now_us, sim_us=tick * 50_000, stamp_us=tick * 50_000 + 7))
        desk.publish(keys.ODOMETRY, _odometry(desk.now_us, at_s, dice))
        if modes and tick % 2 == 0:
            desk.publish(keys.OPERATOR_ORDER, _order(desk.now_us, modes, at_s / seconds))
        if tick % 4 == 0:
            desk.publish(keys.ARMING, m.Arming(source_us=desk.now_us, armed=True))
            desk.publish(keys.EVIDENCE, _evidence(desk.now_us - 100_000, tick // 4, dice))
            desk.now_us += 3000
            desk.step("advisor")
        desk.now_us += 1000
        desk.step("navigator", publishing=tick % 3 != 0)
        if tick % 3 != 0:
            desk.now_us += 1000
            desk.step("controller")
    return desk.records


def _order(now_us: int, modes: tuple[m.DriveMode, ...], part: float) -> m.OperatorOrder:
    """The mode that is due at this part of the drive."""
    number = int(part * len(modes))
    return m.OperatorOrder(
        source_us=now_us, mode=modes[number], since_us=number + 1, target=(TARGET,), surge=0.6, turn=part,
        by="dashboard",
    )  # fmt: skip


def write_log(
    path: Path,
    records: Iterable[Record],
    config: Config | None = CONFIG,
    *,
    attached: Mapping[str, bytes] = types.MappingProxyType({}),
    schemas: Mapping[str, bytes] = types.MappingProxyType({}),
    chunked: bool = True,
) -> Path:
    """An MCAP file as a recorder writes it, with these schemas of topics."""
    attachments = {} if config is None else {"config.json": encode_config(config)}
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=64 * 1024, use_chunking=chunked)
        writer.start("paani", "paani 0.1.0")
        schema = writer.register_schema("paani.Any", "jsonschema", b'{"type":"object"}')
        channels: dict[str, int] = {}
        for name, data in {**attachments, **attached}.items():
            writer.add_attachment(0, 0, name, "application/json", data)
        for topic, log_us, seq, data in records:
            if topic not in channels:
                of = writer.register_schema(topic, "jsonschema", schemas[topic]) if topic in schemas else schema
                channels[topic] = writer.register_channel(topic, "json", of)
            writer.add_message(channels[topic], log_us * 1000, data, log_us * 1000, seq)
        writer.finish()
    return path


def _odometry(now_us: int, at_s: float, dice: random.Random) -> m.Odometry:
    return m.Odometry(
        source_us=now_us,
        x_m=0.5 * at_s,
        y_m=math.sin(at_s / 9),
        yaw_rad=0.1 * math.sin(at_s / 5) + dice.gauss(0, 0.01),
        surge_mps=0.5,
        healthy=True,
    )


def _evidence(source_us: int, number: int, dice: random.Random) -> m.Evidence:
    """Clear water, buoys that come and go, and now and then a picture that cannot be used."""
    seen = CLEAR
    if number % 25 > 12:
        x = 0.45 + 0.2 * math.sin(number / 40)
        box = (x, 0.35, min(1.0, x + 0.08), 0.45 + 0.02 * (number % 25 - 12))
        seen = msgspec.structs.replace(CLEAR, detections=(msgspec.structs.replace(BUOY_AHEAD, box_xyxy=box),))
    elif number % 25 > 8:
        seen = water(0.1 + 0.3 * dice.random(), 0.3 + 0.4 * dice.random(), 0.1 + 0.5 * dice.random())
    if number % 60 == 59:
        seen = msgspec.structs.replace(CLEAR, usable=False, cause=m.UnusableCause.BLACK)
    return msgspec.structs.replace(seen, source_us=source_us, frame_seq=number, frame_epoch=T0_US // 1000)
