"""What the boat says to its ground stations, and how it answers each. No input or output of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from paani import messages as m
from paani.config import AdvisorConfig
from paani_services.mavlink import commands
from paani_services.mavlink.announcements import Announcer, summary
from paani_services.mavlink.camera import CAMERA_COMPONENT, Camera
from paani_services.mavlink.codec import COMPONENT, HEARTBEAT, SYSTEM, dialect
from paani_services.mavlink.commands import Act, Verdict, judge_command, judge_mode
from paani_services.mavlink.fields import integer
from paani_services.mavlink.file_transfer import refuse_file
from paani_services.mavlink.log_transfers import LogTransfers
from paani_services.mavlink.mission_exchange import MissionExchange, MissionOrder
from paani_services.mavlink.parameter_exchange import ParameterExchange, ParameterWrite
from paani_services.mavlink.snapshot import Snapshot
from paani_services.mavlink.station import REQUEST_CONTROL, Source, Station, source_of
from paani_services.mavlink.streams import MISSION_CURRENT, STREAMED
from paani_services.mavlink.telemetry import BUILDERS

AUTOPILOT_VERSION = dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION
GROUND_STATION = dialect.MAV_TYPE_GCS
FULL_DEFLECTION = 1000  # of a stick; a field that is not used has 0x7fff
SEND_ONE = {  # commands that ask for one message that they name
    dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: AUTOPILOT_VERSION,
    dialect.MAV_CMD_GET_HOME_POSITION: dialect.MAVLINK_MSG_ID_HOME_POSITION,
}


class Request(NamedTuple):
    """An act that a station asks for, to be acknowledged to it as this command when it is done; mode: of Act.MODE."""

    act: Act
    station: Station
    command: int
    target: Source
    mode: m.DriveMode = m.DriveMode.IDLE

    @property
    def hand(self) -> int:
        """Of who asks."""
        return self.station.hand_of(self.target)


class Gateway:
    """ask, send: what is asked of the operator's process, and missions for it. drive: says surge and turn of a hand.
    try_parameter: has a parameter tried that a station writes. is_signed: whether there is a key.

    count: something refused, by its cause. camera: the boat's second component.
    advisor, cruise_mps: the settings that stations read as parameters.
    """

    def __init__(
        self,
        ask: Callable[[Request], None],
        send: Callable[[MissionOrder], None],
        drive: Callable[[float, float, int], None],
        try_parameter: Callable[[ParameterWrite], None],
        count: Callable[[str], None],
        camera: Camera,
        *,
        advisor: AdvisorConfig,
        cruise_mps: float,
        is_signed: bool,
    ) -> None:
        self._ask, self._drive, self._count, self._camera = ask, drive, count, camera
        self._is_signed = is_signed
        self.stations: list[Station] = []
        self._commander: Source | None = None  # who asked for the arming, or for the wheel since
        self.commander_us: int | None = None  # when that station was heard last
        self._snapshot = Snapshot(now_us=0)
        self.missions = MissionExchange(send, count, self._is_trusted)
        self.parameters = ParameterExchange(try_parameter, count, self._is_trusted, advisor, cruise_mps)
        self.logs = LogTransfers(count, self._is_trusted)
        self._announcer = Announcer()
        self._welcomed = set[Station]()
        self._handlers: dict[str, Callable[[Station, Any, Source], None]] = {
            "COMMAND_LONG": self._command_long,
            "COMMAND_INT": self._command_int,
            "SET_MODE": self._set_mode,
            "PING": self._ping,
            "TIMESYNC": self._timesync,
            **self.parameters.handlers,
            **self.missions.handlers,
            "MISSION_SET_CURRENT": self._refuse_current,
            "FILE_TRANSFER_PROTOCOL": self._refuse_file,
            **self.logs.handlers,
            "MANUAL_CONTROL": self._manual_control,
            "CHANGE_OPERATOR_CONTROL": self._change_operator_control,
        }

    def tick(self, snapshot: Snapshot) -> None:
        """Send what is due. To be called 50 times a second."""
        now_us, self._snapshot = snapshot.now_us, snapshot
        texts = self._announcer.observe(snapshot)
        news = [*self.missions.follow(snapshot), *self.parameters.follow(snapshot)]
        self.logs.follow(snapshot)
        for station in tuple(self.stations):
            if station.stick is not None:
                self._drive(*station.stick)
                station.stick = None
            if not station.is_present(now_us):
                self._welcomed.discard(station)
                if 0 in station.schedule.due(now_us):
                    self._send_message(station, 0)
                continue
            is_new = station not in self._welcomed
            self._welcomed.add(station)
            for message in (*(summary(snapshot) if is_new else texts), *news):
                station.send(message, now_us)
            for message_id in station.schedule.due(now_us):
                self._send_message(station, message_id)
            self.parameters.send_due(station)

    def receive(self, station: Station, data: bytes, now_us: int) -> bool:
        """Answer what a station has sent. Damaged bytes are counted and otherwise without effect.

        False where it was too much of late, so that nothing was read.
        """
        damaged = station.damaged
        messages = station.receive(data, now_us)
        if messages is None:
            self._count("mavlink_flood")
            return False
        for _ in range(station.damaged - damaged):
            self._count("mavlink_damaged")
        for message in messages:
            source = source_of(message)
            if source in {(SYSTEM, COMPONENT), (SYSTEM, CAMERA_COMPONENT)}:  # our own, come back
                continue
            if self._is_heartbeat_of_commander(station, message, source):
                self.commander_us = now_us
            handler = self._handlers.get(message.get_type())
            if self._is_addressed(message, CAMERA_COMPONENT):
                self._camera.receive(station, message, source, now_us, self._snapshot.boot_ms)
            elif handler is not None and self._is_addressed(message, COMPONENT, 0):
                handler(station, message, source)
        return True

    def remove(self, station: Station) -> None:
        """Forget a station whose link has ended."""
        self._welcomed.discard(station)
        self.missions.forget(station)
        self.logs.forget(station)
        if station in self.stations:
            self.stations.remove(station)

    def _is_addressed(self, message: Any, *components: int) -> bool:
        """Whether a message is for one of these components of this boat; 0 is everybody's address."""
        system = getattr(message, "target_system", getattr(message, "target", 0))
        component = getattr(message, "target_component", 0)
        return system in {0, SYSTEM} and component in components

    def _is_heartbeat_of_commander(self, station: Station, message: Any, source: Source) -> bool:
        """Whether who armed the boat, or has its wheel since, is there; any ground station until one has asked."""
        if message.get_type() != "HEARTBEAT" or not self._is_trusted(station, message):
            return False
        return message.type == GROUND_STATION if self._commander is None else source == self._commander

    def _is_trusted(self, station: Station, message: Any) -> bool:
        return bool(message.get_signed()) if self._is_signed else station.is_local

    # What is asked

    def _command_long(self, station: Station, message: Any, source: Source) -> None:
        parameters = [message.param1, message.param2, message.param3, message.param4, message.param5]
        self._command(station, message, source, parameters)

    def _command_int(self, station: Station, message: Any, source: Source) -> None:
        self._command(station, message, source, [message.param1, message.param2, message.param3, message.param4])

    def _command(self, station: Station, message: Any, source: Source, parameters: Sequence[float]) -> None:
        command, now_us = message.command, self._snapshot.now_us
        first = integer(parameters[0])
        if command == dialect.MAV_CMD_REQUEST_MESSAGE or command in SEND_ONE:
            is_sent = self._send_message(station, SEND_ONE.get(command, -1 if first is None else first))
            result = commands.ACCEPTED if is_sent else commands.UNSUPPORTED if is_sent is None else commands.LATER
            station.acknowledge(command, result, source, now_us)
        elif command == dialect.MAV_CMD_SET_MESSAGE_INTERVAL:
            is_taken = first is not None and station.schedule.set_interval(first, parameters[1])
            station.acknowledge(command, commands.ACCEPTED if is_taken else commands.DENIED, source, now_us)
        elif command == dialect.MAV_CMD_GET_MESSAGE_INTERVAL:
            message_id = -1 if first is None else first
            interval_us = station.schedule.interval_us(message_id)
            station.send(dialect.MAVLink_message_interval_message(message_id & 0xFFFF, interval_us), now_us)
            station.acknowledge(command, commands.ACCEPTED, source, now_us)
        else:
            verdict = judge_command(command, parameters, self._snapshot, is_trusted=self._is_trusted(station, message))
            if verdict.act is Act.ARM and message.target_system != SYSTEM:
                verdict = Verdict(commands.DENIED, "arm: name the boat, not everybody")
            self._answer(station, verdict, command, source)

    def _set_mode(self, station: Station, message: Any, source: Source) -> None:
        """The old way to ask for a mode; its base mode never arms."""
        verdict = judge_mode(message.base_mode, message.custom_mode)
        if not self._is_trusted(station, message):
            verdict = Verdict(commands.DENIED, commands.NOT_TRUSTED)
        self._answer(station, verdict, dialect.MAVLINK_MSG_ID_SET_MODE, source)

    def _answer(self, station: Station, verdict: Verdict, command: int, source: Source) -> None:
        if verdict.act is not None:
            if verdict.act is Act.ARM:
                self._follow_commander(source)
            self._ask(Request(verdict.act, station, command, source, verdict.mode))
            return
        if verdict.result != commands.ACCEPTED:
            self._count("mavlink_refused")
        station.acknowledge(command, verdict.result, source, self._snapshot.now_us, verdict.text)

    def _follow_commander(self, source: Source) -> None:
        self._commander, self.commander_us = source, self._snapshot.now_us

    def _ping(self, station: Station, message: Any, source: Source) -> None:
        if (message.target_system, message.target_component) == (0, 0):
            answer = dialect.MAVLink_ping_message(message.time_usec, message.seq, *source)
            station.send(answer, self._snapshot.now_us)

    def _timesync(self, station: Station, message: Any, _: Source) -> None:
        if message.tc1 == 0:
            now_us = self._snapshot.now_us
            station.send(dialect.MAVLink_timesync_message(now_us * 1000, message.ts1), now_us)

    # Files

    def _refuse_current(self, station: Station, _: Any, __: Source) -> None:
        """Nothing jumps. The item is told no more often than why: MAVSDK asks again whenever it hears of another."""
        self._count("mavlink_refused")
        if station.refuse(commands.NO_JUMP, self._snapshot.now_us):
            self._send_message(station, MISSION_CURRENT)

    def _refuse_file(self, station: Station, message: Any, _: Source) -> None:
        answer = refuse_file(message)
        if answer is not None:
            station.send(answer, self._snapshot.now_us)

    # The wheel

    def _manual_control(self, station: Station, message: Any, source: Source) -> None:
        """As ArduRover and QGroundControl have it: z ahead, y to starboard. Silence lets the stick go."""
        operator, hand = self._snapshot.operator, station.hand_of(source)
        is_holder = operator is not None and operator.wheel_hand == hand
        if not self._is_trusted(station, message):
            station.refuse(commands.NOT_TRUSTED, self._snapshot.now_us)
        elif operator is None or not is_holder or operator.mode is not m.DriveMode.MANUAL:
            station.refuse("refused: ask for mode MANUAL first", self._snapshot.now_us)
        elif max(abs(message.y), abs(message.z)) <= FULL_DEFLECTION:
            station.stick = message.z / FULL_DEFLECTION, -message.y / FULL_DEFLECTION, hand

    def _change_operator_control(self, station: Station, message: Any, source: Source) -> None:
        """Take the wheel from whoever holds it; it is not given back to nobody."""
        if message.control_request == REQUEST_CONTROL and self._is_trusted(station, message):
            self._follow_commander(source)
            self._ask(Request(Act.WHEEL, station, dialect.MAVLINK_MSG_ID_CHANGE_OPERATOR_CONTROL, source))
        else:
            self._count("mavlink_refused")
            station.answer_control(source[0], self._snapshot.now_us, is_given=False)

    def hands(self, now_us: int) -> frozenset[int]:
        """Hands of the stations that are there."""
        return frozenset[int]().union(*(each.hands(now_us) for each in self.stations))

    # What is sent

    def _send_message(self, station: Station, message_id: int) -> bool | None:
        """Send one message of this kind: whether there was one; None for a kind that is never sent."""
        if message_id not in STREAMED:
            return None
        if message_id == HEARTBEAT:
            self._camera.send_heartbeat(station, self._snapshot.now_us)
        message = self.missions.current if message_id == MISSION_CURRENT else BUILDERS[message_id](self._snapshot)
        if message is None:
            return False
        station.send(message, self._snapshot.now_us)
        return True
