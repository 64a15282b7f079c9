"""Whole numbers on the command line."""

from __future__ import annotations

import argparse

import pytest

from paani.option_numbers import whole_number


def test_what_lies_within_is_taken() -> None:
    assert [whole_number(2, 5)(text) for text in ("2", "5")] == [2, 5]
    assert whole_number()(str(10**9)) == 10**9
    assert whole_number(0)("0") == 0


@pytest.mark.parametrize(
    ("text", "words"),
    [("1", "1 is not from 2 to 5"), ("6", "6 is not from 2 to 5"), ("2.5", "'2.5' is no whole number")],
)
def test_what_does_not_is_told(text: str, words: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match=words):
        whole_number(2, 5)(text)


def test_without_an_end_only_the_least_is_told() -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="0 is not at least 1"):
        whole_number()("0")
