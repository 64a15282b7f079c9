"""Block bootstrap (Efron 1979; Davison and Hinkley 1997) over whole sequences, as frames of one are not independent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from paani.statistics.order_statistics import nearest_rank

REPLICATES = 1000
SEED = 42
COVERED_PERCENT = 95.0

Item = TypeVar("Item")


def draw_sequence_counts(sequences: int, replicates: int = REPLICATES, seed: int = SEED) -> NDArray[np.int64]:
    """How often each sequence is drawn, int64 [replicates, sequences]; every row sums to `sequences`."""
    rng = np.random.default_rng(seed)
    return rng.multinomial(sequences, np.full(sequences, 1 / sequences), replicates)


def percentile_interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """Nearest-rank 2.5 and 97.5 percentiles of the replicates that have a value; NaN, NaN where none has."""
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return float("nan"), float("nan")
    tail = (100.0 - COVERED_PERCENT) / 2
    return nearest_rank(known.tolist(), tail), nearest_rank(known.tolist(), 100.0 - tail)


def interval_of_sums(
    sums: NDArray[np.int64], measure: Callable[[NDArray[np.int64]], float], replicates: int = REPLICATES
) -> tuple[float, float]:
    """The interval of a figure of added counts. sums: counts of each sequence, [sequences, ...]."""
    if len(sums) < 2:
        return float("nan"), float("nan")
    weights = draw_sequence_counts(len(sums), replicates)
    totals = np.tensordot(weights, sums, 1)
    return percentile_interval(np.array([measure(total) for total in totals], np.float64))


def interval_of_items(
    sequences: Sequence[list[Item]], measure: Callable[[list[Item]], float], replicates: int = REPLICATES
) -> tuple[float, float]:
    """The interval of a figure of many items. sequences: the items of each sequence."""
    if len(sequences) < 2:
        return float("nan"), float("nan")
    values = []
    for row in draw_sequence_counts(len(sequences), replicates):
        drawn = [item for times, items in zip(row, sequences, strict=True) for item in items * int(times)]
        values.append(measure(drawn))
    return percentile_interval(np.array(values, np.float64))
