"""Writes a bag that ROS 2 plays: MCAP with profile `ros2`, definitions as `ros2msg`, messages as CDR.

What it holds is for others; `reader.py` reads recordings of PAANI alone.
"""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from mcap.writer import CompressionType, Writer

from paani.logs.writer import CHUNK_BYTES

PROFILE, SCHEMA_ENCODING, MESSAGE_ENCODING = "ros2", "ros2msg", "cdr"


class RosBag:
    """One file, whole when its context ends. Every method may raise OSError."""

    def __init__(self, path: Path, library: str) -> None:
        self._file = path.open("wb")
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start(profile=PROFILE, library=library)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def __enter__(self) -> RosBag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._file:
            if kind is None:
                self._writer.finish()

    @property
    def topics(self) -> int:
        """How many topics have messages."""
        return len(self._channels)

    def has_topic(self, name: str) -> bool:
        """Whether it was added."""
        return name in self._channels

    def add_topic(self, name: str, kind: str, definition: str) -> None:
        """A topic, from its root, of a type such as `sensor_msgs/msg/Imu`."""
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(kind, SCHEMA_ENCODING, definition.encode())
        self._channels[name] = self._writer.register_channel(name, MESSAGE_ENCODING, self._schemas[kind])

    def write(self, name: str, log_us: int, source_us: int, data: bytes) -> None:
        """A message of a topic that was added. Times are Unix times."""
        self._writer.add_message(self._channels[name], log_us * 1000, data, source_us * 1000)
