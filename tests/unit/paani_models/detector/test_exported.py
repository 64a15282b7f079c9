"""Detectors of different input sizes are scored in the same frame."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from paani.cli import main
from paani.errors import UserError
from paani_models.datasets.sources import SOURCES, Sample
from paani_models.detector.exported import open_detector
from paani_models.detector.scores import count_false_alarms, score_boxes
from tests.unit.paani_models.test_bring_your_own import save

pytest.importorskip("onnx", reason="needs the extra paani[train]")

VESSEL = 1


def answering(folder: Path, size_wh: tuple[int, int]) -> Path:
    """A detector of an input size that sees a quarter of the width and of the picture's height in the middle."""
    width, height = size_wh
    answer = np.zeros((1, 8, 2), np.float32)
    answer[0, :, 0] = (width / 2, height / 2, width / 4, width * 3 / 16, 0, 0.9, 0, 0)
    path = folder / f"{width}.onnx"
    save(path, answer, [1, 3, height, width])
    return path


@pytest.mark.parametrize("size_wh", [(320, 256), (416, 320), (160, 128)])
def test_every_size_is_scored_in_the_same_frame(tmp_path: Path, size_wh: tuple[int, int]) -> None:
    """640x480 is 320x240 in the middle of 320x256."""
    picture, label = tmp_path / "a.png", tmp_path / "a.txt"
    cv2.imwrite(str(picture), np.full((480, 640, 3), 90, np.uint8))
    label.write_text("1 0.5 0.5 0.25 0.25\n")
    net = answering(tmp_path, size_wh)
    found = open_detector(net).find(np.full((480, 640, 3), 90, np.uint8), 0.4, 24)
    np.testing.assert_allclose(found.boxes, [[240, 180, 400, 300]], atol=1e-2)
    source = next(s for s in SOURCES if s.name == "mcoe_boats")
    (scored,) = score_boxes(net, [Sample(source, "a", True, picture, None, label)])
    np.testing.assert_allclose(scored.detections.boxes, [[120, 98, 200, 158]], atol=1e-2)
    np.testing.assert_allclose(scored.truth, [[VESSEL, 120, 98, 200, 158]], atol=0.6)
    assert scored.class_matches(VESSEL).hits.all()


def test_a_vessel_where_none_is_counts(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.full((240, 320, 3), 90, np.uint8))
    river = next(s for s in SOURCES if "vessel" in s.empty_of)
    sample = Sample(river, "a", True, tmp_path / "a.png", None, None)
    assert count_false_alarms(answering(tmp_path, (416, 320)), [sample]) == [1]


@pytest.mark.parametrize("side", ["height", "9" * 5000])
def test_a_detector_without_a_fixed_size_of_input_is_refused_in_one_line(tmp_path: Path, side: str) -> None:
    path = tmp_path / "any.onnx"
    save(path, np.zeros((1, 8, 2), np.float32), [1, 3, side, 320])
    with pytest.raises(UserError) as refused:
        open_detector(path)
    assert str(refused.value).startswith(f"{path}: takes ")
    assert len(str(refused.value)) < len(str(path)) + 150


@pytest.mark.parametrize("net", ["segmenter", "detector"])
def test_a_network_of_another_contract_is_not_quantised(
    tmp_path: Path, net: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("paani_models.commands.models._select_pictures", lambda _: None)  # refused before they matter
    path, out = tmp_path / "other.onnx", tmp_path / "out"
    save(path, np.zeros((1, 8, 2), np.float32), [1, 3, "height", 320])
    assert main(["models", "quantise", net, "--model", str(path), "--out", str(out)]) == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith(f"paani models: {path}: input [1, 3, 'height', 320] is")
    assert not out.exists()
