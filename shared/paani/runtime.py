"""The runtime folder: credentials, the stop latch, what one start hands to its processes."""

from __future__ import annotations

import os
from pathlib import Path

from paani.config import BusConfig
from paani.errors import UserError


def runtime_dir(config: BusConfig) -> Path:
    """The folder, made with mode 0700. `bus.runtime_dir`, else `PAANI_RUNTIME_DIR`, else the user's state folder."""
    chosen = config.runtime_dir or os.environ.get("PAANI_RUNTIME_DIR", "")
    if not chosen:
        state = os.environ.get("XDG_STATE_HOME", "") or str(Path.home() / ".local" / "state")
        chosen = str(Path(state) / "paani")
    folder = Path(chosen)
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"bus.runtime_dir {folder}: {error.strerror}") from error
    return folder


def write_private(path: Path, text: str) -> None:
    """Write a file only its owner can read: beside it first, then renamed."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.unlink(missing_ok=True)
    with os.fdopen(os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="utf-8") as stream:
        stream.write(text)
    beside.replace(path)
