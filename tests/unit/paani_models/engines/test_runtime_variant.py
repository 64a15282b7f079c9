"""Networks that take pictures as bytes and answer once per cell: the same evidence as the float contract."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

onnx = pytest.importorskip("onnx", reason="needs the extra paani[train]")

from paani import messages as m  # noqa: E402
from paani.cli import main  # noqa: E402
from paani.clock import stopwatch_ms  # noqa: E402
from paani.config import PerceptionConfig  # noqa: E402
from paani.errors import UserError  # noqa: E402
from paani_models.catalogue import Tensor, load_catalogue, save_catalogue, verified_path  # noqa: E402
from paani_models.commands.models import data_folder  # noqa: E402
from paani_models.engines.runtime_variant import write_variant  # noqa: E402
from paani_services.perception.engine import OnnxEngine  # noqa: E402
from paani_services.perception.pipeline import Perceiver  # noqa: E402
from paani_services.perception.preprocessing import lookup_tables_for, stretch_picture  # noqa: E402
from tests.pictures import PICTURES, river  # noqa: E402

pytestmark = pytest.mark.slow

HEADER = m.PictureHeader(source_us=1_000_000, frame_seq=7, frame_epoch=3, width_px=320, height_px=240)
NETS = ("segmenter", "detector")
# Of shares in 0..1 and scores; a cell of 5,120 whose two best scores agree to rounding may change sides.
TOLERANCE = 1e-3


@pytest.fixture(scope="module")
def variant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("variant")
    for name in NETS:
        write_variant(name, load_catalogue()[name], verified_path(name), folder)
    return folder


def perceivers(variant: Path) -> list[Perceiver]:
    own = PerceptionConfig(segmenter=str(variant / "segmenter.onnx"), detector=str(variant / "detector.onnx"))
    return [Perceiver(config, stopwatch_ms) for config in (PerceptionConfig(), own)]


def assert_same_evidence(pair: list[Perceiver], pictures: list[np.ndarray]) -> None:
    for epoch, picture in enumerate(pictures):
        header = msgspec.structs.replace(HEADER, frame_epoch=epoch)
        one, other = (eyes.perceive(picture, header, 0.0)[0] for eyes in pair)
        assert one.cause == other.cause
        for name in ("left", "center", "right"):
            lanes = [getattr(evidence, name) for evidence in (one, other)]
            for field in ("non_water", "uncertainty"):
                assert getattr(lanes[0], field) == pytest.approx(getattr(lanes[1], field), abs=TOLERANCE)
            assert lanes[0].clear_width == pytest.approx(lanes[1].clear_width, abs=0.05)
        assert [d.label for d in one.detections] == [d.label for d in other.detections]
        for a, b in zip(one.detections, other.detections, strict=True):
            assert a.confidence == pytest.approx(b.confidence, abs=TOLERANCE)
            np.testing.assert_allclose(a.box_xyxy, b.box_xyxy, atol=TOLERANCE)


def test_same_evidence_on_drawn_pictures(variant: Path) -> None:
    wide = np.asarray(cv2.resize(river(3), (640, 360)), np.uint8)
    assert_same_evidence(perceivers(variant), [*PICTURES.values(), river(1), river(2), wide])


def test_perception_reads_the_cells_between_which_the_whole_answer_lies(
    variant: Path,
) -> None:
    """One picture, three ways: the shipped file as perception runs it, its variant, and its whole answer."""
    contract, picture = load_catalogue()["segmenter"], river(4)
    stretched = stretch_picture(picture, *contract.size_hw, lookup_tables_for(contract))
    cells, whole = (OnnxEngine.load("segmenter", "", 1, full_size=whole).run(stretched) for whole in (False, True))
    own = OnnxEngine.load("segmenter", str(variant / "segmenter.onnx"), 1)
    assert cells.shape == (1, 3, 64, 80)
    assert whole.shape == contract.output.shape
    np.testing.assert_allclose(own.run(stretch_picture(picture, *contract.size_hw, None)), cells, atol=TOLERANCE)
    for plane, answer in zip(cells[0], whole[0], strict=True):
        between = cv2.resize(plane, (320, 256), interpolation=cv2.INTER_LINEAR)
        np.testing.assert_allclose(answer, between, atol=TOLERANCE)


@pytest.mark.data
def test_same_evidence_on_photographs(variant: Path) -> None:
    folder = Path(os.environ.get("PAANI_DATA", data_folder())) / "unlabelled"
    if not folder.is_dir():
        pytest.skip("the annotated pictures are absent")
    files = sorted(path for path in folder.rglob("*") if path.suffix in {".jpg", ".png"})[::4]
    assert_same_evidence(perceivers(variant), [p for path in files if (p := cv2.imread(str(path))) is not None])


def test_the_manifest_states_bytes_in_and_cells_out(variant: Path) -> None:
    catalogue = load_catalogue(variant)
    assert catalogue["segmenter"].input == Tensor("picture", (1, 256, 320, 3), "uint8")
    assert catalogue["segmenter"].output.shape == (1, 3, 64, 80)
    assert catalogue["detector"].output.shape == (1, 8, 2730)
    assert catalogue["segmenter"].size_hw == (256, 320) == load_catalogue()["segmenter"].size_hw
    for name in NETS:
        assert verified_path(name, variant).is_file()


def test_check_accepts_both(variant: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, size in (("segmenter", "256, 320"), ("detector", "320, 416")):
        assert main(["models", "check", str(variant / f"{name}.onnx")]) == 0
        assert f"input [1, {size}, 3] uint8" in capsys.readouterr().out


def test_the_variant_command_prints_its_settings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["models", "variant", "--out", str(tmp_path)]) == 0
    assert f"--set perception.segmenter={tmp_path / 'segmenter.onnx'}" in capsys.readouterr().out


def test_a_manifest_that_contradicts_its_network_is_refused(tmp_path: Path) -> None:
    """Bytes promised, floats taken; and a shape that is not one of bytes."""
    shipped = load_catalogue()["segmenter"]
    (tmp_path / "own.onnx").write_bytes(verified_path("segmenter").read_bytes())
    own = msgspec.structs.replace(shipped, file="own.onnx", input=Tensor("input", (1, 256, 320, 3), "uint8"))
    save_catalogue({"own": own}, tmp_path)
    with pytest.raises(UserError, match=r"own\.onnx: segmenter must have uint8 \[1, 256, 320, 3\]"):
        OnnxEngine.load("segmenter", str(tmp_path / "own.onnx"), 1)
    save_catalogue({"own": msgspec.structs.replace(own, input=Tensor("input", (1, 3, 256, 320), "uint8"))}, tmp_path)
    with pytest.raises(UserError, match=r"input\.shape: \[1, 3, 256, 320\] is not \[1, H, W, 3\]"):
        OnnxEngine.load("segmenter", str(tmp_path / "own.onnx"), 1)
