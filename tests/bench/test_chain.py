"""`paani bench chain` prints what it promises; the figures are for reading."""

from __future__ import annotations

import json
import subprocess
import sys

import msgspec
import pytest

from paani.config import Config
from paani_tools.bench.chain import Bench, chain_text
from paani_tools.up.run_summary import STAGES

pytestmark = [pytest.mark.integration, pytest.mark.timeout(150)]


@pytest.mark.rotating(cpu_s=30)
def test_bench_chain(private_sets: tuple[str, ...]) -> None:
    words = [word for setting in private_sets for word in ("--set", setting)]
    result = subprocess.run(
        [sys.executable, "-m", "paani", "bench", "chain", "--for", "8", "--json", *words],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert len(result.stdout.splitlines()) == 1
    figures = json.loads(result.stdout)
    assert figures["machine"].keys() == {"cores", "load_before", "load_after"}
    assert set(figures["run"]["latency_ms"]) == set(STAGES)
    assert set(figures["run"]["services"]) == set(Config().services)
    assert figures["transport_over_inference"] > 0
    text = chain_text(msgspec.json.decode(result.stdout, type=Bench))
    assert all(stage in text for stage in STAGES)
    assert all(service in text for service in Config().services)
