"""The two off-the-shelf networks: their outputs decoded by hand, and people found on real pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from paani.errors import UserError
from paani_models.commands.models import data_folder
from paani_models.datasets.sources import choose_sources, read_samples
from paani_models.detector.off_the_shelf import (
    KNOWN,
    NANODET_FILES,
    YOLOX_FILE,
    decode_nanodet,
    decode_yolox,
    open_off_the_shelf,
    yolox_input,
)
from paani_models.report.height_scores import DetectorRun, match_in_range, run_detectors

has_networks = all((data_folder() / name).is_file() for name in (YOLOX_FILE, *NANODET_FILES))


def test_yolox_cells_and_classes() -> None:
    """The cell of row 1, column 2 at stride 16: an offset of half a cell, twice its size, a boat."""
    output = np.zeros((3549, 85), np.float32)
    place = 52 * 52 + 26 + 2
    output[place, :4] = (0.5, 0.5, np.log(2.0), np.log(4.0))
    output[place, 4], output[place, 5 + 8] = 0.5, 0.8
    row = decode_yolox(output)[:, place]
    assert row == pytest.approx([40.0, 24.0, 32.0, 64.0, 0.0, 0.4, 0.0, 0.0], abs=1e-4)


def test_nanodet_cells_and_distances() -> None:
    """The cell of row 2, column 1 at stride 32: sure distances of 1, 2, 3 and 4 cells, a person."""
    output = np.zeros((3598, 112), np.float32)
    place = 52 * 52 + 26 * 26 + 2 * 13 + 1
    output[place, 0] = 0.7
    for side, distance in enumerate((1, 2, 3, 4)):
        output[place, 80 + 8 * side + distance] = 100.0
    row = decode_nanodet(output)[:, place]
    low, high = np.array([32 - 32, 64 - 64]), np.array([32 + 96, 64 + 128])
    assert row == pytest.approx([*(low + high) / 2, *(high - low), 0.7, 0.0, 0.0, 0.0], abs=1e-3)


def test_a_picture_is_put_upper_left_in_bgr() -> None:
    picture = np.zeros((100, 200, 3), np.uint8)
    picture[..., 0] = 255
    fed = yolox_input(picture)
    assert fed.shape == (1, 3, 416, 416)
    assert fed[0, :, 0, 0].tolist() == [0.0, 0.0, 255.0]
    assert fed[0, :, 300, 0].tolist() == [114.0, 114.0, 114.0]


def test_missing_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"yolox_nano_coco\.onnx"):
        open_off_the_shelf(tmp_path)


@pytest.mark.data
@pytest.mark.skipif(not has_networks, reason=f"no off-the-shelf networks in {data_folder()}; set PAANI_DATA")
def test_both_find_people_in_streets() -> None:
    """At most a quarter of 24 near people missed; their makers' preprocessing is what finds them."""
    pytest.importorskip("ncnn", reason="needs the extra paani[ncnn]")
    runs = [DetectorRun(each.name, KNOWN, each.find) for each in open_off_the_shelf(data_folder())]
    results = run_detectors(runs, read_samples(data_folder(), choose_sources(["pennfudan"]))[:10])
    for run in runs:
        parts = [match_in_range(r.found[run.name], r.truth, 0, (0.0, np.inf)) for r in results]
        found = sum(int(hits[scores > 0.4].sum()) for scores, hits, _ in parts)
        assert found >= 0.75 * sum(count for *_, count in parts) > 5
