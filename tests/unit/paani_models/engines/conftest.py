"""A machine without the annotated pictures."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def without_data(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What `PAANI_DATA` names is not there."""
    absent = tmp_path_factory.mktemp("data") / "absent"
    monkeypatch.setenv("PAANI_DATA", str(absent))
    return absent
