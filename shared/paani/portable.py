"""Elementary functions with the same bits on every machine: recorded decisions are computed again to the byte.

The C library's differ in the last bit from one processor or library to the next (measured: 4 to 7 of 10,000 results,
x86 with and without fused multiply-add). These use only + - * / and the square root, which IEEE 754 fixes. They are
right to a few units in the last place; hypot, dist, remainder and sqrt of `math` are exact enough to be the same.
"""

from __future__ import annotations

import functools
import math

LN2_HIGH, LN2_LOW = float.fromhex("0x1.62e42fee00000p-1"), float.fromhex("0x1.a39ef35793c76p-33")
HALF_PI_HIGH, HALF_PI_LOW = float.fromhex("0x1.921fb54400000p+0"), float.fromhex("0x1.0b4611a626331p-34")
HALF_PI = math.pi / 2.0
EXP_UNDERFLOW = -746.0
SQRT_HALF = math.sqrt(0.5)
LOG2_E = 1.4426950408889634
EXP_TERMS = tuple(1.0 / math.factorial(n) for n in range(14, -1, -1))
SIN_TERMS = tuple((-1.0) ** n / math.factorial(2 * n + 1) for n in range(9, -1, -1))
COS_TERMS = tuple((-1.0) ** n / math.factorial(2 * n) for n in range(9, -1, -1))
LOG_TERMS = tuple(2.0 / (2 * n + 1) for n in range(11, -1, -1))
ATAN_TERMS = tuple((-1.0) ** n / (2 * n + 1) for n in range(12, -1, -1))


def exp(x: float) -> float:
    """e to the power of x. Raises OverflowError like `math.exp`."""
    if x < EXP_UNDERFLOW:
        return 0.0
    k = round(x * LOG2_E)
    rest = (x - k * LN2_HIGH) - k * LN2_LOW
    return math.ldexp(_polynomial(EXP_TERMS, rest), k)


def log(x: float) -> float:
    """The natural logarithm of x > 0. Raises ValueError like `math.log`."""
    if not 0.0 < x < math.inf:
        return math.log(x)
    part, k = math.frexp(x)
    if part < SQRT_HALF:
        part, k = 2.0 * part, k - 1
    s = (part - 1.0) / (part + 1.0)
    return k * LN2_HIGH + (s * _polynomial(LOG_TERMS, s * s) + k * LN2_LOW)


def sin(rad: float) -> float:
    """Sine of an angle [rad]."""
    return _direction(rad + 0.0)[1]


def cos(rad: float) -> float:
    """Cosine of an angle [rad]."""
    return _direction(rad + 0.0)[0]


def tan(rad: float) -> float:
    """Tangent of an angle [rad] that is not a quarter turn."""
    cosine, sine = _direction(rad + 0.0)
    return sine / cosine


def atan2(y: float, x: float) -> float:
    """Angle of the point (x, y) from the x axis [rad], in [-pi, pi]."""
    tall, wide = abs(y), abs(x)
    if not 0.0 < max(tall, wide) < math.inf:
        return math.atan2(y, x)  # nothing to round: a multiple of an eighth turn, or not a number
    rad = _atan(tall / wide) if tall <= wide else HALF_PI - _atan(wide / tall)
    return math.copysign(math.pi - rad if math.copysign(1.0, x) < 0.0 else rad, y)


@functools.lru_cache(maxsize=512)  # one attitude turns every corner of every box
def _direction(rad: float) -> tuple[float, float]:
    """Cosine and sine. Never asked for -0.0, which what is kept could not tell from 0.0."""
    rad = math.remainder(rad, math.tau)
    quarter = round(rad / HALF_PI)
    rest = (rad - quarter * HALF_PI_HIGH) - quarter * HALF_PI_LOW
    square = rest * rest
    cosine, sine = _polynomial(COS_TERMS, square), rest * _polynomial(SIN_TERMS, square)
    match quarter % 4:
        case 0:
            return cosine, sine
        case 1:
            return -sine, cosine
        case 2:
            return -cosine, -sine
        case _:
            return sine, -cosine


def _atan(ratio: float) -> float:
    """Of a ratio in [0, 1]: the angle halved twice, then its series."""
    for _ in range(2):
        ratio /= 1.0 + math.sqrt(1.0 + ratio * ratio)
    return 4.0 * (ratio * _polynomial(ATAN_TERMS, ratio * ratio))


def _polynomial(terms: tuple[float, ...], x: float) -> float:
    """Horner's rule, highest power first."""
    total = 0.0
    for term in terms:
        total = total * x + term
    return total
