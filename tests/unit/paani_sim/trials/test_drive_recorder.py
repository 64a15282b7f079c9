"""The recording of a drive is whole or absent."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any, NoReturn

import pytest

from paani.config import Config
from paani.errors import UserError
from paani.logs.writer import LogWriter
from paani_sim.trials.drive_recorder import DriveRecorder


def test_a_full_disk_leaves_no_half_a_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> NoReturn:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(LogWriter, "finish", fail)
    file = tmp_path / "a.mcap"
    with pytest.raises(UserError, match=f"^--record {file}: No space left on device$"), DriveRecorder(file, Config()):
        pass
    assert list(tmp_path.iterdir()) == []
