"""Confidence intervals of a share and of a count. Pure."""

import math

import msgspec

Z_95 = 1.959963984540054


class Share(msgspec.Struct, frozen=True, kw_only=True):
    """A share of trials with its 95 % Wilson interval, in [0, 1]."""

    share: float
    low: float
    high: float


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """The 95 % interval of a share (E. B. Wilson, 1927), in [0, 1]; of no trials, all of it."""
    if trials == 0:
        return 0.0, 1.0
    share, z2 = successes / trials, Z_95 * Z_95
    middle = (share + z2 / (2 * trials)) / (1 + z2 / trials)
    half = Z_95 * math.sqrt(share * (1 - share) / trials + z2 / (4 * trials * trials)) / (1 + z2 / trials)
    return middle - half if successes else 0.0, middle + half if successes < trials else 1.0


def poisson_interval(count: int) -> tuple[float, float]:
    """The 95 % interval of the expected count behind an observed one, by Byar's approximation to the exact interval.

    Breslow and Day, "Statistical Methods in Cancer Research II" (1987), section 2.3; right to 0.03 from no event on.
    """
    low = count * (1.0 - 1.0 / (9.0 * count) - Z_95 / (3.0 * math.sqrt(count))) ** 3 if count else 0.0
    more = count + 1
    return low, more * (1.0 - 1.0 / (9.0 * more) + Z_95 / (3.0 * math.sqrt(more))) ** 3


def share_with_interval(successes: int, trials: int) -> Share:
    """A share with its Wilson interval."""
    low, high = wilson_interval(successes, trials)
    return Share(share=round(successes / trials, 4) if trials else 0.0, low=round(low, 4), high=round(high, 4))
