"""A process that hears nothing of a router that it is connected to is deaf, and no other."""

from __future__ import annotations

import pytest

from paani.bus.hearing import DEAF_S, Hearing
from paani.clock import ManualClock


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


def test_silence_while_connected_is_deafness(clock: ManualClock) -> None:
    hearing = Hearing(clock, lambda: True)
    hearing.note()
    clock.advance(DEAF_S)
    assert not hearing.is_deaf()
    clock.advance(0.1)
    assert hearing.is_deaf()
    hearing.note()
    assert not hearing.is_deaf()


def test_without_a_router_nobody_is_deaf_and_whoever_connects_again_has_time_to_hear(clock: ManualClock) -> None:
    connected = False
    hearing = Hearing(clock, lambda: connected)
    hearing.note()
    clock.advance(100 * DEAF_S)
    assert not hearing.is_deaf()
    connected = True
    clock.advance(DEAF_S)
    assert not hearing.is_deaf()
    clock.advance(0.1)
    assert hearing.is_deaf()


def test_a_router_that_never_spoke_makes_nobody_deaf(clock: ManualClock) -> None:
    hearing = Hearing(clock, lambda: True)
    clock.advance(100 * DEAF_S)
    assert not hearing.is_deaf()
