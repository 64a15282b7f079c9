"""Hostile payloads to every decoder: each is let in or refused, nothing moves, and memory is bounded."""

from __future__ import annotations

import json
import os
import random
from pathlib import Path

import pytest

from paani_tools.bench.faults.hostile import HostileMessages
from tests.fuzz.bus_messages import Receivers
from tests.fuzz.campaign import TARGETS, replay, run_target, share_of
from tests.fuzz.target import Target

# Values at the bounds of their fields overflow in NumPy, which says so by a warning.
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")
CORPUS = Path(__file__).parent / "corpus"
FEW = int(os.environ.get("FUZZ_COUNT", "600"))
MANY = 100_000
by_name = pytest.mark.parametrize("kind", TARGETS, ids=lambda kind: kind.name)


@by_name
def test_hostile_payloads_break_no_decoder_and_move_nothing(kind: type[Target]) -> None:
    """Whatever comes in is let in or refused with a cause; `FUZZ_COUNT=N` sets how many in all."""
    tally = run_target(kind, share_of(kind, FEW), seed=1)
    assert tally.kept == []
    assert tally.given == tally.accepted + sum(tally.refused.values())


@pytest.mark.long
@pytest.mark.timeout(7200)
@by_name
def test_a_hundred_thousand_hostile_payloads_break_nothing(kind: type[Target]) -> None:
    tally = run_target(kind, share_of(kind, MANY), seed=2)
    assert tally.kept == []


def corpus() -> list[Path]:
    return sorted(path for path in CORPUS.glob("*/*") if path.is_file())


@pytest.mark.parametrize("path", corpus(), ids=lambda path: f"{path.parent.name}/{path.name}")
def test_what_once_broke_a_decoder_is_refused(path: Path) -> None:
    """Each file of the corpus lies in the folder of its decoder's class."""
    (kind,) = (kind for kind in TARGETS if kind.__name__ == path.parent.name)
    assert replay(kind, path.read_bytes()) != ""


@pytest.mark.parametrize("name", list(Receivers().topics))
def test_valid_messages_are_let_in_and_faults_are_refused(name: str) -> None:
    """Otherwise the payloads would not reach what lies behind the admission, or not try it."""
    rng, receivers, now_us = random.Random(name), Receivers(), 1_800_000_000_000_000
    hostile = HostileMessages(receivers.topics[name], receivers.domain, rng)
    for _ in range(20):
        now_us += 10_000
        data = json.dumps(hostile.valid(now_us)).encode()
        assert receivers.judge(name, data, now_us)[1] == "", data
    hostile.heard_epoch = now_us // 1000
    for _ in range(60):
        now_us += 10_000
        payload = hostile.next(now_us, refused=True)
        assert receivers.judge(name, payload.data, now_us)[1] != "", payload
