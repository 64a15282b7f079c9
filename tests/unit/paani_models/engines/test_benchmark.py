"""Choice of the engine for a machine, and the cost of a frame."""

from __future__ import annotations

import shutil
from itertools import count
from pathlib import Path

import msgspec
import pytest

from paani.errors import UserError
from paani_models.catalogue import WEIGHTS, file_sha256, load_catalogue, save_catalogue, verified_path
from paani_models.commands.models import main
from paani_models.engines.benchmark import (
    PAPER_MULTIPLY_ADDS,
    Agreement,
    Case,
    EngineReport,
    TimingRow,
    choose_engine,
    measure_rounds,
    summarise_times,
)
from paani_models.engines.contract_check import MAX_DIFFERENCE

onnx = pytest.importorskip("onnx", reason="needs the extra paani[dev]")
pytest.importorskip("ncnn", reason="needs the extra paani[ncnn]")

from paani_models.engines.multiply_adds import count_multiply_adds  # noqa: E402
from tests.unit.paani_models.engines.ncnn_networks import CONVOLUTION, NO_BOXES, packed, place, small_segmenter  # noqa: E402


def test_multiply_adds_by_hand(tmp_path: Path) -> None:
    assert count_multiply_adds(small_segmenter(tmp_path / "own.onnx")) == 3 * 256 * 320 * 3


@pytest.mark.slow
def test_a_frame_costs_less_than_two_thirds_of_the_papers_pair() -> None:
    total = sum(count_multiply_adds(verified_path(role)) or 1e9 for role in PAPER_MULTIPLY_ADDS)
    assert total < 2 / 3 * sum(PAPER_MULTIPLY_ADDS.values())


def test_multiply_adds_need_a_readable_static_net(tmp_path: Path) -> None:
    model = onnx.load(str(small_segmenter(tmp_path / "own.onnx")))
    for value in (*model.graph.input, *model.graph.output):
        value.type.tensor_type.shape.dim[2].dim_param = "rows"
    onnx.save(model, str(tmp_path / "own.onnx"))
    assert count_multiply_adds(tmp_path / "own.onnx") is None
    del model.opset_import[:]
    for content in (b"no net", model.SerializeToString()):
        (tmp_path / "own.onnx").write_bytes(content)
        with pytest.raises(UserError, match=r"own\.onnx"):
            count_multiply_adds(tmp_path / "own.onnx")


def timed(**pair_ms: float) -> list[TimingRow]:
    """`ncnn_2=40`: both networks by ncnn with two threads, half of it each."""
    return [
        TimingRow(engine, net, int(threads), took / 2, took / 2, took, 9)
        for name, took in pair_ms.items()
        for engine, threads in [name.split("_")]
        for net in ("detector", "segmenter")
    ]


@pytest.mark.parametrize(
    ("pair_ms", "differ", "engine"),
    [
        ({"onnxruntime_1": 30.0, "onnxruntime_2": 20.0, "ncnn_1": 25.0, "ncnn_2": 22.0}, 1e-4, "onnxruntime"),
        ({"onnxruntime_1": 30.0, "onnxruntime_2": 20.0, "ncnn_1": 40.0, "ncnn_2": 19.0}, 1e-4, "ncnn"),
        ({"onnxruntime_1": 30.0, "ncnn_1": 10.0}, 2e-3, "onnxruntime"),
        ({"onnxruntime_1": 30.0, "ncnn_1": 10.0}, float("nan"), "onnxruntime"),
        ({"onnxruntime_1": 30.0, "ncnn_1": 30.0}, 0.0, "onnxruntime"),
        ({"onnxruntime_1": 30.0}, 0.0, "onnxruntime"),
        ({"ncnn_1": 30.0}, 0.0, "onnxruntime"),
    ],
    ids=["slower", "faster", "differs", "not a number", "a draw", "alone", "only ncnn"],
)
def test_the_faster_engine_is_chosen_where_outputs_agree(pair_ms: dict[str, float], differ: float, engine: str) -> None:
    assert choose_engine(timed(**pair_ms), [Agreement("detector", differ, 4)], MAX_DIFFERENCE).engine == engine


def test_an_engine_that_ran_one_net_alone_is_not_chosen() -> None:
    found = [row for row in timed(onnxruntime_1=30.0, ncnn_1=10.0) if (row.engine, row.net) != ("ncnn", "detector")]
    assert choose_engine(found, [], MAX_DIFFERENCE).engine == "onnxruntime"


def test_cases_take_turns() -> None:
    order: list[str] = []
    ready = {name: lambda name=name: order.append(name) for name in ("one", "other")}
    *_, (turn, taken) = measure_rounds(ready, 4, count(0.0, 1.5).__next__)  # type: ignore[arg-type]
    assert turn == 4
    assert order == ["one", "other"] * 7
    assert list(taken.values()) == [[1.5] * 4] * 2


def test_rows_are_least_median_and_p95() -> None:
    assert summarise_times({Case("ncnn", "detector", 2): [4.0, 1.0, 3.0, 2.0]}) == (
        TimingRow("ncnn", "detector", 2, 1.0, 2.5, 4.0, 4),
    )


@pytest.mark.slow
def test_bench_reports_why_ncnn_is_excluded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    weights = Path(shutil.copytree(WEIGHTS, tmp_path / "weights", ignore=shutil.ignore_patterns("*.ncnn.*")))
    words = ["bench", "--weights", str(weights), "--threads", "1", "--rounds", "1"]
    assert main([*words, "--json", str(tmp_path / "bench.json")]) == 0
    printed = capsys.readouterr().out
    assert "ncnn left out: " in printed
    assert "perception.engine=onnxruntime" in printed
    report = msgspec.json.decode((tmp_path / "bench.json").read_bytes(), type=EngineReport)
    assert [(row.engine, row.net, row.n) for row in report.rows] == [
        ("onnxruntime", "detector", 1),
        ("onnxruntime", "segmenter", 1),
    ]
    assert all(cost.multiply_adds is not None for cost in report.costs)
    assert main([*words, "--engine", "ncnn"]) == 2
    assert "make it with: paani models convert" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.usefixtures("without_data")
def test_bench_runs_both_engines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    segmenter = place(small_segmenter(tmp_path / "segmenter.onnx"), CONVOLUTION, packed())
    place(Path(shutil.copy(verified_path("detector"), tmp_path)), NO_BOXES, bytes(4 * 8 * 2730))
    catalogue = load_catalogue()
    own = msgspec.structs.replace(catalogue["segmenter"], sha256=file_sha256(segmenter))
    save_catalogue({"segmenter": own, "detector": catalogue["detector"]}, tmp_path)
    words = ["bench", "--weights", str(tmp_path), "--threads", "1,2", "--rounds", "1"]
    assert main([*words, "--json", str(tmp_path / "bench.json")]) == 0
    report = msgspec.json.decode((tmp_path / "bench.json").read_bytes(), type=EngineReport)
    assert {(row.engine, row.threads) for row in report.rows} == {
        (engine, threads) for engine in ("onnxruntime", "ncnn") for threads in (1, 2)
    }
    assert report.left_out == {}
    assert report.choice.engine == "onnxruntime"
    assert "ncnn's detector answers differ" in capsys.readouterr().out
