"""One ground station at one link: what it has been sent and asked for. No input or output of its own."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from typing import Any

from paani.clock import has_passed
from paani_services.mavlink.announcements import WARNING, statustext
from paani_services.mavlink.codec import COMPONENT, Codec, dialect
from paani_services.mavlink.streams import Schedule

BYTES_PER_S, BURST_BYTES = 100_000, 64_000  # a station that speaks faster is not heard: a mission takes a tenth of it
SILENT_S = 10.0  # after which a station that only listens gets nothing but the heartbeat
HAND_SILENT_S = 5.0  # after which another station may have its wheel: five heartbeats
REPEAT_TEXT_S = 2.0  # stations repeat what is refused several times in milliseconds
REQUEST_CONTROL, GIVEN, NOT_GIVEN = 0, 0, 2  # of CHANGE_OPERATOR_CONTROL and its answer
PARAMETERS_PER_TICK = 5  # 250 a second


Source = tuple[int, int]  # system and component that sent a message


def source_of(message: Any) -> Source:
    """Who sent a message: a link may lead to several systems."""
    return message.get_srcSystem(), message.get_srcComponent()


class Station:
    """`write` takes the bytes of a frame. is_local: at the loopback interface of this machine.

    unsent_bytes: how many of those bytes have not left this machine. own_host: our end of its link.
    """

    def __init__(
        self,
        name: str,
        codec: Codec,
        write: Callable[[bytes], None],
        unsent_bytes: Callable[[], int] = lambda: 0,
        *,
        is_local: bool,
        own_host: str = "127.0.0.1",
    ) -> None:
        self.name, self.is_local, self._codec, self._write = name, is_local, codec, write
        self.own_host = own_host
        self.unsent_bytes = unsent_bytes
        self.schedule = Schedule()
        self.next_parameter: int | None = None  # to be sent of the list that it asked for
        self.heard_us: int | None = None
        self.stick: tuple[float, float, int] | None = None  # surge, turn and hand, to be said at the next occasion
        self._hands: dict[Source, int] = {}
        self._sources_us: dict[Source, int] = {}
        self._allowance_bytes, self._allowed_us = float(BURST_BYTES), 0
        self._texts_us: dict[str, int] = {}

    @property
    def damaged(self) -> int:
        """Frames and runs of bytes that could not be read."""
        return self._codec.damaged

    def receive(self, data: bytes, now_us: int) -> list[Any] | None:
        """The messages in these bytes; None where there were too many of late, and none is read."""
        passed_s = max(0.0, (now_us - self._allowed_us) * 1e-6)
        self._allowance_bytes = min(BURST_BYTES, self._allowance_bytes + passed_s * BYTES_PER_S)
        self._allowed_us = now_us
        if len(data) > self._allowance_bytes:
            return None
        self._allowance_bytes -= len(data)
        messages = self._codec.decode(data)
        for message in messages:
            self.heard_us = self._sources_us[source_of(message)] = now_us
        return messages

    def hand_of(self, source: Source) -> int:
        """By which the operator's process knows who holds the wheel: several may speak through one link."""
        return self._hands.setdefault(source, secrets.randbits(32) + 1)

    def hands(self, now_us: int) -> frozenset[int]:
        """The hands of those who have spoken of late."""
        return frozenset(
            hand
            for source, hand in self._hands.items()
            if 0 <= now_us - self._sources_us.get(source, -1) <= HAND_SILENT_S * 1e6
        )

    def is_present(self, now_us: int, silent_s: float = SILENT_S) -> bool:
        """Whether it has spoken of late."""
        return self.heard_us is not None and 0 <= now_us - self.heard_us <= silent_s * 1e6

    def send(self, message: Any, now_us: int, component: int = COMPONENT) -> None:
        """One message of one of our components."""
        self._write(self._codec.encode(message, now_us, component))

    def refuse(self, text: str, now_us: int) -> bool:
        """Say why something is refused, the same thing no more than once in a while; whether it was said."""
        self._texts_us = {
            each: us for each, us in self._texts_us.items() if not has_passed(us, REPEAT_TEXT_S * 1e6, now_us)
        }
        if text and text not in self._texts_us:
            self._texts_us[text] = now_us
            self.send(statustext(WARNING, text), now_us)
            return True
        return False

    def acknowledge(self, command: int, result: int, target: Source, now_us: int, text: str = "") -> None:
        """The text first, as stations show the last they had with the result."""
        self.refuse(text, now_us)
        self.send(dialect.MAVLink_command_ack_message(command, result, 0, 0, *target), now_us)

    def answer_control(self, system: int, now_us: int, *, is_given: bool) -> None:
        """Say to the system that asked whether the wheel is this station's now."""
        result = GIVEN if is_given else NOT_GIVEN
        self.send(dialect.MAVLink_change_operator_control_ack_message(system, REQUEST_CONTROL, result), now_us)
