"""`paani scenario`: the paper's table on any pictures, the paper's own rows at the policy, generated trajectories."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from paani import messages as m
from paani.cli import main
from paani.cli import main as paani
from paani.clock import stopwatch_ms
from paani.config import load_config
from paani_models.catalogue import load_catalogue
from paani_services.advisor.advise import advise
from paani_services.perception.pipeline import Perceiver
from paani_tools.look.verdict import Verdict
from paani_tools.scenario.command import StillsReport, TrajectoriesReport
from paani_tools.scenario.stills import STALE_AGE_S, present_still
from paani_tools.scenario.trajectories import families
from tests.pictures import PICTURES, river
from tests.unit.paani_services.advisor.advisor_evidence import CLEAR, PAPER, box, lane, play, seeing, water

pytestmark = pytest.mark.slow

D, R = m.Direction, m.Reason
VESSEL = box(m.Label.VESSEL, (0.0, 0.38, 0.30, 0.56), 0.85723)  # reaches beyond the frame's left edge
MOORED = box(m.Label.BUOY, (0.70, 0.56, 0.95, 0.66), 0.45)
SIX = ["expansion", "contraction", "steady", "clipped", "gap", "ambiguity"]


def beside(detection: m.Detection, risks: tuple[float, float, float]) -> m.Evidence:
    """The detection, and water evidence that brings the three risks to these values."""
    _, advice, _ = play(
        [msgspec.structs.replace(seeing(detection), left=lane(0), center=lane(0), right=lane(0))] * 8, PAPER
    )
    from_box = (advice[-1].left.risk, advice[-1].center.risk, advice[-1].right.risk)
    left, center, right = (lane(risk - part) for risk, part in zip(risks, from_box, strict=True))
    return msgspec.structs.replace(CLEAR, detections=(detection,), left=left, center=center, right=right)


@pytest.mark.parametrize(
    ("risks", "detection", "direction", "reason"),
    [
        pytest.param((0.3413, 0.2941, 0.1611), None, D.STRAIGHT, R.CENTER_CLEAR, id="V11-47266"),
        pytest.param((0.4976, 0.5114, 0.4573), VESSEL, D.RIGHT, R.CENTER_RISK, id="V12-01703"),
        pytest.param((0.3367, 0.4716, 0.6280), None, D.STRAIGHT, R.CENTER_CLEAR, id="V13-27011"),
        pytest.param((0.6615, 0.6025, 0.4489), MOORED, D.STOP, R.NO_SIDE_UNOCCUPIED, id="V14-47357"),
        pytest.param((0.0288, 0.0004, 0.0029), None, D.STRAIGHT, R.CENTER_CLEAR, id="V15-black"),
    ],
)
def test_the_papers_rows_at_the_policy(
    risks: tuple[float, float, float],
    detection: m.Detection | None,
    direction: m.Direction,
    reason: m.Reason,
) -> None:
    """V11-V16, U8: the printed risks give the printed advice to the fourth digit, and STOP 9.3 s later.

    V12: a vessel of confidence .85723 beside the way, its motion unknown because its box is cut by the frame.
    V14: the safer side is occupied.
    """
    evidence = water(*risks) if detection is None else beside(detection, risks)
    state, advice, tracks = play([evidence] * 8, PAPER, period_s=0.1)
    last = advice[-1]
    assert (last.direction, last.reason) == (direction, reason)
    assert [f"{given.risk:.4f}" for given in (last.left, last.center, last.right)] == [f"{risk:.4f}" for risk in risks]
    if detection is VESSEL:
        track = tracks[-1].tracks[0]
        assert track.confidence == pytest.approx(0.85723)
        assert (track.motion, track.motion_cause) == (m.MotionState.UNKNOWN, m.MotionCause.CLIPPED_BY_FRAME)
        assert not last.right.track_ids
    _, stale, _ = advise(state, None, last.source_us + round(STALE_AGE_S * 1e6), PAPER)
    assert (stale.direction, stale.reason) == (D.STOP, R.STALE_EVIDENCE)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four pictures, as many as the paper shows."""
    folder = tmp_path / "pictures"
    folder.mkdir()
    for name in ("river", "river_at_dusk", "white", "white_noise"):
        cv2.imwrite(str(folder / f"{name}.png"), PICTURES[name])
    return folder


def report(file: Path) -> StillsReport:
    return msgspec.json.decode(file.read_bytes(), type=StillsReport)


def test_table_and_report(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """U8, V16, J19: each still eight times at 10 Hz, then black, then five stale probes, in the paper's columns."""
    out = folder.parent / "report.json"
    assert paani(["scenario", str(folder), "--json", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["input", "L", "C", "R", "advice", "why", "motion"]
    assert [line.split()[0] for line in lines[1:]] == [
        "river.png", "river_at_dusk.png", "white.png", "white_noise.png", "black", "stale",
    ]  # fmt: skip
    assert lines[5].split()[1:6] == ["-", "-", "-", "STOP", "UNUSABLE_IMAGE"]
    assert "5/5 STOP" in lines[6]
    given = report(out)
    assert (given.profile, given.presentations, given.period_s) == ("paani", 8, 0.1)
    assert (given.stale.age_s, given.stale.probes, given.stale.stopped) == (9.3, 5, 5)
    seen = given.rows[0]
    assert lines[1].split()[1:5] == [*(f"{risk:.4f}" for risk in seen.risk), seen.direction]
    assert [row.usable for row in given.rows] == [True, True, False, False, False]
    assert {row.direction for row in given.rows[2:]} == {D.STOP}


def test_a_single_picture_is_probed_five_times_too(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """V16."""
    assert paani(["scenario", str(folder / "river.png")]) == 0
    assert "5/5 STOP" in capsys.readouterr().out


def test_a_net_that_calls_black_water(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """J19, V15: without the image-quality check the boat goes on into the dark; with it the same net cannot."""
    cv2.imwrite(str(tmp_path / "river.png"), river())
    net, out = tmp_path / "dark_is_water.onnx", tmp_path / "report.json"
    net.write_bytes(dark_is_water())
    words = ["scenario", str(tmp_path / "river.png"), "--json", str(out), "--set", f"perception.segmenter={net}"]
    assert paani([*words, "--profile", "paper"]) == 0
    black = report(out).rows[-1]
    assert (black.input, black.usable, black.direction, black.reason) == ("black", True, D.STRAIGHT, R.CENTER_CLEAR)
    assert max(black.risk) < 0.03
    assert paani(words) == 0
    black = report(out).rows[-1]
    assert (black.usable, black.cause, black.direction) == (False, m.UnusableCause.BLACK, D.STOP)
    assert "models" not in capsys.readouterr().err


def test_the_colour_mask_is_not_fail_safe_in_the_paper(folder: Path) -> None:
    """F4: few obstacles and no learned mask still give STRAIGHT in `paper`; `paani` never moves on it."""
    out = folder.parent / "report.json"
    words = ["scenario", str(folder / "river.png"), "--json", str(out), "--set", "perception.segmenter=none"]
    assert paani([*words, "--profile", "paper"]) == 0
    black = report(out).rows[-1]
    assert (black.usable, black.direction, black.reason) == (True, D.STRAIGHT, R.CENTER_CLEAR)
    assert black.risk == pytest.approx((0.35, 0.35, 0.35))
    assert paani(words) == 0
    assert {row.direction for row in report(out).rows} == {D.STOP}
    assert {row.reason for row in report(out).rows} == {R.NO_SAFE_SIDE, R.UNUSABLE_IMAGE}


def test_spoilt_pictures_of_a_folder_are_named_and_counted(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "aaa.jpg").write_bytes(b"spoilt")
    (folder / "empty.png").write_bytes(b"")
    (folder / "notes.txt").write_text("no picture at all")
    assert paani(["scenario", str(folder)]) == 0
    out = capsys.readouterr().out
    for name in ("aaa.jpg", "empty.png"):
        assert f"skipped {folder / name}: not a picture\n" in out
    assert out.endswith("2 of 6 pictures skipped\n")
    assert "notes.txt" not in out


def test_a_mistake_is_one_line_and_exit_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spoilt, empty, film, bad = (tmp_path / name for name in ("spoilt.jpg", "empty", "film.mp4", "bad"))
    spoilt.write_bytes(b"spoilt")
    film.write_bytes(b"film")
    for folder in (empty, bad):
        folder.mkdir()
    (bad / "a.png").write_bytes(b"spoilt")
    out = tmp_path / "report.json"
    for path in (tmp_path / "missing.jpg", spoilt, empty, film, bad):
        assert paani(["scenario", str(path), "--json", str(out)]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert captured.err.count("\n") == 1
        assert str(path) in captured.err
    assert paani(["scenario", "--trajectories", "--json", str(tmp_path / "no" / "report.json")]) == 2
    assert "--json" in capsys.readouterr().err
    assert not out.exists()
    for words in ([], [str(spoilt), "--trajectories"]):
        with pytest.raises(SystemExit) as caught:
            paani(["scenario", *words])
        assert caught.value.code == 2


@pytest.mark.parametrize("profile", ["paani", "paper"])
def test_six_families_of_trajectories(profile: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """U9, I3, I4, I10, I12, I16: growth, shrinking and rest are told apart; a broken history is unknown, and why."""
    out = tmp_path / "report.json"
    assert paani(["scenario", "--trajectories", "--profile", profile, "--json", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == SIX
    found = msgspec.json.decode(out.read_bytes(), type=TrajectoriesReport).families
    for family in found:
        assert (family.trajectories, family.as_wanted) == (15, 15), family
        assert [outcome.count for outcome in family.outcomes] == [15]


def test_trajectories_can_fail() -> None:
    """U9: an estimator that allows the gap, or takes the edge for inside, is found out."""
    lax = load_config(profile="paper", sets=("advisor.motion.max_gap_s=2", "advisor.motion.edge_margin=0.0"))
    assert {family.name: family.as_wanted for family in families(lax)}["gap"] == 0
    deaf = load_config(profile="paper", sets=("advisor.motion.deadband_per_s=0.3",))
    as_wanted = {family.name: family.as_wanted for family in families(deaf)}
    assert as_wanted["expansion"] == as_wanted["contraction"] == 6


def dark_is_water() -> bytes:
    """A segmenter of the catalogue's shapes: the darker a pixel, the surer it is water; bright pixels are obstacles."""
    contract = load_catalogue()["segmenter"]
    weight = np.zeros((3, 3, 1, 1), np.float32)
    weight[0], weight[1] = -3.0, 3.0  # of normalised channels: black is about -2 in each
    node = helper.make_node("Conv", ["input", "weight"], ["logits"])
    ends = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, list(end.shape))
        for name, end in (("input", contract.input), ("logits", contract.output))
    ]
    graph = helper.make_graph([node], "dark", ends[:1], ends[1:], [numpy_helper.from_array(weight, "weight")])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 9
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


@pytest.mark.slow
def test_v16_probes_that_are_not_stale_are_not_told_to_stop(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "river.png"
    cv2.imwrite(str(picture), PICTURES["river"])
    sets = ["--set", "advisor.evidence_max_age_s=20", "--set", "advisor.lifetime_s=20"]
    assert main(["scenario", str(picture), *sets]) == 0
    assert "2/5 STOP" in capsys.readouterr().out


@pytest.mark.slow
def test_u8_x7_a_black_picture_is_presented_eight_times_a_tenth_of_a_second_apart(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    config, presented_us = load_config(), []

    def advise_noting(state: Any, evidence: Any, now_us: int, settings: Any) -> Any:
        presented_us.append((evidence.source_us, now_us))
        return advise(state, evidence, now_us, settings)

    monkeypatch.setattr("paani_tools.look.verdict.advise", advise_noting)
    perceiver = Perceiver(config.perception, stopwatch_ms)
    (black,) = present_still([], perceiver, config)
    perceiver.close()
    assert isinstance(black, Verdict)
    assert black.bgr is not None
    assert not black.bgr.any()
    assert [stamp_us - presented_us[0][0] for stamp_us, _ in presented_us] == [100_000 * k for k in range(8)]
    assert all(stamp_us == now_us for stamp_us, now_us in presented_us)
    assert config.perception.image_quality.enabled
