"""The shipped model files: contract, checksum, and what they say to a picture that shows nothing."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from paani.errors import UserError
from paani_models.catalogue import OPEN_WEIGHTS, PAPER_WEIGHTS, WEIGHTS, load_catalogue, verified_path
from paani_models.commands.models import main
from paani_models.datasets.terms import OPEN_LICENCE, OPEN_TERMS, states_open_terms
from paani_models.detector.exported import open_detector
from paani_models.engines.onnx_runner import open_network
from paani_models.network_input import segmenter_input
from paani_models.training.augment import draw_null_picture

onnx = pytest.importorskip("onnx", reason="needs the extra paani[train]")

SHAPES = {
    "segmenter": ((1, 3, 256, 320), (1, 3, 256, 320)),
    "detector": ((1, 3, 320, 416), (1, 8, 2730)),
}
WATER = 0


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    return Path(shutil.copytree(WEIGHTS, tmp_path / "weights"))


def test_both_models_are_shipped_with_their_class_orders_c2_d6() -> None:
    catalogue = load_catalogue()
    assert set(catalogue) == {"segmenter", "detector", "gate"}
    assert catalogue["segmenter"].classes == ("water", "obstacle", "sky")
    assert catalogue["detector"].classes == ("person", "vessel", "pier", "buoy")


def test_the_open_set_has_the_same_contracts_but_for_the_detectors_size_and_learnt_from_what_anyone_may_use() -> None:
    shipped, chosen = load_catalogue(), load_catalogue(OPEN_WEIGHTS)
    assert set(chosen) == {"segmenter", "detector"}
    assert [chosen["detector"].size_hw, shipped["detector"].size_hw] == [(256, 320), (320, 416)]
    for name, model in chosen.items():
        sized = ("input", "output") if name == "segmenter" else ()
        same = ("file", "classes", "preprocessing", "parameters", *sized)
        assert [getattr(model, field) for field in same] == [getattr(shipped[name], field) for field in same]
        assert model.licence == OPEN_LICENCE != shipped[name].licence
        assert {origin.name for origin in model.origins} <= set(OPEN_TERMS)
        assert all(states_open_terms(origin.licence, OPEN_TERMS[origin.name]) for origin in model.origins)
        assert verified_path(name, OPEN_WEIGHTS).stat().st_size == model.size_bytes


def test_the_paper_set_has_the_papers_networks_in_the_shipped_ones_roles() -> None:
    parameters = {"segmenter": 1_082_467, "detector": 2_582_932}  # D9, C12
    shipped, chosen = load_catalogue(), load_catalogue(PAPER_WEIGHTS)
    assert set(chosen) == {"segmenter", "detector"}
    for name, model in chosen.items():
        assert (model.classes, model.preprocessing) == (shipped[name].classes, shipped[name].preprocessing)
        assert model.parameters == parameters[name]
        assert verified_path(name, PAPER_WEIGHTS).stat().st_size == model.size_bytes


@pytest.mark.parametrize("name", SHAPES)
def test_files_are_static_float32_opset_17_t1_c1_c4_d5(name: str) -> None:
    graph = onnx.load(str(verified_path(name)))
    assert [o.version for o in graph.opset_import if not o.domain] == [17]
    model = load_catalogue()[name]
    for value, tensor, shape in zip(
        (*graph.graph.input, *graph.graph.output),
        (model.input, model.output),
        SHAPES[name],
        strict=True,
    ):
        assert value.type.tensor_type.elem_type == onnx.TensorProto.FLOAT
        assert tuple(d.dim_value for d in value.type.tensor_type.shape.dim) == shape == tensor.shape
        assert value.name == tensor.name


@pytest.mark.parametrize("folder", [WEIGHTS, OPEN_WEIGHTS, PAPER_WEIGHTS], ids=["full", "open", "paper"])
def test_the_segmenter_of_each_set_has_the_papers_contract_d5_d6_d7(folder: Path) -> None:
    model, graph = load_catalogue(folder)["segmenter"], onnx.load(str(verified_path("segmenter", folder))).graph
    for value in (*graph.input, *graph.output):
        assert tuple(d.dim_value for d in value.type.tensor_type.shape.dim) == SHAPES["segmenter"][0]
    assert (model.input.shape, model.output.shape) == SHAPES["segmenter"]
    assert model.classes == ("water", "obstacle", "sky")
    assert model.preprocessing.mean == (0.485, 0.456, 0.406)
    assert model.preprocessing.std == (0.229, 0.224, 0.225)


def test_the_training_normalises_as_the_board_does_d7() -> None:
    picture = np.full((240, 320, 3), (200, 20, 10), np.uint8)
    expected = [(200 / 255 - 0.485) / 0.229, (20 / 255 - 0.456) / 0.224, (10 / 255 - 0.406) / 0.225]
    assert segmenter_input(picture)[0, :, 128, 160] == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("name", SHAPES)
def test_export_stays_within_tolerance_t2(name: str) -> None:
    assert 0.0 < load_catalogue()[name].export_max_abs_diff <= 1e-3


@pytest.mark.parametrize("name", SHAPES)
def test_a_corrupt_file_is_named(copied: Path, name: str) -> None:
    path = copied / f"{name}.onnx"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(UserError, match=rf"{name}\.onnx: corrupt"):
        verified_path(name, copied)


def test_a_missing_file_is_named(copied: Path) -> None:
    (copied / "segmenter.onnx").unlink()
    with pytest.raises(UserError, match=r"segmenter\.onnx: No such file"):
        verified_path("segmenter", copied)


@pytest.mark.parametrize("text", ["", "{", '{"models":[{"name":"x"}]}', '{"models":[],"more":1}'])
def test_a_malformed_manifest_is_named(copied: Path, text: str) -> None:
    (copied / "manifest.json").write_text(text)
    with pytest.raises(UserError, match=r"manifest\.json"):
        load_catalogue(copied)


def test_an_unknown_model_is_named() -> None:
    with pytest.raises(UserError, match="'radar'"):
        verified_path("radar")


@pytest.mark.slow
def test_check_command_needs_no_torch(capsys: pytest.CaptureFixture[str], copied: Path) -> None:
    assert main(["check"]) == 0
    assert "open segmenter: segmenter.onnx" in capsys.readouterr().out
    assert main(["check", "--weights", str(copied)]) == 0
    assert "1362395 parameters, ok" in capsys.readouterr().out
    (copied / "detector.onnx").write_bytes(b"not a net")
    assert main(["check", "--weights", str(copied)]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert "detector.onnx" in captured.err


def nothing(kind: str) -> np.ndarray:
    rng = np.random.default_rng(7)
    flat = {
        "black": (0, 0, 0),
        "white": (255, 255, 255),
        "grey": (128, 128, 128),
        "brown lens cap": (60, 40, 25),
    }
    if kind == "noise":
        return rng.integers(0, 256, (240, 320, 3)).astype(np.uint8)
    picture = np.full((240, 320, 3), flat[kind.removeprefix("noisy ")], np.float32)
    if kind.startswith("noisy "):
        picture += rng.normal(0, 6, picture.shape)
    return np.clip(picture, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("kind", ["black", "noisy black", "white", "grey", "noisy grey", "noise", "brown lens cap"])
@pytest.mark.slow
def test_nothing_to_see_is_never_water_v15(kind: str) -> None:
    """The paper's own failure: a black picture read as open water."""
    label = open_network(verified_path("segmenter"), threads=1)(segmenter_input(nothing(kind)))[0].argmax(0)
    assert (label == WATER).mean() < 0.02


@pytest.mark.slow
def test_null_pictures_hold_no_object_above_the_boards_threshold_c6() -> None:
    net = open_detector(verified_path("detector"), threads=1)
    top = max(
        net.run(net.prepare(draw_null_picture(np.random.default_rng(s), (320, 256))))[0, 4:].max() for s in range(20)
    )
    assert top < 0.40
