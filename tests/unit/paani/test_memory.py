"""What the interpreter keeps of freed tuples is given back."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator

import pytest

from paani.memory import recycle, set_loaded_apart

MADE = 1500  # of each length; the interpreter keeps up to 2000


@pytest.fixture(autouse=True)
def unfrozen() -> Iterator[None]:
    """Nothing that a test sets apart stays so."""
    yield
    gc.unfreeze()


def make_tuples_of_what_is_iterated_over() -> None:
    for length in range(2, 10):
        held = [tuple(each for each in range(length)) for _ in range(MADE)]
        del held


def test_freed_tuples_are_given_back() -> None:
    recycle()
    before = sys.getallocatedblocks()
    make_tuples_of_what_is_iterated_over()
    kept = sys.getallocatedblocks() - before
    assert kept > MADE  # else this interpreter keeps none, and `recycle` has no purpose
    recycle()
    assert sys.getallocatedblocks() - before < kept / 10


def test_what_is_loaded_is_no_part_of_a_collection() -> None:
    loaded = len(gc.get_objects())
    set_loaded_apart()
    assert len(gc.get_objects()) < loaded / 10
