"""A recorded drive as the messages that the port would have sent, in the order of the recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import msgspec

from paani import keys
from paani import messages as m
from paani.config import Config
from paani.logs.pictures import RecordedPicture
from paani.logs.reader import Record
from paani.undecodable import UNDECODABLE
from paani_services.ros2 import topics
from paani_services.ros2.diagnostics import Diagnostics
from paani_services.ros2.frames import Frames
from paani_services.ros2.translation import RosMessage, Translator


class RecordedDrive:
    """`left_out`: messages that could not be read, or have a time that ROS has no number for."""

    def __init__(self, config: Config) -> None:
        """config: the settings of the recorded system."""
        self._translator = Translator(Frames(config.ros2.frame_prefix), config.calibration)
        self._diagnostics = Diagnostics(config.bus.vessel, config.bus.graph)
        rows = {topic.name: topic for topic in keys.every_topic()}
        names = {*self._translator.sources, *self._diagnostics.sources}
        self._decoders = {name: msgspec.json.Decoder(rows[name].type) for name in sorted(names)}
        self._headers = msgspec.json.Decoder(m.PictureHeader)
        self._report_due_us = 0
        self.left_out = 0

    @property
    def sources(self) -> tuple[str, ...]:
        """Channels that are needed, apart from those of pictures."""
        return tuple(self._decoders)

    def messages(self, records: Iterable[Record | RecordedPicture]) -> Iterator[tuple[int, RosMessage]]:
        """Each with the time at which what it comes from was recorded [us]."""
        for record in records:
            try:
                sent = self._sent(record)
            except UNDECODABLE:
                self.left_out += 1
                continue
            for message in sent:
                yield record.log_us, message

    def _sent(self, record: Record | RecordedPicture) -> list[RosMessage]:
        if isinstance(record, RecordedPicture):
            return [self._translator.picture(self._headers.decode(record.header), record.data)]
        name, message = record.topic, self._decoders[record.topic].decode(record.data)
        sent = self._translator.translate(name, message) if name in self._translator.sources else []
        if name in self._diagnostics.sources:
            self._diagnostics.note(name, message, record.log_us)
        if record.log_us >= self._report_due_us:
            sent.append(self._diagnostics.report(record.log_us))
            self._report_due_us = record.log_us + round(1e6 / topics.DIAGNOSTICS.rate_hz)
        return sent
