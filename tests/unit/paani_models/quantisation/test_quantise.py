"""INT8: what equalisation mends, what calibration may see, what goes blind, and the acceptance rule (T4 - T6, V10)."""

from __future__ import annotations

import logging
import math
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from paani_models.quantisation.acceptance import Timing

onnx = pytest.importorskip("onnx", reason="needs the extra paani[train]")

from onnx import TensorProto, helper, numpy_helper  # noqa: E402

from paani import messages as m  # noqa: E402
from paani.arrays import F32  # noqa: E402
from paani.clock import stopwatch_ms  # noqa: E402
from paani.config import PerceptionConfig  # noqa: E402
from paani.errors import UserError  # noqa: E402
from paani_models.catalogue import verified_path  # noqa: E402
from paani_models.commands.models import data_folder, main  # noqa: E402
from paani_models.datasets.sources import Sample, Source  # noqa: E402
from paani_models.engines.onnx_runner import open_network  # noqa: E402
from paani_models.network_input import detector_input, segmenter_input  # noqa: E402
from paani_models.quantisation.acceptance import QuantisationRecord, decide_acceptance, largest_score, time_networks  # noqa: E402
from paani_models.quantisation.calibration_pictures import (  # noqa: E402
    CALIBRATION_PICTURES,
    choose_calibration_samples,
    hash_sample_names,
)
from paani_models.quantisation.equalisation import equalise_layers  # noqa: E402
from paani_models.quantisation.quantise import PAPER, RECIPES, find_decoding_steps, quantise_network  # noqa: E402
from paani_services.perception.pipeline import Perceiver  # noqa: E402
from tests.pictures import PICTURES as DRAWN  # noqa: E402
from tests.pictures import river  # noqa: E402

pytestmark = pytest.mark.train

SHAPE = (1, 3, 16, 16)


def conv(name: str, source: str, groups: int = 1, kernel: int = 1) -> Any:
    return helper.make_node(
        "Conv",
        [source, f"{name}.w", f"{name}.b"],
        [name],
        name=name,
        group=groups,
        kernel_shape=[kernel, kernel],
        pads=[kernel // 2] * 4,
    )


def small_net(path: Path, seed: int = 0, spread: float = 1.0) -> None:
    """Expand, depthwise, project, and a second path that is added, then a head.

    spread: the same function, but each hidden channel's weights are scaled by a random factor of 1/spread..spread on
    one side and by its inverse on the other, as training with batch norm leaves them.
    """
    rng = np.random.default_rng(seed)
    factors = np.exp(rng.uniform(-np.log(spread), np.log(spread), (3, 8))).astype(np.float32)
    expand = rng.normal(size=(8, 3, 1, 1)).astype(np.float32)
    deep = rng.normal(size=(8, 1, 3, 3)).astype(np.float32) / 3
    project = rng.normal(size=(8, 8, 1, 1)).astype(np.float32) / 3
    lateral = rng.normal(size=(8, 3, 1, 1)).astype(np.float32)
    head = rng.normal(size=(3, 8, 1, 1)).astype(np.float32)
    column = factors[..., None, None, None]
    weights = {
        "expand": (expand * column[0], rng.normal(size=8) * factors[0]),
        "deep": (deep * column[1] / column[0], rng.normal(size=8) * factors[1]),
        "project": (project * column[2] / factors[1][None, :, None, None], rng.normal(size=8) * factors[2]),
        "lateral": (lateral * column[2], rng.normal(size=8) * factors[2]),
        "head": (head / factors[2][None, :, None, None], rng.normal(size=3)),
    }
    nodes = [
        conv("expand", "input"),
        helper.make_node("Relu", ["expand"], ["e"], name="relu1"),
        conv("deep", "e", groups=8, kernel=3),
        helper.make_node("Relu", ["deep"], ["d"], name="relu2"),
        conv("project", "d"),
        conv("lateral", "input"),
        helper.make_node("Add", ["project", "lateral"], ["sum"], name="add"),
        helper.make_node("Relu", ["sum"], ["s"], name="relu3"),
        conv("head", "s"),
    ]
    stored = [
        numpy_helper.from_array(np.ascontiguousarray(value, np.float32), f"{name}.{part}")
        for name, pair in weights.items()
        for part, value in zip("wb", pair, strict=True)
    ]
    graph = helper.make_graph(
        nodes,
        "small",
        [helper.make_tensor_value_info("input", TensorProto.FLOAT, SHAPE)],
        [helper.make_tensor_value_info("head", TensorProto.FLOAT, SHAPE)],
        stored,
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), str(path))


def inputs(count: int) -> list[F32]:
    rng = np.random.default_rng(5)
    return [rng.normal(size=SHAPE).astype(np.float32) for _ in range(count)]


def error(net: Path, truth: Path) -> float:
    """Mean difference, as a share of the truth's deviation."""
    one, other = open_network(net, 1), open_network(truth, 1)
    pairs = [(one(x), other(x)) for x in inputs(4)]
    return float(np.mean([np.abs(a - b).mean() / b.std() for a, b in pairs]))


def test_equalisation_changes_no_answer_and_evens_the_channels(tmp_path: Path) -> None:
    small_net(tmp_path / "even.onnx")
    small_net(tmp_path / "net.onnx", spread=16.0)
    assert error(tmp_path / "net.onnx", tmp_path / "even.onnx") < 1e-5
    model = onnx.load(str(tmp_path / "net.onnx"))
    assert equalise_layers(model) == 3
    onnx.save(model, str(tmp_path / "equal.onnx"))
    assert error(tmp_path / "equal.onnx", tmp_path / "even.onnx") < 1e-5
    widths = {}
    for name, file in (("before", "net.onnx"), ("after", "equal.onnx")):
        weights = {t.name: numpy_helper.to_array(t) for t in onnx.load(str(tmp_path / file)).graph.initializer}
        largest = np.abs(weights["expand.w"]).max((1, 2, 3))
        widths[name] = float(largest.max() / largest.min())
    assert widths["after"] < 0.2 * widths["before"]


def test_equalisation_leaves_what_a_factor_cannot_pass(tmp_path: Path) -> None:
    """A sigmoid between two convolutions closes the group; so does the network's own output."""
    small_net(tmp_path / "net.onnx", spread=16.0)
    model = onnx.load(str(tmp_path / "net.onnx"))
    for node in model.graph.node:
        if node.op_type == "Relu":
            node.op_type = "Sigmoid"
    before = [t.SerializeToString() for t in model.graph.initializer]
    assert equalise_layers(model) == 0
    assert [t.SerializeToString() for t in model.graph.initializer] == before


def test_per_tensor_quantisation_fails_on_uneven_channels_and_equalisation_repairs_it_t4_v10(tmp_path: Path) -> None:
    """The mechanism behind the paper's collapse: the same function, the same recipe, other scales inside."""
    small_net(tmp_path / "even.onnx")
    small_net(tmp_path / "net.onnx", spread=16.0)
    quantise_network(tmp_path / "even.onnx", tmp_path / "even8.onnx", PAPER, inputs(8))
    quantise_network(tmp_path / "net.onnx", tmp_path / "paper8.onnx", PAPER, inputs(8))
    model = onnx.load(str(tmp_path / "net.onnx"))
    equalise_layers(model)
    onnx.save(model, str(tmp_path / "equal.onnx"))
    quantise_network(tmp_path / "equal.onnx", tmp_path / "equal8.onnx", PAPER, inputs(8))
    even, paper, equal = (
        error(tmp_path / f"{name}8.onnx", tmp_path / "even.onnx") for name in ("even", "paper", "equal")
    )
    assert paper > 3.0 * even
    assert equal < 1.5 * even
    assert not list(tmp_path.glob("*.partial"))


def test_the_papers_recipe_is_signed_per_tensor_qdq_t4(tmp_path: Path) -> None:
    assert CALIBRATION_PICTURES == 200
    small_net(tmp_path / "net.onnx")
    quantise_network(tmp_path / "net.onnx", tmp_path / "net8.onnx", RECIPES["paper"]["segmenter"], inputs(4))
    model = onnx.load(str(tmp_path / "net8.onnx"))
    stored = {t.name: t for t in model.graph.initializer}
    steps = [node for node in model.graph.node if node.op_type in ("QuantizeLinear", "DequantizeLinear")]
    assert {node.op_type for node in steps} == {"QuantizeLinear", "DequantizeLinear"}
    assert all(list(stored[node.input[1]].dims) in ([], [1]) for node in steps), "one scale per tensor"
    zero_types = {stored[node.input[2]].data_type for node in steps}
    assert zero_types <= {TensorProto.INT8, TensorProto.INT32}, "biases are 32 bits wide"


@pytest.mark.slow
def test_t4_the_input_is_scaled_by_the_least_and_the_greatest_of_all_calibration_pictures(tmp_path: Path) -> None:
    """The last of 200 has both."""
    small_net(tmp_path / "net.onnx")
    samples = inputs(200)
    samples[-1] = samples[-1] * np.float32(8.0)
    quantise_network(tmp_path / "net.onnx", tmp_path / "net8.onnx", PAPER, samples)
    graph = onnx.load(str(tmp_path / "net8.onnx")).graph
    stored = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    [first] = [node for node in graph.node if node.op_type == "QuantizeLinear" and node.input[0] == "input"]
    widest = max(sample.max() for sample in samples) - min(sample.min() for sample in samples)
    assert float(stored[first.input[1]]) == pytest.approx(widest / 255, rel=1e-4)


@pytest.mark.rotating(cpu_s=4)
def test_a_fully_quantised_detector_goes_blind_and_is_rejected(tmp_path: Path) -> None:
    """Boxes up to 320 and scores up to 1 share one step, of more than 1: scores are 0, or no scores."""
    net, samples = verified_path("detector"), [detector_input(river(seed), (416, 320)) for seed in range(3)]
    quantise_network(net, tmp_path / "detector.onnx", RECIPES["paper"]["detector"], samples)
    blind, seeing = largest_score(tmp_path / "detector.onnx", samples), largest_score(net, samples)
    assert blind == 0.0 or blind > 1.0
    assert 0.0 < seeing < 1.0
    decision = decide_acceptance(0.0, 0.5, for_size=True, largest_score=blind, float_largest_score=seeing)
    assert not decision.accepted
    assert decision.reason.startswith("blind: best score")


@pytest.mark.rotating(cpu_s=10)
def test_with_its_decoding_in_float_the_detector_sees(tmp_path: Path) -> None:
    net, samples = verified_path("detector"), [detector_input(river(seed), (416, 320)) for seed in range(3)]
    quantise_network(net, tmp_path / "detector.onnx", RECIPES["equalised"]["detector"], samples)
    assert largest_score(tmp_path / "detector.onnx", samples) > 0.5 * largest_score(net, samples)
    quantised = onnx.load(str(tmp_path / "detector.onnx"))
    fed = {name: node for node in quantised.graph.node for name in node.output}
    for output in [node for node in quantised.graph.node if node.name in find_decoding_steps(onnx.load(str(net)))]:
        assert all(fed[name].op_type != "DequantizeLinear" for name in output.input[1:] if name in fed)


@pytest.mark.rotating(cpu_s=6)
def test_a_quantised_segmenter_is_checked_and_perceives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """It takes and gives floats like any other, so the check lets it pass and perception runs it."""
    samples = [segmenter_input(picture[..., ::-1]) for picture in DRAWN.values()]
    own = tmp_path / "segmenter.onnx"
    quantise_network(verified_path("segmenter"), own, RECIPES["equalised"]["segmenter"], samples)
    logging.getLogger().warning("what others log afterwards, of pre-processing too, is kept")
    assert [record.message.split()[0] for record in caplog.records if record.name == "root"] == ["what"]
    assert main(["check", str(own)]) == 0
    assert "8-bit steps are rounded elsewhere" in capsys.readouterr().out
    header = m.PictureHeader(source_us=1, frame_seq=0, frame_epoch=0, width_px=320, height_px=240)
    seen = [
        Perceiver(PerceptionConfig(segmenter=file), stopwatch_ms).perceive(river(), header, 0.0)[0].center.non_water
        for file in (str(own), "")
    ]
    assert seen[0] == pytest.approx(seen[1], abs=0.05)


def test_decoding_reaches_past_the_expected_distance_to_the_last_convolutions(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch", reason="needs the extra paani[train]")
    from paani_models.detector.paper_network import Yolo11n  # noqa: PLC0415
    from paani_models.recipes.onnx_export import CONTRACTS, write_onnx  # noqa: PLC0415

    torch.manual_seed(0)
    write_onnx(Yolo11n(), CONTRACTS["yolo11n"], tmp_path / "net.onnx")
    model = onnx.load(str(tmp_path / "net.onnx"))
    kept = [node for node in model.graph.node if node.name in find_decoding_steps(model) and node.op_type == "Conv"]
    weights = {t.name: t.dims for t in model.graph.initializer}
    assert sorted(tuple(weights[node.input[1]])[:2] for node in kept if "bins" not in node.input[1]) == sorted(
        [(64, 64)] * 3 + [(4, 64)] * 3
    )
    assert sum("bins" in node.input[1] for node in kept) == 3


@pytest.mark.parametrize(
    ("loss", "ratio", "for_size", "accepted", "word"),
    [
        (0.3, 0.8, False, True, "loses 0.30 points"),
        (1.0, 1.0, False, True, "loses 1.00 points"),
        (1.01, 0.5, True, False, "more than 1"),
        (-0.2, 0.9, False, True, "gains 0.20"),
        (0.3, 1.2, False, False, "1.20 times as long"),
        (0.3, 1.2, True, True, "accepted for its size"),
        (math.nan, 0.5, True, False, "nan"),
        (0.0, math.nan, False, False, "nan"),
        (24.5, 1.53, False, False, "loses 24.50 points"),  # the paper's own: .9750 -> .7303, 6.969 -> 10.651 ms
    ],
)
def test_acceptance_decides_by_rule_and_says_why_t5(
    loss: float, ratio: float, for_size: bool, accepted: bool, word: str
) -> None:
    decision = decide_acceptance(loss, ratio, for_size=for_size)
    assert decision.accepted is accepted
    assert word in decision.reason
    assert decision.rule


def test_the_papers_own_int8_segmenter_is_rejected_v10() -> None:
    """V10, T5: by its mIoU of .730281 beside .975037, whether or not only its size matters."""
    for for_size in (False, True):
        verdict = decide_acceptance(100.0 * (0.975037 - 0.730281), 10.651 / 6.969, for_size=for_size, metric="mIoU")
        assert not verdict.accepted
        assert verdict.reason == "loses 24.48 points of mIoU, more than 1"


@pytest.mark.parametrize(("best", "word"), [(0.0, "0.000 where FP32 gives 0.900"), (1.65, "1.650 is no probability")])
def test_a_blind_net_is_rejected_whatever_its_other_figures(best: float, word: str) -> None:
    decision = decide_acceptance(0.0, 0.5, for_size=True, largest_score=best, float_largest_score=0.9)
    assert not decision.accepted
    assert word in decision.reason
    assert decide_acceptance(0.0, 0.5, for_size=False, largest_score=0.85, float_largest_score=0.9).accepted


def test_timing_runs_both_in_turn(tmp_path: Path) -> None:
    small_net(tmp_path / "net.onnx")
    ticks = iter(range(10_000))
    taken = time_networks(tmp_path / "net.onnx", tmp_path / "net.onnx", inputs(1)[0], lambda: float(next(ticks)), 1)
    assert (taken.float_ms, taken.int8_ms, taken.ratio) == (1.0, 1.0, 1.0)


def sample(name: str, sequence: str, held_out: bool, source: str = "river") -> Sample:
    return Sample(Source(source, source), sequence, held_out, Path("/pictures") / name, None, None)


def test_calibration_takes_200_sorted_training_pictures_t4() -> None:
    samples = [sample(f"{n:04}.jpg", "a", False) for n in reversed(range(500))] + [sample("0000a.jpg", "b", True)]
    first = choose_calibration_samples(samples, None, spread=False)
    assert [s.picture.name for s in first] == [f"{n:04}.jpg" for n in range(200)]
    spread = choose_calibration_samples(samples, None, spread=True)
    assert len(spread) == 200
    assert spread[-1].picture.name > "0390"
    assert hash_sample_names(first) != hash_sample_names(spread)
    drawn = [sample("0.jpg", "a", False, "rendered")]
    with pytest.raises(UserError, match="no training picture"):
        choose_calibration_samples(drawn, None, spread=False)


@pytest.mark.parametrize(
    "leaked", [sample("v.jpg", "b", True), sample("w.jpg", "b", False), sample("v.jpg", "c", False, "lake")]
)
def test_a_candidate_calibrated_on_validation_pictures_is_refused_t6(tmp_path: Path, leaked: Sample) -> None:
    """The picture itself, another of its sequence, or itself where another source trains on it."""
    samples = [sample("t.jpg", "a", False), sample("v.jpg", "b", True), leaked]
    listed = tmp_path / "list.txt"
    listed.write_text(f"/pictures/t.jpg\n{leaked.picture}\n")
    with pytest.raises(UserError, match=rf"{leaked.picture.name}: is held out"):
        choose_calibration_samples(samples, listed, spread=False)
    listed.write_text("/pictures/t.jpg\n/pictures/unknown.jpg\n")
    with pytest.raises(UserError, match=r"unknown\.jpg: not a picture of the chosen sources"):
        choose_calibration_samples(samples, listed, spread=False)


@pytest.mark.data
def test_quantise_command_writes_net_record_and_verdict_t5_t6(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On a small source: the paper's recipe collapses and is rejected; validation pictures are refused."""
    if not (data_folder() / "mastr1325_val_recovered").is_dir():
        pytest.skip("the annotated pictures are absent")
    words = ["quantise", "segmenter", "--sources", "mastr1325", "--out", str(tmp_path)]
    assert main([*words, "--recipe", "paper"]) == 1
    assert "rejected: loses" in capsys.readouterr().out
    record = msgspec.json.decode((tmp_path / "segmenter-paper.json").read_bytes(), type=QuantisationRecord)
    assert record.float_score - record.score > 0.05
    loss = float(record.verdict.reason.removeprefix("loses ").split()[0])
    assert loss == pytest.approx(100.0 * (record.float_score - record.score), abs=0.02)
    assert not record.verdict.accepted
    assert record.size_bytes < 0.4 * record.float_size_bytes
    assert (tmp_path / "segmenter-paper.onnx").stat().st_size == record.size_bytes
    held_out = sorted((data_folder() / "mastr1325_val_recovered" / "images").iterdir())[60]
    (tmp_path / "list.txt").write_text(f"{held_out}\n")
    assert main([*words, "--calibrate", str(tmp_path / "list.txt")]) == 2
    assert "is held out" in capsys.readouterr().err


def test_t5_the_times_are_told_as_int8_over_float() -> None:
    assert Timing(6.969, 10.651).ratio == pytest.approx(10.651 / 6.969)


def test_a_list_of_what_are_no_names_is_refused_in_one_line(tmp_path: Path) -> None:
    listed = tmp_path / "list.txt"
    listed.write_bytes(b"PK\x03\x04\x00\n")
    with pytest.raises(UserError, match=r"list\.txt: embedded null byte"):
        choose_calibration_samples([], listed, spread=False)
