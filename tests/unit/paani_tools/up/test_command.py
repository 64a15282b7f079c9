"""`paani up`: options that a call would pass over are refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from paani.errors import UserError
from paani_tools.up.command import main


@pytest.mark.parametrize("words", [["--for", "3"], ["--summary", "new.json"]])
def test_what_only_prepares_drives_for_no_time_and_has_no_summary(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=f"^{words[0]}: is not for --prepare"):
        main(["--prepare", "settings.json", *words])
    assert list(tmp_path.iterdir()) == []
