"""The operator's key: who has it may arm and tune by the page, and who has not may only watch and stop."""

from __future__ import annotations

import secrets
from pathlib import Path

from paani.config import BusConfig
from paani.errors import UserError
from paani.runtime import runtime_dir, write_private

KEY_FILE = "operator-key"
MIN_CHARACTERS = 8  # a key that is shorter, as of a file that was cut off, is guessed


def operator_key_path(config: BusConfig) -> Path:
    """The file, for its owner alone."""
    return runtime_dir(config) / KEY_FILE


def ensure_operator_key(config: BusConfig) -> str:
    """The key without white space around it, made at the first start. Raises UserError naming the file."""
    path = operator_key_path(config)
    try:
        if not path.exists():
            write_private(path, secrets.token_urlsafe(24))
        key = path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: {getattr(error, 'strerror', None) or error}") from error
    if len(key) < MIN_CHARACTERS:
        raise UserError(f"{path}: a key has at least {MIN_CHARACTERS} characters (without the file, one is made)")
    return key
