"""`paani bench fleet`: that it measures; the figures are for reading."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from paani.errors import UserError
from paani_tools.bench.fleet.command import main

RATE_HZ = 71  # of what a shore hears of a simulated boat: 20 + 5 + 10 + 5 + 20, and 13 reports of health a second


@pytest.mark.timeout(90)
def test_each_vessel_is_heard_at_its_rates(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--vessels", "2", "--for", "3", "--json", str(tmp_path / "costs.json")]) == 0
    (cost,) = json.loads((tmp_path / "costs.json").read_bytes())
    assert cost["vessels"] == 2
    assert 0.3 * RATE_HZ < cost["messages_per_s"] / 2 < 1.5 * RATE_HZ
    assert cost["received_kbps"] * 125.0 / cost["messages_per_s"] > 200, "bytes a message"
    assert cost["cpu_cores"] > 0.0
    assert capsys.readouterr().out.splitlines()[2].startswith("| 2 | 3 |")


def test_a_length_that_cannot_be_is_refused() -> None:
    with pytest.raises(UserError, match="--for: between 1 and 3600 s"):
        main(["--for", "0"])
