"""What a first start makes before any process: credentials, the operator's key, the latch, the folder of logs."""

from __future__ import annotations

from pathlib import Path

from paani.authority import ensure_credentials
from paani.config import Config, encode_config
from paani.errors import UserError
from paani.operator_key import ensure_operator_key
from paani.runtime import LOGS, runtime_dir, write_private
from paani_services.operator.latch import LATCH_FILE
from paani_services.operator.state import CLEAR


def prepare_folder(config: Config) -> Path:
    """Complete the runtime folder; returns the folder of logs. Raises UserError."""
    ensure_credentials(config.bus)
    folder = runtime_dir(config.bus)
    logs = folder / LOGS
    if config.up.arm_at_start and not logs.exists() and not (folder / LATCH_FILE).exists():
        write_private(folder / LATCH_FILE, CLEAR)  # the first start here: later, a missing latch is a STOP
    logs.mkdir(mode=0o700, exist_ok=True)
    return logs


def write_plan(config: Config, file: Path) -> None:
    """Prepare the folder for processes that something else starts, and write their settings. Raises UserError."""
    prepare_folder(config)
    if "operator" in config.services:
        ensure_operator_key(config.bus)
    try:
        write_private(file, encode_config(config).decode())
    except OSError as error:
        raise UserError(f"--prepare {file}: {error.strerror}") from error
