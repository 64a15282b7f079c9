"""Pictures in batches: every one scored once, in order, by the network that was meant."""

from __future__ import annotations

from pathlib import Path

import pytest

from paani.errors import UserError
from paani_models.datasets.batches import BATCH_PICTURES, Batch, network_of, score_batches
from paani_models.datasets.sources import SOURCES, Sample

SAMPLES = [Sample(SOURCES[0], "a", True, Path(f"{number}.jpg"), None, None) for number in range(2 * BATCH_PICTURES + 1)]


def name_pictures(batch: Batch) -> list[str]:
    assert len(batch.samples) <= BATCH_PICTURES
    assert network_of(batch).is_absolute()
    return [sample.picture.name for sample in batch.samples]


def test_batches_give_one_result_per_picture_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("net.onnx").write_bytes(b"network")
    assert score_batches(name_pictures, Path("net.onnx"), SAMPLES, None, "test") == [s.picture.name for s in SAMPLES]
    assert score_batches(name_pictures, Path("net.onnx"), [], None, "test") == []


def test_another_network_under_the_same_name_is_refused(tmp_path: Path) -> None:
    """As a worker's own file may be."""
    net = tmp_path / "net.onnx"
    net.write_bytes(b"network")

    def replace_it(batch: Batch) -> list[Path]:
        net.write_bytes(b"another")
        return [network_of(batch)]

    with pytest.raises(UserError, match=r"net\.onnx: not the file that it is where the work was asked for"):
        score_batches(replace_it, net, SAMPLES[:1], None, "test")
    with pytest.raises(UserError, match=r"gone\.onnx: No such file"):
        score_batches(replace_it, tmp_path / "gone.onnx", SAMPLES, None, "test")
