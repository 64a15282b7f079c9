"""The STOP latch on disk: one word that outlives the process."""

from __future__ import annotations

import logging
from pathlib import Path

from paani.runtime import write_private

LOG = logging.getLogger(__name__)
LATCH_FILE = "stop-latch"  # in the runtime folder


def read_latch(path: Path) -> str | None:
    """Text of the latch file; None where there is no file, empty where it cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        LOG.warning("%s: %s: the STOP latch cannot be read, so the boat stays stopped", path, error)
        return ""


def write_latch(path: Path, text: str) -> bool:
    """Replace the whole latch file; false when it cannot be written."""
    try:
        write_private(path, text)
    except OSError as error:
        LOG.error("%s: %s", path, error)  # noqa: TRY400  # a full disk is not a bug
        return False
    return True
