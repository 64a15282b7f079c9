"""What the interpreter and the C library keep of what was freed is given back."""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator

import pytest

from paani import memory
from paani.health import rss_mib
from paani.memory import recycle, set_loaded_apart

BLOCK_BYTES, BLOCKS = 60_000, 800  # smaller than what the C library asks the system for one by one
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


@pytest.mark.slow
def test_freed_tuples_are_given_back() -> None:
    recycle()
    before = sys.getallocatedblocks()
    make_tuples_of_what_is_iterated_over()
    kept = sys.getallocatedblocks() - before
    assert kept > MADE  # else this interpreter keeps none, and `recycle` has no purpose
    recycle()
    assert sys.getallocatedblocks() - before < kept / 10


@pytest.mark.slow
def test_what_is_loaded_is_no_part_of_a_collection() -> None:
    loaded = len(gc.get_objects())
    set_loaded_apart()
    assert len(gc.get_objects()) < loaded / 10


@pytest.mark.skipif(memory._TRIM is None, reason="only glibc keeps gaps and can give them back")
@pytest.mark.slow
def test_gaps_between_what_is_in_use_are_given_back() -> None:
    blocks = [bytearray(b"x" * BLOCK_BYTES) for _ in range(BLOCKS)]
    between = blocks[::16]
    before_mib = rss_mib()
    del blocks
    recycle()
    assert before_mib - rss_mib() > 0.8 * BLOCK_BYTES * (BLOCKS - len(between)) / 2**20
