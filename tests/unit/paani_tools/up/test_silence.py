"""A hung process is found within seconds; a short freeze, a lost router or a sleeping supervisor is no hang."""

from __future__ import annotations

from paani_tools.up.silence import HUNG_S, START_S, Silence

SERVICES = ("router", "advisor", "plant")


def run(silence: Silence, from_s: float, to_s: float, speaking: tuple[str, ...]) -> dict[str, float]:
    """Half-second steps; returns when each service was first called hung."""
    found: dict[str, float] = {}
    for step in range(round(from_s * 2), round(to_s * 2) + 1):
        now_us = step * 500_000
        for service in speaking:
            silence.note_health(service, now_us)
        for service in silence.hung(now_us):
            found.setdefault(service, step / 2)
    return found


def started() -> Silence:
    silence = Silence(0)
    for service in SERVICES:
        silence.started(service, 0)
    assert run(silence, 0, 10, SERVICES) == {}
    return silence


def test_silence_is_a_hang_after_five_seconds_and_not_within_three() -> None:
    found = run(started(), 10.5, 20, ("router", "plant"))
    assert found.keys() == {"advisor"}
    assert 10 + 3.0 < found["advisor"] <= 10 + HUNG_S + 1.0


def test_a_freeze_of_three_seconds_is_forgiven() -> None:
    silence = started()
    assert run(silence, 10.5, 13, ("router", "plant")) == {}
    assert run(silence, 13.5, 30, SERVICES) == {}


def test_without_the_router_only_the_router_is_judged() -> None:
    silence = started()
    assert run(silence, 10.5, 20, ()).keys() == {"router"}
    silence.ended("router")
    assert run(silence, 20.5, 40, ()) == {}
    silence.started("router", 40_000_000)
    assert run(silence, 40.5, 44.5, ("router",)) == {}
    assert run(silence, 45, 60, SERVICES) == {}


def test_a_start_may_take_longer_but_not_for_ever() -> None:
    silence = started()
    silence.started("advisor", 10_000_000)
    found = run(silence, 10.5, 80, ("router", "plant"))
    assert START_S <= found["advisor"] - 10 <= START_S + 1.0


def test_a_supervisor_that_slept_judges_nobody() -> None:
    silence = started()
    assert silence.hung(100_000_000) == []


def test_what_has_ended_cannot_hang() -> None:
    silence = started()
    silence.ended("advisor")
    silence.note_health("advisor", 10_500_000)
    assert run(silence, 10.5, 30, ("router", "plant")) == {}
