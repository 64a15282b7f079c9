"""`paani bench eyes` prints what it promises; the figures are for reading."""

from __future__ import annotations

from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

from paani.config import CorridorConfig, DetectorConfig, load_config
from paani.errors import UserError
from paani_services.perception.corridors import classify_cells, summarise_corridors
from paani_services.perception.engine import OnnxEngine, share_arena
from paani_tools.bench.eyes import paper_shaped
from paani_tools.bench.eyes.command import Eyes, main, text
from paani_tools.bench.eyes.stages import Row, Step, measure_steps, ratios, rows
from tests.pictures import river

pytestmark = [pytest.mark.integration, pytest.mark.timeout(300)]


@pytest.mark.rotating(cpu_s=20)
def test_bench_eyes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "pictures"
    folder.mkdir()
    for seed in range(3):
        cv2.imwrite(str(folder / f"{seed}.png"), river(seed))
    assert main(["--rounds", "2", "--folder", str(folder), "--json", str(tmp_path / "eyes.json")]) == 0
    report = msgspec.json.decode((tmp_path / "eyes.json").read_bytes(), type=Eyes)
    names = {row.name for row in report.rows}
    assert {"gate", "letterbox", "stretch", "detector, 1 thread", "segmenter, 1 thread", "boxes", "corridors"} <= names
    assert {"two bare runs, 2 threads", "pipeline, concurrent", "pipeline, sequential, 2 threads"} <= names
    assert all(row.n == 2 and 0 < row.least_ms <= row.median_ms <= row.p95_ms for row in report.rows)
    assert report.ratios[0].bar == 0.90
    assert report.pictures + report.refused == 3
    assert report.footprint.rss_mib > 0
    printed = capsys.readouterr().out
    assert printed == text(report)
    assert all(name in printed for name in names)


def test_a_folder_is_no_picture_whatever_its_name(tmp_path: Path) -> None:
    (tmp_path / "x.jpg").mkdir()
    with pytest.raises(UserError, match=f"^--folder {tmp_path}: no pictures"):
        main(["--folder", str(tmp_path)])


def test_measured_runs_everything_in_turn() -> None:
    """Each round runs every step once, on the next picture; the first rounds do not count."""
    seen: list[tuple[str, int]] = []
    pictures = [np.full((1, 1, 3), value, np.uint8) for value in (1, 2)]

    def step(name: str) -> Step:
        return lambda p: seen.append((name, int(p[0, 0, 0])))

    steps = {name: step(name) for name in ("a", "b")}
    ticks = iter(range(1000))
    *_, (_, taken) = measure_steps(steps, pictures, 3, lambda: float(next(ticks)))
    assert seen[:4] == [("a", seen[0][1]), ("b", seen[0][1]), ("a", seen[2][1]), ("b", seen[2][1])]
    assert seen[0][1] != seen[2][1]
    assert rows(taken) == (Row("a", 1.0, 1.0, 1.0, 3), Row("b", 1.0, 1.0, 1.0, 3))


def test_ratios_of_what_was_measured() -> None:
    found = [Row("pipeline, concurrent", 8.0, 9.0, 12.0, 5), Row("two bare runs, 2 threads", 10.0, 12.0, 15.0, 5)]
    (ratio,) = ratios(found, [])
    assert (ratio.medians, ratio.least, ratio.bar) == (0.75, 0.8, 0.90)


def test_the_papers_shape_sees_what_perception_sees() -> None:
    """It is a fair comparison: the same networks, the same corridors, to the width of a cell."""
    config, picture = CorridorConfig(), paper_shaped.stretch(river())
    ours = summarise_corridors(*classify_cells(OnnxEngine.load("segmenter", "", 1).run(picture), 1.0), config)
    theirs = paper_shaped.lanes(OnnxEngine.load("segmenter", "", 1, full_size=True).run(picture), config)
    for mine, (non_water, uncertainty, clear_width) in zip(ours, theirs, strict=True):
        assert mine.non_water == pytest.approx(non_water, abs=0.02)
        assert mine.uncertainty == pytest.approx(uncertainty, abs=0.02)
        assert mine.clear_width == pytest.approx(clear_width, abs=0.06)
    candidates = np.zeros((1, 8, 1680), np.float32)
    candidates[0, :, 0] = (100, 100, 50, 40, 0.9, 0, 0, 0)
    candidates[0, :, 1] = (102, 100, 50, 40, 0, 0.8, 0, 0)
    candidates[0, :, 2] = (200, 100, 50, 40, 0, 0.8, 0, 0)
    assert [score for _, score in paper_shaped.decode_boxes(candidates, DetectorConfig())] == pytest.approx([0.9, 0.8])


def test_the_paper_runs_two_threads_within_a_step_and_one_between_c14_d11() -> None:
    config = load_config(profile="paper").perception
    assert config.intra_op_threads == 2
    assert not config.concurrent
    for role in ("detector", "segmenter"):
        options = OnnxEngine.load(role, "", config.intra_op_threads)._session.get_session_options()
        assert (options.intra_op_num_threads, options.inter_op_num_threads) == (2, 1)


def test_all_networks_of_a_process_take_memory_from_one_arena() -> None:
    for role in ("detector", "segmenter", "gate"):
        options = OnnxEngine.load(role, "", 1)._session.get_session_options()
        assert options.get_session_config_entry("session.use_env_allocators") == "1"
    assert share_arena.cache_info().currsize == 1, "without a registered arena the option does nothing"


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--folder", "absent"], "--folder absent: no such folder"),
        (["--with", "absent"], "--with absent: no such folder"),
    ],
)
def test_mistakes_are_one_line(words: list[str], named: str) -> None:
    with pytest.raises(UserError, match=named):
        main(words)
