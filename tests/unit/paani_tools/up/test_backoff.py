"""Restarts wait longer and longer, and forgive after a stable life."""

from __future__ import annotations

import random

from paani_tools.up.backoff import LONGEST_S, Backoff


def test_delays_double_from_half_a_second_to_ten_seconds() -> None:
    backoff = Backoff(random.Random(1))
    delays = [backoff.after(lived_s=0.5) for _ in range(9)]
    for nominal, delay in zip((0.5, 1.0, 2.0, 4.0, 8.0, 10.0, 10.0, 10.0, 10.0), delays, strict=True):
        assert 0.8 * nominal <= delay <= min(1.2 * nominal, LONGEST_S)


def test_a_stable_life_begins_again() -> None:
    backoff = Backoff(random.Random(1))
    for _ in range(6):
        backoff.after(lived_s=0.1)
    assert backoff.after(lived_s=10.0) <= 0.6


def test_processes_do_not_start_in_step() -> None:
    assert len({Backoff(random.Random(seed)).after(0.0) for seed in range(10)}) == 10


def test_never_overflows() -> None:
    backoff = Backoff(random.Random(0))
    assert all(backoff.after(0.0) <= LONGEST_S for _ in range(2000))
