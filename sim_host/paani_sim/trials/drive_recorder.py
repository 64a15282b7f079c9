"""Writes a drive in the format of a live recording, so that replay and explanation read it."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import TracebackType
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.config import Config, encode_config
from paani.errors import UserError
from paani.logs.writer import About, Head, LogWriter
from paani_models.catalogue import MANIFEST, WEIGHTS
from paani_sim.trials.lockstep_bus import START_US

PACKAGES = ("paani", "numpy", "onnxruntime", "msgspec", "mujoco", "opencv-python-headless")


class DriveRecorder:
    """Records one drive through `record_message`. The file is written whole or not at all."""

    def __init__(self, path: Path, config: Config) -> None:
        """Raises UserError naming a file that cannot be written."""
        self._path, self._beside = path, path.with_name(f".{path.name}.partial")
        self._encoder = msgspec.json.Encoder()
        facts = {"domain": str(config.bus.domain), "vessel": config.bus.vessel, "profile": config.profile}
        about = About(version=_version("paani"), attachments=_attachments(config), facts=facts)
        try:
            self._beside.unlink(missing_ok=True)
            self._log = LogWriter(self._beside, about, keys.every_topic(keys.Graph.SIMULATION), START_US)
        except OSError as error:
            raise UserError(f"--record {path}: {error.strerror}") from error

    def record_message(self, topic: keys.Topic[Any], message: m.Message, now_us: int, data: bytes = b"") -> None:
        """See `MessageTap`."""
        head = Head(message.source_us, message.seq, message.epoch, message.sent_us)
        encoded = self._encoder.encode(message)
        if topic.stance is keys.Stance.PICTURE:
            self._log.write(topic, now_us, head, data, encoded)
        else:
            self._log.write(topic, now_us, head, encoded, b"")

    def __enter__(self) -> DriveRecorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._drop()
            return
        try:
            self._log.finish({})
            self._beside.replace(self._path)
        except OSError as failed:
            self._drop()
            raise UserError(f"--record {self._path}: {failed.strerror}") from failed

    def _drop(self) -> None:
        self._log.abandon()
        self._beside.unlink(missing_ok=True)


def _attachments(config: Config) -> dict[str, bytes]:
    manifest = WEIGHTS / MANIFEST
    versions = {package: _version(package) for package in PACKAGES} | {"python": platform.python_version()}
    return {
        "config.json": encode_config(config),
        "models.json": manifest.read_bytes() if manifest.is_file() else b"{}",
        "versions.json": msgspec.json.format(msgspec.json.encode(versions), indent=1),
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
