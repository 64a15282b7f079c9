"""A network without its last resize: which resizes are left out, and what perception then reads of a user's own net."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import onnxruntime as ort
import pytest
from onnx import TensorProto, external_data_helper, helper, numpy_helper

from paani_models.catalogue import verified_path
from paani_models.engines.last_resize import drop_last_resize
from paani_services.perception.corridors import classify_cells
from paani_services.perception.engine import OnnxEngine

SHAPE = (1, 3, 256, 320)
HALF_PIXEL, ASYMMETRIC, CORNERS = "half_pixel", "asymmetric", "align_corners"


def ends_with(factor: int, *, mode: str = "nearest", place: str = ASYMMETRIC, after: str | None = None) -> bytes:
    """A network that averages its picture over cells, and resizes that; then `after`, if there is such a step."""
    pads = {"coordinate_transformation_mode": place, "mode": mode, "nearest_mode": "floor"}
    last = "resized" if after else "logits"
    nodes = [
        helper.make_node("AveragePool", ["input"], ["cells"], kernel_shape=[factor] * 2, strides=[factor] * 2),
        helper.make_node("Resize", ["cells", "", "scales"], [last], **pads),
        *([helper.make_node(after, [last], ["logits"])] if after else []),
    ]
    graph = helper.make_graph(
        nodes,
        "own",
        [helper.make_tensor_value_info("input", TensorProto.FLOAT, SHAPE)],
        [helper.make_tensor_value_info("logits", TensorProto.FLOAT, SHAPE)],
        [numpy_helper.from_array(np.array([1, 1, factor, factor], np.float32), "scales")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return bytes(model.SerializeToString())


def answer(model: bytes, picture: np.ndarray) -> np.ndarray:
    session = ort.InferenceSession(model, providers=["CPUExecutionProvider"])
    return np.asarray(session.run(None, {"input": picture})[0])


def picture() -> np.ndarray:
    return np.random.default_rng(5).standard_normal(SHAPE).astype(np.float32)


@pytest.mark.parametrize(("mode", "place"), [("nearest", ASYMMETRIC), ("linear", HALF_PIXEL), ("nearest", HALF_PIXEL)])
def test_what_the_last_step_would_have_resized(mode: str, place: str) -> None:
    whole = ends_with(4, mode=mode, place=place)
    cut = drop_last_resize(whole)
    assert cut is not None
    expected = picture().reshape(1, 3, 64, 4, 80, 4).mean((3, 5))
    np.testing.assert_allclose(answer(cut, picture()), expected, atol=1e-6)


@pytest.mark.parametrize(
    "whole",
    [
        ends_with(4, mode="linear", place=CORNERS),
        ends_with(4, mode="cubic", place=HALF_PIXEL),
        ends_with(4, after="Neg"),
    ],
    ids=["corners stay", "cubic", "a step behind it"],
)
def test_other_last_steps_stay(whole: bytes) -> None:
    assert drop_last_resize(whole) is None


def test_the_detector_has_none() -> None:
    assert drop_last_resize(verified_path("detector").read_bytes()) is None


@pytest.mark.parametrize("model", [b"", b"\x08\x07torn", b"\x3a\xff", b"\x3a\x7f", b"\x80", ends_with(4)[:-9]])
def test_bytes_that_are_no_model_have_none(model: bytes) -> None:
    assert drop_last_resize(model) is None


@pytest.mark.parametrize(
    ("own", "cells"),
    [
        (ends_with(4), (1, 3, 64, 80)),
        (ends_with(4, mode="linear", place=HALF_PIXEL), (1, 3, 64, 80)),
        (ends_with(8), SHAPE),
        (ends_with(4, after="Neg"), SHAPE),
    ],
    ids=["nearest", "bilinear", "eightfold", "a step behind it"],
)
def test_perception_reads_each_cell_of_a_users_net_at_its_middle(
    own: bytes, cells: tuple[int, ...], tmp_path: Path
) -> None:
    """Whatever the last step is, the mask has 64x80 cells, and each is the class that the whole answer has there."""
    path = tmp_path / "own.onnx"
    path.write_bytes(own)
    scores = OnnxEngine.load("segmenter", str(path), 1).run(picture())
    assert scores.shape == cells
    mask, _ = classify_cells(scores, 1.0)
    whole = OnnxEngine.load("segmenter", str(path), 1, full_size=True).run(picture())
    assert whole.shape == SHAPE
    middles = (whole[:, :, 1::4] + whole[:, :, 2::4])[0]
    theirs = (middles[:, :, 1::4] + middles[:, :, 2::4]).argmax(0)
    assert mask.shape == (64, 80)
    assert (mask == theirs).mean() > 0.9


def test_a_net_whose_weights_lie_in_another_file_is_cut_as_well(tmp_path: Path) -> None:
    path = tmp_path / "own.onnx"
    own = onnx.load_from_string(ends_with(4))
    weights = numpy_helper.from_array(np.full((3, 3, 1, 1), 0.5, np.float32), "weights")
    external_data_helper.set_external_data(weights, "own.weights")
    own.graph.initializer.append(weights)
    own.graph.node.insert(0, helper.make_node("Conv", ["input", "weights"], ["mixed"]))
    own.graph.node[1].input[0] = "mixed"
    onnx.save(own, str(path))
    assert (tmp_path / "own.weights").stat().st_size == 36
    scores = OnnxEngine.load("segmenter", str(path), 1).run(picture())
    expected = 0.5 * picture().sum(1, keepdims=True).reshape(1, 1, 64, 4, 80, 4).mean((3, 5)).repeat(3, 1)
    np.testing.assert_allclose(scores, expected, atol=1e-5)
