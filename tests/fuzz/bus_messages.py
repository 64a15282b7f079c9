"""Hostile messages on every key, through what receives them: admission, recorder, page, cores, thrust adapter."""

from __future__ import annotations

import asyncio
import random
from pathlib import Path
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Picture, Stepper
from paani.bus.admission import Admission
from paani.clock import ManualClock
from paani.config import RecorderConfig, encode_config, load_config
from paani.cores import load_estimator
from paani.decider import decider_of
from paani.logs.writer import About, read_head
from paani.messages import ZeroCause
from paani.thrust_adapter import ThrustAdapter
from paani_services.bridge.symbols import guide_of, symbols_of
from paani_services.dashboard.hub import Hub
from paani_services.dashboard.operator_events import describe_operator_change
from paani_services.dashboard.status import board_status
from paani_services.operator.console import Console
from paani_services.operator.missions import NO_MISSION
from paani_services.operator.wheel import Facts
from paani_services.recorder.backlog import Backlog, QueuedMessage
from paani_services.recorder.recording import Recording
from paani_sim.trials.lockstep_bus import LockstepBus
from paani_tools.bench.faults.hostile import HostileMessages
from paani_tools.up.run_summary import Summary
from tests.fuzz.target import ContractError, MotionError, Target

GRAPH = keys.Graph.SIMULATION
START_US = 1_800_000_000_000_000
STEP_S = 0.01  # of time, for each payload
STEPS_EVERY = 16  # payloads between two steps of everything that decides
WRITTEN_EVERY = 64
PICTURE = b"\xff\xd8\xff\xe0 no picture \xff\xd9"
HONEST = (0.3, 0.25)


class Receivers:
    """Admission for every key of a graph, as each process has it."""

    def __init__(self) -> None:
        self.config = load_config(sets=("localization.origin_lat_lon_deg=[52.0, 4.0]",))
        self.domain = self.config.bus.domain
        self.topics = {topic.name: topic for topic in keys.every_topic(GRAPH)}
        self._admissions = {
            name: Admission(topic, self.domain, self.config.bus.max_future_s) for name, topic in self.topics.items()
        }

    def judge(self, name: str, data: bytes, now_us: int) -> tuple[m.Message | None, str]:
        message, cause = self._admissions[name].judge(data, now_us)
        if (message is None) is not bool(cause):
            raise ContractError(f"{name}: refused without a cause")
        return message, cause


class DisarmedChain(Target):
    """Everything that a boat's processes do with what they hear, while nobody has armed it: it never moves.

    The navigator alone is told that the boat is armed, so that it plans and the controller gives thrust.
    """

    name = "messages of every key, disarmed"
    share = 400

    def __init__(self, folder: Path, rng: random.Random) -> None:
        super().__init__(folder, rng)
        self._receivers, self._clock = Receivers(), ManualClock(START_US)
        config, domain = self._receivers.config, self._receivers.domain
        self._hostile = {name: HostileMessages(topic, domain, rng) for name, topic in self._receivers.topics.items()}
        self._expected: tuple[bytes, bool] = (b"", False)
        self._bus = LockstepBus(self._clock, domain)
        self._honest = LockstepBus(self._clock, domain)
        self._steppers = {
            name: Stepper(self._bus, self._clock, config, decider_of(name)) for name in keys.DECIDING_SERVICES
        }
        route = m.Route(source_us=START_US, name="r", repeat=True, waypoints=tuple(_corner(n) for n in range(3)))
        self._steppers["navigator"].publish_own(keys.ROUTE, route)
        self._estimator = load_estimator(config.localization)
        self._samples: list[m.ImuSample] = []
        self._fix: m.GpsFix | None = None
        self._adapter = ThrustAdapter(config.plant.adapter, domain)
        self._hub = Hub()
        self._client = self._hub.add_client(START_US)
        self._operator_state: m.OperatorState | None = None
        self._backlog = Backlog(2000, 16 << 20)
        recorder = RecorderConfig(folder=str(folder), part_mib=2.0, budget_mib=4.0, min_free_mib=0.0)
        about = About(version="0", attachments={"config.json": encode_config(config)}, facts={"part": "1"})
        self._recording = Recording(recorder, about, list(self._receivers.topics.values()))
        self._summary = Summary()
        self._loop = asyncio.new_event_loop()
        self._console = Console(
            self._honest.publisher(keys.ARMING),  # type: ignore[arg-type]  # the bus of lockstep in the live one's place
            self._honest.publisher(keys.OPERATOR_STATE),  # type: ignore[arg-type]
            self._honest.publisher(keys.OPERATOR_ORDER),  # type: ignore[arg-type]
            self._honest.publisher(keys.ORDERED_MISSION),  # type: ignore[arg-type]
            folder,
            self._clock,
            lambda: Facts(mission=NO_MISSION),
        )
        self._count = 0

    def payload(self) -> bytes:
        name = self.rng.choice(list(self._hostile))
        made = self._hostile[name].next(self._clock.now_us())
        data = name.encode() + b"\n" + made.data
        self._expected = data, made.is_refused
        return data

    def take(self, data: bytes) -> str:
        self._count += 1
        self._clock.advance(STEP_S)
        now_us = self._clock.now_us()
        name, _, payload = data.partition(b"\n")
        topic = self._receivers.topics.get(name.decode("ascii", "replace"))
        if topic is None:
            return "no key"
        is_picture = topic.stance is keys.Stance.PICTURE
        body, attachment = (PICTURE, payload) if is_picture else (payload, b"")
        self._backlog.put(QueuedMessage(topic, now_us, read_head(payload), body, attachment))
        message, cause = self._receivers.judge(topic.name, payload, now_us)
        if message is not None:
            if self._expected == (data, True):
                raise ContractError(f"{topic.name} lets in what nobody may")
            self._hostile[topic.name].heard_epoch = message.epoch
            self._deliver(topic, message, now_us)
        if self._count % STEPS_EVERY == 0:
            self._step(now_us)
        if self._count % WRITTEN_EVERY == 0:
            self._recording.write(self._backlog.drain(), now_us)
        applied = self._adapter.decide(now_us)
        if (applied.left, applied.right, applied.left_n, applied.right_n) != (0.0, 0.0, 0.0, 0.0):
            raise MotionError(f"{applied} after a message on {topic.name}")
        if self._console.state.armed:
            raise MotionError(f"armed by a message on {topic.name}")
        return cause

    def close(self) -> None:
        self._recording.close(self._backlog.drain(), self._clock.now_us())
        self._loop.close()

    def _deliver(self, topic: keys.Topic[Any], message: m.Message, now_us: int) -> None:
        """To every process that subscribes to it."""
        value = Picture(message, PICTURE) if isinstance(message, m.PictureHeader) else message
        self._hub.put(topic.name, value, now_us, now_us)
        if topic.name != keys.ARMING.name:
            self._bus.deliver(topic, message)
        self._summary.feed(message)
        _give(self._adapter, message, now_us)
        match message:
            case m.ImuSample():
                self._samples = [*self._samples[-63:], message]
            case m.GpsFix():
                self._fix = message
            case m.OperatorRequest():
                client = topic.name.rpartition("/")[2]
                self._loop.run_until_complete(self._console.answer(client, message, now_us // 1000))
            case m.MissionRequest():
                client = topic.name.rpartition("/")[2]
                self._loop.run_until_complete(self._console.answer_mission(client, message))
            case m.OperatorState():
                for event in describe_operator_change(self._operator_state, message, now_us):
                    self._hub.publish_event(event)
                self._operator_state = message
            case m.ThrustApplied():
                self._console.confirm_stop(message)
            case m.Advisory():
                guide_of(symbols_of(message, now_us, now_us, 600), 1, 1, 600).encode()

    def _step(self, now_us: int) -> None:
        for service in self._receivers.config.plant.adapter.require_pulses:
            self._adapter.receive_pulse(service, now_us)
        clock = m.SimTime(source_us=now_us, sim_us=now_us, stamp_us=now_us, epoch=1)
        self._bus.deliver(keys.SIM_TIME, clock)
        self._bus.deliver(keys.ARMING, m.Arming(source_us=now_us, armed=True, stopped=False, sent_us=now_us))
        local, odometry = self._estimator.step(self._samples, self._fix, now_us)
        self._samples, self._fix = [], None
        if self._count % (4 * STEPS_EVERY) == 0:
            for topic, estimate in ((keys.LOCAL_ODOMETRY, local), (keys.ODOMETRY, odometry)):
                self._bus.deliver(topic, self._bus.put(topic, estimate))
        for stepper in self._steppers.values():
            _, outputs = stepper.decide()
            for name, sent in stepper.conclude(outputs).items():
                self._bus.deliver(self._receivers.topics[name], sent)
                if isinstance(sent, m.Thrust):
                    self._adapter.offer(sent, now_us)
        msgspec.json.encode(board_status(self._hub, "paani", now_us))
        self._console.publish()


class ArmedBoat(Target):
    """An armed boat under way: what nobody may take neither moves it otherwise nor stops it."""

    name = "messages of every key, under way"
    share = 100

    def __init__(self, folder: Path, rng: random.Random) -> None:
        super().__init__(folder, rng)
        self._receivers, self._clock = Receivers(), ManualClock(START_US)
        domain = self._receivers.domain
        self._hostile = {name: HostileMessages(topic, domain, rng) for name, topic in self._receivers.topics.items()}
        self._honest = LockstepBus(self._clock, domain)
        self._adapter = ThrustAdapter(self._receivers.config.plant.adapter, domain)
        self._pulses = [keys.pulse(name) for name in self._receivers.config.plant.adapter.require_pulses]
        self._vital = [keys.THRUST.name, keys.ARMING.name, *(topic.name for topic in self._pulses)]
        for name in self._vital:
            self._hostile[name].heard_epoch = self._honest.epoch
        self._count = 0

    def payload(self) -> bytes:
        name = self.rng.choice(self._vital if self.rng.random() < 0.5 else list(self._hostile))
        return name.encode() + b"\n" + self._hostile[name].next(self._clock.now_us(), refused=True).data

    def take(self, data: bytes) -> str:
        self._clock.advance(STEP_S)
        now_us = self._clock.now_us()
        if self._count % 10 == 0:
            self._say(keys.ARMING, m.Arming(source_us=now_us, armed=True, stopped=False))
            for topic in self._pulses:
                self._say(topic, m.Pulse(source_us=now_us))
            left, right = HONEST
            self._say(keys.THRUST, m.Thrust(source_us=now_us, echo_us=now_us, left=left, right=right, enabled=True))
        self._count += 1
        name, _, payload = data.partition(b"\n")
        key = name.decode("ascii", "replace")
        cause = self._hear(key, payload, now_us) if key in self._receivers.topics else "no key"
        if not cause:
            raise ContractError(f"{key} lets in what nobody may")
        applied = self._adapter.decide(now_us)
        if (applied.left, applied.right) != HONEST or applied.zero_cause is not ZeroCause.NONE:
            raise MotionError(f"{applied} after a message on {key}")
        return cause

    def _say(self, topic: keys.Topic[Any], message: m.Message) -> None:
        """What an honest process says, through the same admission."""
        sent = self._honest.put(topic, message)
        if cause := self._hear(topic.name, msgspec.json.encode(sent), self._clock.now_us()):
            raise ContractError(f"{topic.name}: honest, and refused: {cause}")

    def _hear(self, name: str, data: bytes, now_us: int) -> str:
        message, cause = self._receivers.judge(name, data, now_us)
        _give(self._adapter, message, now_us)
        return cause


def _corner(number: int) -> m.Waypoint:
    return m.Waypoint(x_m=30.0 * (number > 0), y_m=30.0 * (number > 1))


def _give(adapter: ThrustAdapter, message: m.Message | None, now_us: int) -> None:
    """To the thrust adapter, if it takes such a message."""
    match message:
        case m.Thrust():
            adapter.offer(message, now_us)
        case m.Arming():
            adapter.receive_arming(message, now_us)
        case m.Pulse():
            adapter.receive_pulse(message.producer, now_us)
