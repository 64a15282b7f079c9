"""Small recordings, written by the recorder's own writer, and what a log holds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.config import Config, encode_config
from paani.logs.reader import Log
from paani.logs.writer import About, LogWriter, read_head

START_US = 1_700_000_000_000_000
STEP_US = 50_000
NAME = "20231114T221320Z-1.mcap"
JPEG = b"\xff\xd8" + bytes(range(256)) * 4 + b"\xff\xd9"


def about() -> About:
    return About(
        version="0.1.0",
        attachments={"config.json": encode_config(Config()), "models.json": b"{}", "versions.json": b'{"paani":"0"}'},
        facts={"domain": "43", "vessel": "otter", "profile": "paani", "part": "1"},
    )


def odometry(number: int, **changes: Any) -> m.Odometry:
    now_us = START_US + number * STEP_US
    values: dict[str, Any] = {
        "source_us": now_us, "seq": number, "epoch": 5, "producer": "localization", "sent_us": now_us,
        "x_m": 0.1 * number, "y_m": 0.0, "yaw_rad": 0.0, "surge_mps": 0.5, "latitude_deg": 52.0 + 1e-6 * number,
        "longitude_deg": 4.0, "healthy": True,
    }  # fmt: skip
    return m.Odometry(**(values | changes))


def put(log: LogWriter, topic: keys.Topic[Any], message: m.Message, data: bytes = b"") -> None:
    """As the recorder does with what it hears."""
    encoded = msgspec.json.encode(message)
    picture = topic.stance is keys.Stance.PICTURE
    log.write(topic, message.sent_us, read_head(encoded), data if picture else encoded, encoded if picture else b"")


def begin(folder: Path, name: str = NAME) -> LogWriter:
    return LogWriter(folder / name, about(), keys.every_topic(), START_US)


def fill(log: LogWriter, n: int, flush_every: int) -> None:
    """`n` poses at 20 Hz and a picture with every fifth; a chunk ends after each `flush_every`."""
    for number in range(n):
        put(log, keys.ODOMETRY, odometry(number))
        if number % 5 == 0:
            now_us = START_US + number * STEP_US
            header = m.PictureHeader(
                source_us=now_us, seq=number // 5, epoch=5, sent_us=now_us, frame_seq=number // 5, frame_epoch=1,
                width_px=320, height_px=240,
            )  # fmt: skip
            put(log, keys.PICTURE, header, JPEG + bytes((number % 256,)))
        if number % flush_every == flush_every - 1:
            log.flush()


def finished(folder: Path, n: int = 60, flush_every: int = 10, name: str = NAME) -> Path:
    log = begin(folder, name)
    fill(log, n, flush_every)
    log.finish({"localization/odometry": f"written={n} dropped=0 missing=0 unreadable=0"})
    return log.path


def unfinished(folder: Path, n: int = 60, flush_every: int = 10, name: str = NAME) -> Path:
    """As a killed recorder leaves it: what was flushed is there."""
    log = begin(folder, name)
    fill(log, n, flush_every)
    log.abandon()
    return log.path


def recorded(log: Log, topic: keys.Topic[Any]) -> list[Any]:
    """Every message of a topic that a log holds, in order."""
    return [msgspec.json.decode(record.data, type=topic.type) for record in log.records([topic.name])]
