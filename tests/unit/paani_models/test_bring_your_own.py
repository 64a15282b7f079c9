"""A user's own models: what the check says of them, and sizes and class orders that a manifest declares."""

from __future__ import annotations

import logging
import shutil
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from paani import messages as m
from paani.cli import main
from paani.clock import stopwatch_ms
from paani.config import PerceptionConfig, load_config
from paani.errors import UserError
from paani_models.catalogue import (
    Model,
    Preprocessing,
    Tensor,
    load_catalogue,
    read_contract,
    save_catalogue,
    verified_path,
)
from paani_models.engines.contract_check import Finding, inspect_model
from paani_services.perception.corridors import classify_cells
from paani_services.perception.engine import OnnxEngine
from paani_services.perception.pipeline import Perceiver
from paani_services.perception.service import require_people_seen
from tests.pictures import river

SIZE = (96, 160)
HEADER = m.PictureHeader(source_us=1_000_000, frame_seq=7, frame_epoch=3, width_px=320, height_px=240)


def foreign_segmenter(path: Path, order: tuple[str, ...], bias: float = 0.0) -> None:
    """A network that calls the lower part of any picture water and the upper part sky, rows in `order`."""
    height, width = SIZE
    rows = np.arange(height, dtype=np.float32)[:, None] * np.ones(width, np.float32)
    scores = {"water": (rows - 45.0) / 4.0, "sky": (40.0 - rows) / 4.0, "obstacle": np.zeros_like(rows) + bias}
    planes = np.stack([scores[name] for name in order])[None].astype(np.float32)
    save(path, planes, [1, 3, *SIZE])


def save(path: Path, answer: np.ndarray, input_shape: list[Any], kind: int = TensorProto.FLOAT) -> None:
    """A network whose answer hardly depends on its input."""
    nodes = [
        helper.make_node("ReduceMean", ["input"], ["mean"], keepdims=0),
        helper.make_node("Mul", ["mean", "little"], ["nudge"]),
        helper.make_node("Add", ["answer", "nudge"], ["output"]),
    ]
    graph = helper.make_graph(
        nodes,
        "foreign",
        [helper.make_tensor_value_info("input", kind, input_shape)],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, list(answer.shape))],
        [
            numpy_helper.from_array(answer.astype(np.float32), "answer"),
            numpy_helper.from_array(np.array(1e-4, np.float32), "little"),
        ],
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), str(path))


def stated(file: str, classes: tuple[str, ...]) -> Model:
    return msgspec.structs.replace(
        load_catalogue()["segmenter"],
        file=file,
        classes=classes,
        input=Tensor("input", (1, 3, *SIZE)),
        output=Tensor("output", (1, 3, *SIZE)),
        preprocessing=Preprocessing("stretch", (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)),
    )


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """A segmenter of another maker, with the manifest that declares it."""
    path = tmp_path / "lake.onnx"
    order = ("sky", "obstacle", "water")
    foreign_segmenter(path, order)
    save_catalogue({"lake": stated("lake.onnx", order)}, tmp_path)
    return path


@pytest.mark.slow
def test_a_foreign_segmenter_is_checked_and_used(foreign: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Another size, another order of classes: declared in the manifest, understood by the check and by perception."""
    assert main(["models", "check", str(foreign)]) == 0
    printed = capsys.readouterr().out
    assert "input [1, 3, 96, 160] float32" in printed
    assert "classes sky, obstacle, water" in printed
    assert "warning" in printed  # it calls black water, so only the image-quality check stands before motion
    assert f"--set perception.segmenter={foreign}" in printed
    evidence, mask = Perceiver(PerceptionConfig(segmenter=str(foreign)), stopwatch_ms).perceive(river(), HEADER, 0.0)
    assert mask is not None
    assert (mask[-1] == 0).all()
    assert (mask[0] == 2).all()
    assert evidence.center.non_water < 0.35
    assert evidence.navigation_eligible


def test_without_a_manifest_the_shipped_contract_holds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "own.onnx"
    foreign_segmenter(path, ("water", "obstacle", "sky"))
    assert main(["models", "check", str(path)]) == 1
    printed = capsys.readouterr().out
    assert "input is [1, 3, 96, 160], the contract has [1, 3, 256, 320]; a manifest.json beside the file" in printed
    assert "cannot be used as it is" in printed
    with pytest.raises(UserError, match=r"own\.onnx: segmenter must have float32"):
        OnnxEngine.load("segmenter", str(path), 1)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"classes": ("water", "land", "sky")}, "classes: 'land' is not one of water, obstacle, sky"),
        ({"classes": ("water", "water", "sky")}, "classes: a segmenter has water, obstacle, sky, each once"),
        ({"input": Tensor("input", (3, 96, 160))}, r"input\.shape"),
        ({"preprocessing": Preprocessing("letterbox", (0.0,) * 3, (1.0,) * 3)}, r"preprocessing\.resize"),
        ({"preprocessing": Preprocessing("stretch", (0.0,) * 3, (0.0, 1.0, 1.0))}, r"preprocessing\.std: \[0\.0, 1\.0"),
        ({"preprocessing": Preprocessing("stretch", (0.0,) * 3, (1.0,) * 3, 400)}, r"preprocessing\.pad_grey: 400"),
        ({"output": Tensor("output", (1, 2, 96, 160))}, r"output\.shape: \[1, 2, 96, 160\] is not \[1, 3, H, W\]"),
    ],
)
def test_a_manifest_that_cannot_be(foreign: Path, changes: dict[str, Any], named: str) -> None:
    own = msgspec.structs.replace(stated("lake.onnx", ("sky", "obstacle", "water")), **changes)
    save_catalogue({"lake": own}, foreign.parent)
    with pytest.raises(UserError, match=named):
        OnnxEngine.load("segmenter", str(foreign), 1)


@pytest.mark.parametrize("size", [(16, 20), (128, 2), (64, 80), (300, 500)])
def test_a_mask_has_the_same_cells_whatever_the_size_of_the_output(size: tuple[int, int]) -> None:
    logits = np.zeros((1, 3, *size), np.float32)
    logits[0, 1, : size[0] // 2] = 9.0
    mask, confidence = classify_cells(logits, 1.0)
    assert mask.shape == confidence.shape == (64, 80)
    assert (mask[:28] == 1).all()
    assert (mask[36:] == 0).all()


def test_a_detectors_manifest_states_a_row_for_each_class(tmp_path: Path) -> None:
    own = msgspec.structs.replace(load_catalogue()["detector"], file="own.onnx", classes=("vessel", "person"))
    save_catalogue({"own": own}, tmp_path)
    with pytest.raises(UserError, match=r"output\.shape: \[1, 8, 2730\] is not \[1, 6, N\]"):
        read_contract(tmp_path / "own.onnx", "detector")


@pytest.mark.slow
def test_a_detector_that_answers_with_no_number_moves_nothing(tmp_path: Path) -> None:
    """No box is not nobody: where none of its candidates is finite, nothing was looked for."""
    path = tmp_path / "own.onnx"
    for answer, is_eligible in ((np.nan, False), (0.0, True)):
        output = candidates(200.0, 0.0)
        output[:, 4:] = answer
        save(path, output, [1, 3, 320, 416])
        evidence, _ = Perceiver(PerceptionConfig(detector=str(path)), stopwatch_ms).perceive(river(), HEADER, 0.0)
        assert (evidence.usable, evidence.navigation_eligible) == (True, is_eligible)


def probabilities() -> np.ndarray:
    return np.full((1, 3, 256, 320), 1 / 3, np.float32)


def candidates(scale: float, score: float) -> np.ndarray:
    boxes = np.random.default_rng(0).uniform(0.1, 1.0, (1, 4, 2730)) * scale
    return np.concatenate((boxes, np.full((1, 4, 2730), score)), axis=1).astype(np.float32)


@pytest.mark.parametrize(
    ("answer", "named"),
    [
        (probabilities(), "sums to one"),
        (np.full((1, 3, 256, 320), np.nan, np.float32), "not finite on a picture of black"),
        (candidates(1.0, 0.5), "seem normalised"),
        (candidates(200.0, 3.0), "are no probabilities"),
    ],
)
@pytest.mark.slow
def test_outputs_that_are_not_of_the_contract(
    answer: np.ndarray, named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "own.onnx"
    save(path, answer, [1, 3, 256, 320] if answer.ndim == 4 else [1, 3, 320, 416])
    assert main(["models", "check", str(path)]) == 1
    assert named in capsys.readouterr().out


@pytest.mark.slow
def test_dynamic_axes_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "own.onnx"
    save(path, candidates(200.0, 0.5), ["batch", 3, 320, 416])
    assert main(["models", "check", str(path)]) == 1
    assert "is not static" in capsys.readouterr().out


@pytest.mark.slow
def test_files_that_are_no_models(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Truncated, empty, foreign and missing files: one line that names the file, exit code 2."""
    whole = verified_path("segmenter").read_bytes()
    for name, data in (("cut.onnx", whole[: len(whole) // 2]), ("empty.onnx", b""), ("text.onnx", b"text" * 99)):
        (tmp_path / name).write_bytes(data)
        assert main(["models", "check", str(tmp_path / name)]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert name in error
    assert main(["models", "check", str(tmp_path / "none.onnx")]) == 2
    assert "none.onnx" in capsys.readouterr().err


@pytest.mark.slow
def test_a_detector_with_other_classes(tmp_path: Path) -> None:
    """Rows in another order, and rows that are left out: labels are those of the manifest."""
    path = tmp_path / "boats.onnx"
    boxes = np.zeros((1, 6, 2730), np.float32)
    boxes[0, :4, 0] = (160.0, 200.0, 80.0, 60.0)
    boxes[0, 4, 0], boxes[0, 5, 0] = 0.95, 0.8  # the left-out class scores higher
    save(path, boxes, [1, 3, 320, 416])
    shipped = load_catalogue()["detector"]
    own = msgspec.structs.replace(shipped, file="boats.onnx", classes=("-", "vessel"), output=Tensor("o", (1, 6, 2730)))
    save_catalogue({"boats": own}, tmp_path)
    evidence, _ = Perceiver(PerceptionConfig(detector=str(path)), stopwatch_ms).perceive(river(), HEADER, 0.0)
    assert [d.label for d in evidence.detections] == [m.Label.VESSEL]
    assert evidence.detections[0].confidence == pytest.approx(0.8, abs=1e-3)


def detector_of(folder: Path, classes: tuple[str, ...], candidate_count: int = 2730) -> Path:
    """A detector that finds nothing, with the manifest that declares its classes."""
    path = folder / "own.onnx"
    shape = (1, 4 + len(classes), candidate_count)
    answer = np.concatenate([np.full((1, 4, candidate_count), 150.0), np.zeros((1, len(classes), candidate_count))], 1)
    save(path, answer.astype(np.float32), [1, 3, 320, 416])
    own = msgspec.structs.replace(
        load_catalogue()["detector"], file="own.onnx", classes=classes, output=Tensor("o", shape)
    )
    save_catalogue({"own": own}, folder)
    return path


@pytest.mark.slow
def test_what_differs_in_a_detector_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = detector_of(tmp_path, ("buoy", "-", "vessel"), 2100)
    assert main(["models", "check", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "warning  no class person: people are not seen, and a hull refuses it" in printed
    assert "warning  no class pier" in printed
    assert "classes in the order buoy, vessel, the shipped one has person, vessel, pier, buoy" in printed
    assert "1 of its classes are left out" in printed
    assert "2100 candidates, strides 8, 16, 32 of 416x320 pixels give 2730" in printed


@pytest.mark.slow
def test_nothing_differs_in_the_shipped_detector(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["models", "check", str(verified_path("detector"))]) == 0
    printed = capsys.readouterr().out
    assert "warning" not in printed
    assert "candidates" not in printed


@pytest.mark.slow
def test_a_detector_without_people_is_warned_of_and_refused_on_a_hull(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    blind = str(detector_of(tmp_path, ("vessel", "buoy")))
    for profile, detector, refused, warned in (
        ("paani", "", False, False),
        ("paani", blind, False, True),
        ("hull", "", False, False),
        ("hull", blind, True, False),
    ):
        caplog.clear()
        caplog.set_level(logging.WARNING)
        sets = ["camera.source=webcam"] if profile == "hull" else []
        config = load_config(sets=[f"profile={profile}", *sets, f"perception.detector={detector}"])
        eyes = Perceiver(config.perception, stopwatch_ms)
        if refused:
            with pytest.raises(UserError, match=r"perception\.detector .*own\.onnx: has no class person; a hull needs"):
                require_people_seen(eyes, config)
        else:
            require_people_seen(eyes, config)
        assert ("people are not seen" in caplog.text) == warned


@pytest.mark.slow
def test_a_copy_of_the_shipped_model_scores_as_shipped(tmp_path: Path) -> None:
    shutil.copy(verified_path("segmenter"), tmp_path / "copy.onnx")
    own = Perceiver(PerceptionConfig(segmenter=str(tmp_path / "copy.onnx")), stopwatch_ms)
    shipped = Perceiver(PerceptionConfig(), stopwatch_ms)
    one, other = (eyes.perceive(river(), HEADER, 0.0)[0] for eyes in (own, shipped))
    assert (one.left, one.center, one.right) == (other.left, other.center, other.right)


@pytest.mark.parametrize(
    ("shape", "kind"), [([1, 3, 256, 320], TensorProto.FLOAT), ([1, 3, 320, 416], TensorProto.UINT8)]
)
def test_b7_c1_a_file_that_differs_in_its_input_alone_is_refused(tmp_path: Path, shape: list[int], kind: int) -> None:
    path, answer = tmp_path / "own.onnx", np.zeros((1, 8, 2730), np.float32)
    node = helper.make_node("Constant", [], ["output"], value=numpy_helper.from_array(answer))
    ends = [helper.make_tensor_value_info(*end) for end in (("input", kind, shape), ("output", 1, answer.shape))]
    graph = helper.make_graph([node], "own", ends[:1], ends[1:])
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), str(path))
    with pytest.raises(UserError, match="detector must have"):
        OnnxEngine.load("detector", str(path), 1)


@pytest.mark.slow
def test_c11_masks_beside_the_candidates_are_left_alone(tmp_path: Path) -> None:
    """An export with instance masks has a second output."""
    path, masks = tmp_path / "own.onnx", np.zeros((1, 32, 80, 104), np.float32)
    answer = np.concatenate([np.full((1, 4, 2730), 150.0), np.zeros((1, 4, 2730))], 1)
    save(path, answer.astype(np.float32), [1, 3, 320, 416])
    model = onnx.load(str(path))
    model.graph.node.append(helper.make_node("Constant", [], ["masks"], value=numpy_helper.from_array(masks)))
    model.graph.output.append(helper.make_tensor_value_info("masks", TensorProto.FLOAT, masks.shape))
    onnx.save(model, str(path))
    evidence, _ = Perceiver(PerceptionConfig(detector=str(path)), stopwatch_ms).perceive(river(), HEADER, 0.0)
    assert (evidence.usable, evidence.detections) == (True, ())
    findings = inspect_model(path, "detector")
    assert Finding("warning", "2 outputs, of which the first alone is read") in findings
    assert [finding.text for finding in findings if finding.level == "error"] == []
