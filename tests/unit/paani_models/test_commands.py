"""`paani models`: an option that a call would pass over, and a number that nothing can be trained with, are refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from paani.errors import UserError
from paani_models.commands.models import OPTION_USERS, TRAINABLE, main


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("text", encoding="utf-8")
    Path("folder").mkdir()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["train", "segmenter", "--epochs", "3"], "--epochs: segmenter has no use for it"),
        (["train", "segmenter", "--teacher", "file"], "--teacher: segmenter has no use for it"),
        (["train", "gate", "--stage", "1x32x32"], "--stage: gate has no use for it"),
        (["train", "yolo11n", "--seed", "3"], "--seed: yolo11n has no use for it"),
        (["export", "gate", "--untrained", "--share", "0.2"], "--share: is of a checkpoint"),
        (["check", "--score"], "--score: is of a MODEL.onnx"),
        (["check", "file", "--weights", "folder"], "--weights: is not for a MODEL.onnx"),
        (["evaluate", "--predictions", "new"], "--predictions: goes with --lars or --mods"),
        (["evaluate", "--lars", "folder", "--record"], "--record: is not for --lars and --mods"),
        (["evaluate", "--mods", "folder", "--json", "new"], "--json: is not for --lars and --mods"),
        (["evaluate", "gate", "--faults", "file"], "nets: is not for --faults"),
        (["prepare", "--strict"], "--strict: is not for the set `own`"),
        (["prepare", "waterscenes", "--by", "image"], "--by: is not for the set `waterscenes`"),
        (["prepare", "mastr1325", "--manifest", "new"], "--manifest: is not for the set `mastr1325`"),
    ],
)
def test_an_option_that_would_be_passed_over_is_refused(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, *(["--folder", "run"] if words[0] == "train" else [])]) == 2
    assert capsys.readouterr().err == f"paani models: {message}\n"
    assert sorted(path.name for path in Path().iterdir()) == ["file", "folder"]


def test_every_option_of_some_networks_names_networks() -> None:
    assert {net for nets in OPTION_USERS.values() for net in nets} <= set(TRAINABLE)


@pytest.mark.parametrize(
    ("net", "option"),
    [
        ("detector", "--epochs=0"),
        ("detector", "--epochs=-5"),
        ("detector", "--peak-rate=nan"),
        ("detector", "--peak-rate=-1"),
        ("detector", "--draws=1e308"),
        ("detector", "--draws=0"),
        ("detector", "--blend=nan"),
        ("detector", "--batch=0"),
        ("segmenter", "--seed=-1"),
        ("segmenter", f"--seed={2**63}"),
        ("segmenter", "--threads=0"),
    ],
)
def test_a_number_that_nothing_can_be_trained_with_is_refused(
    net: str, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["train", net, "--folder", "run", option])
    assert stop.value.code == 2
    assert f"argument {option.partition('=')[0]}: " in capsys.readouterr().err.splitlines()[-1]
    assert not Path("run").exists()


def test_a_default_folder_that_is_a_file_is_told() -> None:
    Path("file").rename("runs")
    with pytest.raises(UserError, match=r"^--out runs/int8: .*runs is a file, not a folder$"):
        main(["quantise", "segmenter"])
