"""A core of its own for each test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.unit.mcu.core import Core


@pytest.fixture
def core() -> Iterator[Core]:
    core = Core()
    core.set_pins()
    yield core
    core.close()
