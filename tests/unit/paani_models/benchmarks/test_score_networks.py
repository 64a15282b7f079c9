"""The networks on miniatures of LaRS and MODS: read, scored, and written in the formats that the benchmarks take."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

from paani.errors import UserError
from paani_models.benchmarks.lars import read_prediction
from paani_models.benchmarks.mods import Obstacle
from paani_models.benchmarks.mods_detection import Results
from paani_models.benchmarks.score_networks import annotated_rows, drop_ignored, read_calibration, rows_inside
from paani_models.commands.models import main
from paani_models.detector.exported import ExportedDetector
from tests.pictures import river
from tests.unit.paani_models.datasets.public_sets import write_picture

pytestmark = pytest.mark.slow

CALIBRATION = """%YAML:1.0
---
imageSize: [ 320, 240 ]
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 300., 0., 160., 0., 300., 120., 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
"""


def lars(root: Path) -> Path:
    semantic = np.full((240, 320), 1, np.uint8)
    semantic[:60], semantic[60:110] = 2, 0
    panoptic = np.zeros((240, 320, 3), np.uint8)
    panoptic[..., 0] = np.array([1, 3, 5], np.uint8)[semantic]
    write_picture(root / "images" / "a.jpg", river())
    write_picture(root / "semantic_masks" / "a.png", semantic)
    write_picture(root / "panoptic_masks" / "a.png", panoptic[..., ::-1])
    (root / "image_list.txt").write_text("a\n")
    segments = [{"id": 1, "category_id": 1}, {"id": 3, "category_id": 3}, {"id": 5, "category_id": 5}]
    (root / "panoptic_annotations.json").write_text(
        json.dumps(
            {"images": [{"id": 0, "file_name": "a.jpg"}], "annotations": [{"image_id": 0, "segments_info": segments}]}
        )
    )
    return root


def mods(root: Path) -> Path:
    write_picture(root / "sequences" / "kope1-0-10" / "frames" / "0L.jpg", river())
    (root / "calibration").mkdir()
    (root / "calibration" / "calibration-kope1.yaml").write_text(CALIBRATION)
    frame = {
        "id": 0,
        "image_file_name": "0L.jpg",
        "roll": 0.0,
        "pitch": 0.0,
        "obstacles": [{"id": 0, "type": "ship", "bbox": [150, 78, 30, 34], "area": 900}],
        "water_edges": [{"x_axis": [0, 319], "y_axis": [110, 110]}],
    }
    sequence = {"id": 0, "path": "/kope1-0-10/frames/", "exhaustive": 1, "num_frames": 1, "frames": [frame]}
    (root / "mods.json").write_text(json.dumps({"dataset": {"num_seq": 1, "sequences": [sequence]}}))
    return root


def test_lars_is_scored_and_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = lars(tmp_path / "lars")
    assert main(["evaluate", "--lars", str(root), "--predictions", str(tmp_path / "out")]) == 0
    figures = msgspec.json.decode(capsys.readouterr().out)
    assert figures["iou_water"] > 50
    assert figures["q"] == 0
    assert read_prediction(tmp_path / "out" / "a.png").shape == (240, 320)


def test_mods_is_scored_and_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = mods(tmp_path / "mods")
    assert main(["evaluate", "--mods", str(root), "--predictions", str(tmp_path / "out")]) == 0
    figures = msgspec.json.decode(capsys.readouterr().out)
    assert set(figures) >= {"edge_px", "edge_hit", "f1", "f1_zone", "f_by_class", "f_agnostic", "f_zone", "score"}
    written = cv2.imread(str(tmp_path / "out" / "paani" / "kope1-0-10" / "0L.png"))
    assert written is not None
    assert {tuple(colour) for colour in written.reshape(-1, 3)[:, ::-1].tolist()} <= {
        (0, 0, 0),
        (255, 0, 0),
        (0, 255, 0),
    }
    tracks = msgspec.json.decode((tmp_path / "out" / "detections.json").read_bytes(), type=Results)
    assert tracks.dataset.sequences[0].frames[0].image_file_name == "0L.jpg"


def test_what_is_missing_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = mods(tmp_path / "mods")
    (root / "sequences" / "kope1-0-10" / "frames" / "0L.jpg").unlink()
    assert main(["evaluate", "--mods", str(root)]) == 2
    assert "0L.jpg: No such file" in capsys.readouterr().err
    assert main(["evaluate", "--lars", str(tmp_path)]) == 2
    assert "image_list.txt" in capsys.readouterr().err
    with pytest.raises(UserError, match=r"calibration-stru2\.yaml: no such file"):
        read_calibration(root, "stru2-1")
    (root / "calibration" / "calibration-stru2.yaml").write_text("%YAML:1.0\n---\na: 1\n")
    with pytest.raises(UserError, match=r"calibration-stru2\.yaml: holds no M1"):
        read_calibration(root, "stru2-1")


@pytest.mark.parametrize("size_wh", [(320, 256), (416, 320)])
def test_boxes_come_back_to_the_picture(size_wh: tuple[int, int]) -> None:
    """1280x720 lies in the middle of the input, with grey above; what reaches beyond is cut."""
    scale = size_wh[0] / 1280
    output = np.zeros((1, 8, 2), np.float32)
    output[0, :, 0] = (size_wh[0] / 2, size_wh[1] / 2, 160 * scale, 80 * scale, 0, 0.9, 0, 0)
    output[0, :, 1] = (size_wh[0] / 2, size_wh[1], 160 * scale, 800 * scale, 0, 0, 0, 0.8)
    found = ExportedDetector(lambda _: output, size_wh).find(np.zeros((720, 1280, 3), np.uint8), 0.4, 24)
    wanted = [[1, 560, 320, 720, 400], [3, 560, found.boxes[1, 1], 720, 720]]
    np.testing.assert_allclose(rows_inside(found, (1280, 720)), wanted, atol=1e-3)


def test_boxes_mostly_in_the_ignored_part_are_left_out() -> None:
    ignored = np.zeros((100, 100), bool)
    ignored[:50] = True
    rows = np.array([[0, 10, 40, 20, 60], [0, 10, 39, 20, 59], [0, 10, 10, 20, 20]], np.float32)
    assert drop_ignored(rows, ignored).tolist() == [rows[0].tolist()]


def test_annotated_types_are_the_files() -> None:
    kinds = [Obstacle(kind, (1, 2, 3, 4), 12) for kind in ("ship", "person", "other", "negative")]
    assert annotated_rows(kinds).tolist() == [[0, 1, 2, 4, 6], [1, 1, 2, 4, 6], [2, 1, 2, 4, 6]]
