"""A machine without the annotated pictures."""

from __future__ import annotations

import pytest


@pytest.fixture
def without_data(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """What `PAANI_DATA` names is not there."""
    monkeypatch.setenv("PAANI_DATA", str(tmp_path_factory.mktemp("data") / "absent"))
