"""How many workers a training asks for."""

from types import ModuleType
from typing import Any

import pytest

from paani_models.training.training_state import Prefetch


def note_workers(monkeypatch: pytest.MonkeyPatch, module: ModuleType) -> list[int]:
    """The list that is filled while a training of `module` prefetches as before."""
    asked: list[int] = []

    class NotingPrefetch(Prefetch[Any]):
        def __init__(self, workers: int) -> None:
            asked.append(workers)
            super().__init__(workers)

        def __class_getitem__(cls, _item: object) -> Any:
            return cls

    monkeypatch.setattr(module, "Prefetch", NotingPrefetch)
    return asked
