"""Whole numbers that a command is given, checked while its options are parsed."""

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
