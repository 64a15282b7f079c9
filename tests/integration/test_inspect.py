"""`paani topics`, `paani echo`, `paani hz` beside a running service."""

from __future__ import annotations

import msgspec
import pytest

from paani import messages as m
from paani.config import Config
from tests.conftest import Spawn
from tests.paani_command import paani

pytestmark = pytest.mark.integration


async def test_look_at_a_running_bus(spawn: Spawn, private_sets: tuple[str, ...]) -> None:
    async with spawn("advisor"):
        code, out, errors = await paani(private_sets, "echo", "advisor/advisory", "--count", "2")
        assert (code, errors) == (0, "")
        first, second = (msgspec.json.decode(line, type=m.Advisory) for line in out.splitlines())
        assert first.reason is m.Reason.NO_EVIDENCE
        assert second.seq == first.seq + 1

        code, out, _ = await paani(private_sets, "hz", "advisor/advisory", "--for", "2")
        assert code == 0
        assert 3.0 < float(out.splitlines()[-1].split()[0]) < 7.0

        code, out, _ = await paani(private_sets, "topics")
        assert code == 0
        line = next(line for line in out.splitlines() if line.startswith("advisor/advisory"))
        assert 3.0 < float(line.split()[4]) < 7.0


async def test_without_a_bus_the_table_is_there_and_echo_says_why(
    config: Config, private_sets: tuple[str, ...]
) -> None:
    code, out, _ = await paani(private_sets, "topics")
    assert code == 0
    assert "now [Hz]" not in out
    code, _, errors = await paani(private_sets, "echo", "advisor/advisory")
    assert code == 2
    assert len(errors.splitlines()) == 1
    assert config.bus.router in errors
