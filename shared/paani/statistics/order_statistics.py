"""The two order statistics that every figure here uses (U5)."""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable


def nearest_rank(samples: Iterable[float], percent: float) -> float:
    """The smallest sample that at least `percent` % of the samples do not exceed; percent in 0..100.

    Always one of the samples. Raises ValueError without a sample.
    """
    ordered = sorted(samples)
    if not ordered or not 0.0 <= percent <= 100.0:
        raise ValueError("a percentile needs a sample, and 0 to 100 percent")
    return ordered[max(0, math.ceil(percent * len(ordered) / 100) - 1)]


def median(samples: Iterable[float]) -> float:
    """The middle sample, or the mean of the middle pair. Raises ValueError without a sample."""
    return statistics.median(samples)
