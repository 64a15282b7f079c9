"""The other engine: what is written, what is refused, and that it answers as onnxruntime does."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import msgspec
import numpy as np
import pytest

from paani import messages as m
from paani.clock import stopwatch_ms
from paani.config import ImageQualityConfig, PerceptionConfig
from paani.errors import UserError
from paani_models.catalogue import file_sha256, load_catalogue, save_catalogue, verified_path
from paani_models.commands.models import data_folder, main
from paani_models.engines.contract_check import MAX_DIFFERENCE, synthetic_inputs
from paani_models.engines.ncnn_runner import ncnn_files, open_ncnn, verified_ncnn_files
from paani_models.engines.onnx_runner import open_network
from paani_services.perception.engine import OnnxEngine, check_onnxruntime, engine_class
from paani_services.perception.ncnn_engine import NcnnEngine
from paani_services.perception.pipeline import Perceiver
from tests.pictures import river

onnx = pytest.importorskip("onnx", reason="needs the extra paani[dev]")
pytest.importorskip("ncnn", reason="needs the extra paani[ncnn]")

from paani_models.engines.ncnn_convert import convert_to_ncnn, replace_strided_slices  # noqa: E402
from paani_models.engines.parity import measure_difference, prepare_inputs  # noqa: E402
from tests.unit.paani_models.engines.ncnn_networks import (  # noqa: E402
    CONVOLUTION,
    NO_BOXES,
    RESIZED,
    SHAPE,
    WATER_BIAS,
    focus_layer,
    packed,
    place,
    program,
    small_segmenter,
)

needs_pnnx = pytest.mark.skipif(shutil.which("pnnx") is None, reason="pnnx is not on the PATH")
HEADER = m.PictureHeader(source_us=1_000_000, frame_seq=7, frame_epoch=3, width_px=320, height_px=240)


@pytest.fixture
def segmenter(tmp_path: Path) -> Path:
    return place(small_segmenter(tmp_path / "segmenter.onnx"), CONVOLUTION, packed())


@pytest.fixture
def detector(tmp_path: Path) -> Path:
    return place(Path(shutil.copy(verified_path("detector"), tmp_path)), NO_BOXES, bytes(4 * 8 * 2730))


@pytest.mark.slow
def test_outputs_of_both_engines_agree(segmenter: Path) -> None:
    one, other = (engine_class(name).load("segmenter", str(segmenter), 1) for name in ("onnxruntime", "ncnn"))
    assert isinstance(one, OnnxEngine)
    assert isinstance(other, NcnnEngine)
    assert one.contract == other.contract
    for x in synthetic_inputs(one.contract).values():
        np.testing.assert_allclose(other.run(x), one.run(x), atol=MAX_DIFFERENCE)
    assert other.info() == f"{one.info()} ncnn"


@pytest.mark.slow
def test_a_picture_is_perceived_by_ncnn(segmenter: Path, detector: Path) -> None:
    anything = ImageQualityConfig(max_endless=1.0)  # this segmenter sees water everywhere, which is no boat's view
    config = PerceptionConfig(engine="ncnn", segmenter=str(segmenter), detector=str(detector), image_quality=anything)
    plain = msgspec.structs.replace(config, engine="onnxruntime", detector="")
    perceivers = [Perceiver(each, stopwatch_ms) for each in (config, plain)]
    found, expected = (perceiver.perceive(river(), HEADER, 0.1) for perceiver in perceivers)
    for perceiver in perceivers:
        perceiver.close()
    assert found[0].usable
    assert found[0].models.count(" ncnn") == 2
    for lane, same in zip((found[0].left, found[0].center), (expected[0].left, expected[0].center), strict=True):
        assert lane.non_water == pytest.approx(same.non_water, abs=1e-3)
        assert lane.uncertainty == pytest.approx(same.uncertainty, abs=1e-3)
    assert found[0].detections == ()
    np.testing.assert_array_equal(found[1], expected[1])


def test_of_a_net_that_ends_with_a_resize_the_cells_are_read(tmp_path: Path) -> None:
    model = place(small_segmenter(tmp_path / "own.onnx"), RESIZED, packed())
    x = np.random.default_rng(2).standard_normal(SHAPE).astype(np.float32)
    cells, whole = NcnnEngine.load("segmenter", str(model), 1).run(x), open_ncnn(ncnn_files(model), 1)(x)
    np.testing.assert_allclose(cells, open_network(model, 1)(x)[:, :, ::4, ::4], atol=MAX_DIFFERENCE)
    assert (cells.shape, whole.shape) == ((1, 3, 64, 80), tuple(SHAPE))
    corners_stay = place(model, RESIZED.replace("6=0", "6=1"), packed())
    assert NcnnEngine.load("segmenter", str(corners_stay), 1).run(x).shape == tuple(SHAPE)


@needs_pnnx
def test_both_engines_read_the_same_cells_of_the_shipped_net(tmp_path: Path) -> None:
    contract = load_catalogue()["segmenter"]
    convert_to_ncnn(verified_path("segmenter"), "segmenter", tmp_path, None, prepare_inputs(contract, []))
    own = NcnnEngine.load("segmenter", str(tmp_path / contract.file), 1)
    shipped = OnnxEngine.load("segmenter", "", 1)
    for x in synthetic_inputs(contract).values():
        cells = shipped.run(x)
        assert cells.shape == (1, 3, 64, 80)
        np.testing.assert_allclose(own.run(x), cells, atol=MAX_DIFFERENCE)


def test_missing_files_name_file_and_command(tmp_path: Path) -> None:
    model = Path(shutil.copy(verified_path("detector"), tmp_path))
    with pytest.raises(UserError, match="missing; make it with: paani models convert") as error:
        Perceiver(PerceptionConfig(engine="ncnn", detector=str(model)), stopwatch_ms)
    assert str(tmp_path / "detector.ncnn.param") in str(error.value)
    assert str(model) in str(error.value)


@pytest.mark.parametrize("ending", ["param", "bin", "json"])
def test_each_of_the_three_files_is_needed_and_whole(segmenter: Path, ending: str) -> None:
    """ncnn itself ends the process on some damaged files, so they are refused before it reads them."""
    path = segmenter.with_suffix(f".ncnn.{ending}")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(UserError, match=path.name):
        NcnnEngine.load("segmenter", str(segmenter), 1)
    path.unlink()
    with pytest.raises(UserError, match=f"{path.name}: missing"):
        NcnnEngine.load("segmenter", str(segmenter), 1)


def test_files_of_another_model_are_refused(segmenter: Path) -> None:
    shutil.copy(verified_path("segmenter"), segmenter)
    with pytest.raises(UserError, match=r"made from another segmenter\.onnx"):
        NcnnEngine.load("segmenter", str(segmenter), 1)


@pytest.mark.parametrize(
    ("param", "weights", "message"),
    [
        ("no net\n", b"", "not a net that ncnn"),
        (CONVOLUTION.replace("Convolution", "Tensor.slice"), packed(), "not a net that ncnn"),
        (CONVOLUTION, packed()[:20], "not the weights of"),
        (CONVOLUTION.replace("out0", "out1"), packed(), "does not run from in0 to out0"),
        (CONVOLUTION.replace("in0", "picture"), packed(), "does not run from in0 to out0"),
        (NO_BOXES, bytes(4 * 8 * 2730), "must give"),
    ],
    ids=["text", "layer", "weights", "output", "input", "shape"],
)
def test_files_that_ncnn_cannot_use_are_named(tmp_path: Path, param: str, weights: bytes, message: str) -> None:
    model = place(small_segmenter(tmp_path / "own.onnx"), param, weights)
    with pytest.raises(UserError, match=message) as error:
        NcnnEngine.load("segmenter", str(model), 1)
    assert "own.ncnn." in str(error.value)


def test_a_model_that_takes_bytes_is_for_onnxruntime(segmenter: Path) -> None:
    shipped = load_catalogue()["segmenter"]
    taken = msgspec.structs.replace(shipped.input, shape=(1, 256, 320, 3), dtype="uint8")
    save_catalogue({"segmenter": msgspec.structs.replace(shipped, input=taken)}, segmenter.parent)
    with pytest.raises(UserError, match="ncnn runs float32 models alone"):
        NcnnEngine.load("segmenter", str(segmenter), 1)


@pytest.mark.parametrize("release", ["1.21.0", "1.21", "1.21.1", "1.21.0.dev20250301"])
def test_onnxruntime_1_21_is_refused_with_the_reason(release: str) -> None:
    with pytest.raises(UserError, match=rf"onnxruntime {release}: .*illegal instruction.*Cortex-A53"):
        check_onnxruntime(release)


@pytest.mark.parametrize("release", ["1.20.1", "1.22.0", "1.31.1", "1.210.0", "2.1.21", ""])
def test_other_releases_of_onnxruntime_run(release: str) -> None:
    check_onnxruntime(release)


@pytest.mark.slow
@pytest.mark.usefixtures("without_data")
def test_convert_writes_what_the_engine_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source, out = small_segmenter(tmp_path / "own.onnx"), tmp_path / "out"
    words = ["convert", str(source), "--pnnx", str(program(tmp_path)), "--out", str(out)]
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert "differ by at most" in printed
    assert f"--set perception.engine=ncnn --set perception.segmenter={out / 'own.onnx'}" in printed
    names = ["manifest.json", "own.ncnn.bin", "own.ncnn.json", "own.ncnn.param", "own.onnx"]
    assert sorted(path.name for path in out.iterdir()) == names
    assert NcnnEngine.load("segmenter", str(out / "own.onnx"), 1).contract.sha256 == file_sha256(source)
    assert not (tmp_path / "litter.py").exists()


@pytest.mark.parametrize(
    ("param", "weights", "code", "message"),
    [
        (CONVOLUTION, packed(), 3, "failed on own.onnx: a last word"),
        (CONVOLUTION.replace("Convolution", "Tensor.slice"), packed(), 0, "own.onnx: ncnn has no Tensor.slice"),
        (CONVOLUTION, packed(WATER_BIAS + 0.002), 0, "answers differ by 2.0e-03"),
        (CONVOLUTION, packed(WATER_BIAS * np.float32(np.nan)), 0, "answers differ by inf"),
        (NO_BOXES, bytes(4 * 8 * 2730), 0, "answers differ by inf"),
    ],
    ids=["failure", "layer", "difference", "not finite", "shape"],
)
@pytest.mark.slow
@pytest.mark.usefixtures("without_data")
def test_a_bad_conversion_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], param: str, weights: bytes, code: int, message: str
) -> None:
    source, out = small_segmenter(tmp_path / "own.onnx"), tmp_path / "out"
    pnnx = program(tmp_path, param, weights, code)
    assert main(["convert", str(source), "--pnnx", str(pnnx), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.startswith("paani models: ")
    assert error.count("\n") == 1
    assert not out.exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["own.onnx", "pnnx"]


@pytest.mark.slow
@pytest.mark.usefixtures("without_data")
def test_a_missing_pnnx_is_reported_with_its_remedy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    source = small_segmenter(tmp_path / "own.onnx")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert main(["convert", str(source)]) == 2
    assert "pip install --no-deps pnnx" in capsys.readouterr().err
    assert main(["convert", str(source), "--pnnx", "no/pnnx"]) == 2
    assert capsys.readouterr().err == "paani models: --pnnx no/pnnx: no such program\n"


def test_replacing_strided_slices_changes_no_bit(tmp_path: Path) -> None:
    source = focus_layer(tmp_path / "focus.onnx")
    model = replace_strided_slices(onnx.load(str(source)))
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, str(tmp_path / "joined.onnx"))
    x = np.random.default_rng(0).random(SHAPE, np.float32)
    np.testing.assert_array_equal(open_network(tmp_path / "joined.onnx", 1)(x), open_network(source, 1)(x))
    assert [node.op_type for node in model.graph.node] == ["Conv"]


@needs_pnnx
@pytest.mark.parametrize("name", ["detector", "segmenter"])
def test_the_shipped_nets_convert(tmp_path: Path, name: str) -> None:
    contract = load_catalogue()[name]
    record = convert_to_ncnn(verified_path(name), name, tmp_path, None, prepare_inputs(contract, []))
    assert 0.0 < record.max_difference <= MAX_DIFFERENCE
    assert verified_ncnn_files(tmp_path / contract.file).bin.stat().st_size < 1.05 * contract.size_bytes


@needs_pnnx
@pytest.mark.data
@pytest.mark.skipif(not data_folder().is_dir(), reason="needs the annotated pictures")
@pytest.mark.parametrize("name", ["detector", "segmenter"])
def test_both_engines_agree_on_real_pictures(tmp_path: Path, name: str) -> None:
    contract = load_catalogue()[name]
    pictures = sorted(path for path in data_folder().rglob("*.jpg") if os.access(path, os.R_OK))
    inputs = prepare_inputs(contract, pictures)
    assert len(inputs) > len(synthetic_inputs(contract))
    convert_to_ncnn(verified_path(name), name, tmp_path, None, inputs)
    model = tmp_path / contract.file
    assert measure_difference(model, ncnn_files(model), name, contract, inputs) <= MAX_DIFFERENCE


def test_open_ncnn_runs_with_more_threads(segmenter: Path) -> None:
    x = np.ones(SHAPE, np.float32)
    one, two = (open_ncnn(ncnn_files(segmenter), threads)(x) for threads in (1, 2))
    np.testing.assert_allclose(one, two, atol=1e-6)
