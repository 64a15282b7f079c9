"""What a picture costs whatever the machine: the bytes of its nets and their multiplications."""

from collections.abc import Iterable
from pathlib import Path

import msgspec

from paani_models.engines.multiply_adds import count_multiply_adds


class Work(msgspec.Struct, frozen=True):
    """Of a pair of nets. `multiply_adds`: of their convolutions, None where the onnx package is not installed."""

    name: str
    bytes: int
    multiply_adds: int | None


def count_work(name: str, files: Iterable[Path]) -> Work:
    """Of all the files together."""
    paths = list(files)
    counts = [count_multiply_adds(path) for path in paths]
    total = None if None in counts else sum(count for count in counts if count is not None)
    return Work(name, sum(path.stat().st_size for path in paths), total)
