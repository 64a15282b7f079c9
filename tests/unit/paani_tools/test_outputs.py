"""What a command reads it never writes, nor two of its outputs to one file: told before any work, nothing lost."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from paani.cli import main
from tests.pictures import river
from tests.unit.paani.logs.small_logs import finished

CAMERA = ["--set", "calibration.hfov_deg=60", "--set", "calibration.height_m=1"]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    finished(tmp_path, name="drive.mcap")
    finished(tmp_path, name="drive.png")
    Path("pictures").mkdir()
    cv2.imwrite("pictures/river.jpg", river())
    Path("list.txt").write_text("rivers/images/1.png\n", encoding="utf-8")
    Path("boat.toml").write_text("[navigator]\n", encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["replay", "drive.mcap", "--check", "--json", "drive.mcap"], "--json drive.mcap: is read"),
        (["replay", ".", "--check", "--json", "drive.mcap"], "--json drive.mcap: is read"),
        (["explain", "drive.png", "--picture", "drive.png"], "--picture drive.png: is read"),
        (["logs", "view", "drive.mcap", "--rerun", "--out", "drive.mcap"], "--out drive.mcap: is read"),
        (["logs", "export", "drive.mcap", "--csv", "new", "--gpx", "new"], "--gpx new: is what --csv writes"),
        (["logs", "export", "drive.mcap", "--csv", "new", "--gpx", "list.txt"], "--gpx list.txt: already exists"),
        (["look", "pictures/river.jpg", "--sheet", "pictures/river.jpg"], "--sheet pictures/river.jpg: is read"),
        (["look", "pictures", "--sheet", "pictures/river.jpg"], "--sheet pictures/river.jpg: is read"),
        (["look", "pictures", "--out", "pictures"], "--out pictures: pictures/river.jpg is read from there"),
        (["scenario", "pictures", "--json", "pictures/river.jpg"], "--json pictures/river.jpg: is read"),
        (["faults", ".", "--pictures", "list.txt", "--json", "list.txt"], "--json list.txt: is read"),
        (["faults", ".", "--json", "new", "--svg", "new"], "--svg new: is what --json writes"),
        (["calibrate", "drive.mcap", "--shore-m", "99", "--out", "drive.mcap", *CAMERA], "--out drive.mcap: is read"),
        (
            ["calibrate", "drive.mcap", "--shore-m", "99", "--config", "boat.toml", "--out", "boat.toml", *CAMERA],
            "--out boat.toml: is read",
        ),
        (["calibrate", "hull", "drive.mcap", "--vessel", "paper", "--out", "drive.mcap"], "--out drive.mcap: is read"),
        (
            ["calibrate", "hull", "drive.mcap", "--vessel", "paper", "--out", "new", "--settings", "new"],
            "--settings new: is what --out writes",
        ),
        (["calibrate", "thrusters", "--config", "boat.toml", "--out", "boat.toml"], "--out boat.toml: is read"),
        (["bench", "judgement", "--drive", "drive.mcap", "--json", "drive.mcap"], "--json drive.mcap: is read"),
        (["bench", "planner", "--drive", "drive.mcap", "--json", "drive.mcap"], "--json drive.mcap: is read"),
        (["bench", "water", "--only", "cost", "--json", "new", "--svg", "new"], "--svg new: is what --json writes"),
        (["trial", "--scenario", "boat.toml", "--json", "boat.toml"], "--json boat.toml: is read"),
        (["trial", "--json", "new", "--report", "new"], "--report new: is what --json writes"),
        (["models", "pack", "--out", "list.txt", "--start", "list.txt"], "--out list.txt: is read"),
        (["models", "evaluate", "--json", "new", "--html", "new"], "--html new: is what --json writes"),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, list) else None,
)
@pytest.mark.slow
def test_a_file_is_not_written_over_another(words: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    before = {path: path.read_bytes() if path.is_file() else b"" for path in Path().rglob("*")}
    assert main(words) == 2
    out, errors = capsys.readouterr()
    assert out == ""
    assert message in errors
    assert len(errors.splitlines()) == 1
    assert {path: path.read_bytes() if path.is_file() else b"" for path in Path().rglob("*")} == before
