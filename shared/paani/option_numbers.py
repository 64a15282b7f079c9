"""Numbers that a command is given, checked while its options are parsed."""

from __future__ import annotations

import argparse
from collections.abc import Callable


def whole_number(least: int = 1, most: int | None = None) -> Callable[[str], int]:
    """An argparse `type`: a whole number from `least` to `most` (None: without end); else one line says which."""
    span = f"at least {least}" if most is None else f"from {least} to {most}"

    def parse(text: str) -> int:
        try:
            number = int(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"'{text}' is no whole number") from None
        if number < least or (most is not None and number > most):
            raise argparse.ArgumentTypeError(f"{text} is not {span}")
        return number

    return parse


def quantity(unit: str, low: float = 0.0, high: float = 1e7, *, with_low: bool = False) -> Callable[[str], float]:
    """An argparse `type`: a number of this unit above `low`, or from it, and at most `high`; else one line says so."""
    span = f"{unit} {'from' if with_low else 'above'} {low:g}, at most {high:g}"

    def parse(text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"'{text}' is no number") from None
        if not low <= number <= high or (number == low and not with_low):
            raise argparse.ArgumentTypeError(f"{text}: expected {span}")
        return number

    return parse


seconds = quantity("seconds")
