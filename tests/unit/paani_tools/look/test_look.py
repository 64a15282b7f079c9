"""`paani look`: bad pictures stop, good ones are judged alone, videos in sequence, mistakes are one line."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from paani.cli import main as paani
from paani_tools.look.annotate import FONT, wrap_text
from paani_tools.look.command import file_name, main
from paani_tools.look.contact_sheet import COLUMNS, GAP_PX, MOST, THUMBNAIL_PX, ContactSheet
from tests.pictures import PICTURES, river

FIELDS = ["path", "usable", "cause", "direction", "reason", "risk", "lanes", "detections", "explanation"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "pictures"
    folder.mkdir()
    for name in ("black", "white", "white_noise", "river"):
        cv2.imwrite(str(folder / f"{name}.png"), PICTURES[name])
    return folder


def lines(capsys: pytest.CaptureFixture[str]) -> dict[str, dict[str, object]]:
    found = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    return {Path(line["path"]).stem: line for line in found}


@pytest.mark.slow
def test_json_lines(folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """U8, J19: black, white and noise each STOP / UNUSABLE_IMAGE; exactly the fields scripts rely on; no pictures."""
    monkeypatch.chdir(folder.parent)
    assert main([str(folder), "--json"]) == 0
    found = lines(capsys)
    for name, cause in (("black", "black"), ("white", "white"), ("white_noise", "noise")):
        line = found[name]
        assert list(line) == FIELDS
        assert (line["usable"], line["cause"], line["direction"], line["reason"]) == (
            False, cause, "STOP", "UNUSABLE_IMAGE",
        )  # fmt: skip
    seen = found["river"]
    assert (seen["usable"], seen["cause"]) == (True, "none")
    assert seen["direction"] != "NO_DATA"
    risk, lanes = seen["risk"], seen["lanes"]
    assert isinstance(risk, list)
    assert isinstance(lanes, dict)
    assert risk == [lanes[name]["risk"] for name in ("left", "center", "right")]
    assert [p.name for p in folder.parent.iterdir()] == ["pictures"]


@pytest.mark.slow
@pytest.mark.parametrize("words", [["--json"], ["--out", "annotated"]])
def test_a_name_of_bytes_that_are_no_text_is_told_escaped(
    tmp_path: Path, words: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _, encoded = cv2.imencode(".png", PICTURES["black"])
    Path("p\udcff.png").write_bytes(encoded.tobytes())
    assert paani(["look", "p\udcff.png", *words]) == 0
    assert r"p\udcff.png" in capsys.readouterr().out.replace("\\\\", "\\")


@pytest.mark.slow
def test_readable_lines_and_annotated_pictures(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """J12: advice and its explanation on one line; one annotated picture each, larger than the original."""
    assert main([str(folder), "--json"]) == 0
    as_json = lines(capsys)
    out = tmp_path / "out"
    assert main([str(folder), "--out", str(out)]) == 0
    found = {Path(line.split("  ")[0]).stem: line for line in capsys.readouterr().out.splitlines()}
    assert found.keys() == as_json.keys()
    for name, line in found.items():
        assert str(as_json[name]["direction"]) in line
        assert str(as_json[name]["reason"]) in line
        assert line.endswith(str(as_json[name]["explanation"]))
    assert "UNUSABLE_IMAGE (black)  risk -" in found["black"]
    assert sorted(p.name for p in out.iterdir()) == ["black.jpg", "river.jpg", "white.jpg", "white_noise.jpg"]
    drawn = cv2.imread(str(out / "river.jpg"))
    assert drawn is not None
    assert drawn.shape == (742, 800, 3)


@pytest.mark.slow
def test_the_paper_goes_on_in_the_dark(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """J19: the `paper` profile has no image-quality check, so black is judged by the nets."""
    assert main([str(folder / "black.png"), "--json", "--profile", "paper"]) == 0
    assert lines(capsys)["black"]["usable"] is True


@pytest.mark.slow
def test_a_spoilt_picture_among_others_is_reported(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "aaa.jpg").write_bytes(b"spoilt")
    assert main([str(folder), "--json"]) == 0
    assert lines(capsys)["aaa"]["cause"] == "undecodable"


@pytest.mark.slow
def test_stills_do_not_know_of_each_other(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ten equal stills: none is called frozen, all get the same advice."""
    for i in range(10):
        cv2.imwrite(str(tmp_path / f"{i}.png"), river())
    assert main([str(tmp_path), "--json"]) == 0
    found = list(lines(capsys).values())
    assert len(found) == 10
    assert all({**line, "path": ""} == {**found[0], "path": ""} for line in found)
    assert found[0]["usable"] is True


@pytest.mark.slow
def test_a_video_is_one_sequence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A film of one and the same picture is a frozen camera from its third frame on."""
    path = tmp_path / "still.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 5.0, (320, 240))
    for _ in range(8):
        writer.write(np.asarray(river(), np.uint8))
    writer.release()
    assert main([str(path), "--json"]) == 0
    causes = [json.loads(line)["cause"] for line in capsys.readouterr().out.splitlines()]
    assert causes == ["none"] * 2 + ["frozen"] * 6


@pytest.mark.slow
def test_a_mistake_is_one_line_and_exit_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spoilt = tmp_path / "spoilt.jpg"
    spoilt.write_bytes(b"spoilt")
    for path in (tmp_path / "missing.jpg", spoilt):
        assert paani(["look", str(path), "--json"]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert captured.err.count("\n") == 1
        assert str(path) in captured.err


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--out", "spoilt.jpg/below"], "--out spoilt.jpg/below"),
        (["--sheet", "missing/sheet.png"], "--sheet missing/sheet.png"),
        (["--sheet", "sheet.txt"], "--sheet sheet.txt"),
    ],
)
@pytest.mark.slow
def test_an_impossible_output_is_refused_before_the_first_picture(
    options: list[str], named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("spoilt.jpg").write_bytes(b"spoilt")
    cv2.imwrite("river.png", river())
    assert paani(["look", "river.png", *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"paani: {named}: ")
    assert sorted(path.name for path in Path().iterdir()) == ["river.png", "spoilt.jpg"]


@pytest.mark.slow
def test_annotated_pictures_go_below_runs_by_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("river.png", river())
    assert main(["river.png"]) == 0
    assert sorted(str(path) for path in Path().rglob("*.jpg")) == ["runs/look/river.jpg"]


def test_names_never_clash() -> None:
    taken: set[str] = set()
    names = [file_name(name, taken) for name in ("a/x.png", "b/x.png", "c/x.jpg", "c/x.mp4#7")]
    assert names == ["x.jpg", "x_2.jpg", "x_3.jpg", "x_000007.jpg"]


def test_an_explanation_is_wrapped_by_its_drawn_width() -> None:
    """Wide letters take more room than narrow ones; a word that fits nowhere has a line of its own."""
    for letters in ("wwww", "iiii"):
        lines = wrap_text(" ".join([letters] * 60), 0.6, 400)
        assert sum(len(line.split()) for line in lines) == 60
        assert all(cv2.getTextSize(line, FONT, 0.6, 1)[0][0] <= 400 for line in lines)
    assert wrap_text("a " + "w" * 90 + " b", 0.6, 400) == ["a", "w" * 90, "b"]
    assert wrap_text("", 0.6, 400) == []


@pytest.mark.slow
def test_a_sheet_shows_the_folder_in_one_picture(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    sheet = tmp_path / "sheet.png"
    assert main([str(folder), "--sheet", str(sheet)]) == 0
    drawn = cv2.imread(str(sheet))
    assert drawn is not None
    assert drawn.shape[1] == COLUMNS * (THUMBNAIL_PX + GAP_PX)
    top = [drawn[100:200, n * (THUMBNAIL_PX + GAP_PX) : (n + 1) * (THUMBNAIL_PX + GAP_PX)].mean() for n in range(4)]
    assert top[0] < 30  # black, river, white, white noise
    assert top[2] > 200
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pictures", "sheet.png"]


@pytest.mark.slow
def test_a_sheet_of_many_is_spread_over_all_of_them() -> None:
    sheet = ContactSheet()
    assert sheet.compose() is None
    for level in range(200):
        sheet.add(np.full((60, 80, 3), level, np.uint8))
    drawn = sheet.compose()
    assert drawn is not None
    rows = drawn.shape[0] // (THUMBNAIL_PX * 60 // 80 + GAP_PX)
    levels = [
        int(drawn[row * (THUMBNAIL_PX * 60 // 80 + GAP_PX) + 9, column * (THUMBNAIL_PX + GAP_PX) + 9, 0])
        for row in range(rows)
        for column in range(COLUMNS)
    ]
    assert levels[:25] == list(range(0, 200, 8))
    assert rows * COLUMNS <= MOST


@pytest.mark.parametrize("name", ["sheet.gif", "nowhere/sheet.png"])
@pytest.mark.slow
def test_a_sheet_that_cannot_be_written_is_named(folder: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert paani(["look", str(folder), "--sheet", str(folder / name)]) == 2
    error = capsys.readouterr().err
    assert name in error
    assert error.count("\n") == 1
