"""The whole of perception on real model files: evidence for good pictures, a cause for bad ones."""

from __future__ import annotations

import itertools
import shutil
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from paani import messages as m
from paani.arrays import U8
from paani.clock import stopwatch_ms
from paani.config import PerceptionConfig, load_config
from paani.config.perception import WeightSet
from paani.errors import UserError
from paani_models.catalogue import OTHER_SETS, load_catalogue, verified_path
from paani_services.perception import pipeline
from paani_services.perception.box_decoding import LABELS
from paani_services.perception.corridors import summarise_corridors
from paani_services.perception.engine import OnnxEngine, network_path
from paani_services.perception.fitness import load_fitness
from paani_services.perception.pipeline import Perceiver
from tests.pictures import PICTURES, noisy, river

HEADER = m.PictureHeader(source_us=1_000_000, frame_seq=7, frame_epoch=3, width_px=320, height_px=240)


def perceiver(config: PerceptionConfig | None = None) -> Perceiver:
    return Perceiver(config or PerceptionConfig(), stopwatch_ms)


def jpeg(picture: np.ndarray) -> bytes:
    return cv2.imencode(".jpg", picture)[1].tobytes()


def seeing_somebody(score: float, buoy: float = 0.0) -> Callable[[OnnxEngine, Any], Any]:
    """How an engine runs whose detector is so sure of somebody in the water before the bow, or of a buoy there."""
    run = OnnxEngine.run

    def run_seeing(engine: OnnxEngine, tensor: Any) -> Any:
        output = run(engine, tensor)
        if output.ndim == 3:  # of the detector, in pixels of its input
            height, width = tensor.shape[2:]
            output = np.zeros_like(output)
            output[0, :4, 0] = (0.5 * width, 0.75 * height, 0.15 * width, 0.15 * height)
            output[0, 4 + LABELS.index(m.Label.PERSON), 0] = score
            output[0, 4 + LABELS.index(m.Label.BUOY), 0] = buoy
        return output

    return run_seeing


@pytest.mark.slow
def test_b5_evidence_of_a_picture() -> None:
    """B4, B5, B7: dimensions, source sequence, stamps, detections, lanes, timing, freshness; learned and eligible."""
    evidence, mask = perceiver().perceive(jpeg(river()), HEADER, 0.12)
    assert (evidence.source_us, evidence.frame_seq, evidence.frame_epoch) == (1_000_000, 7, 3)
    assert (evidence.width_px, evidence.height_px, evidence.usable) == (320, 240, True)
    assert (evidence.segmentation, evidence.navigation_eligible) == (m.SegmentationSource.LEARNED, True)
    assert evidence.timing.frame_age_ms == pytest.approx(120.0)
    timing = evidence.timing
    assert 0.0 < timing.inference_ms <= timing.total_ms
    assert min(timing.detector_ms, timing.segmenter_ms, timing.gate_ms, timing.decode_ms) > 0.0
    assert evidence.confidence_threshold == 0.40
    assert "detector" in evidence.models
    assert mask is not None
    assert mask.shape == (64, 80)
    assert mask.dtype == np.uint8
    assert set(np.unique(mask)) <= {0, 1, 2}
    assert msgspec.json.decode(msgspec.json.encode(evidence), type=m.Evidence) == evidence


@pytest.mark.parametrize(
    ("profile", "sets", "score", "is_there"),
    [
        (None, [], 0.6, False),
        (None, [], 0.75, True),
        (None, ["perception.segmenter=none"], 0.6, True),  # a mask drawn by rule shows nobody
        (None, ["perception.weights=open"], 0.6, True),  # whose mask misses people
        (None, [f"perception.detector={verified_path('detector')}"], 0.6, True),  # a network of one's own
        ("paper", [], 0.6, True),  # C6: what is above the threshold is there
    ],
)
@pytest.mark.slow
def test_somebody_whom_the_mask_does_not_show_is_a_reflection(
    monkeypatch: pytest.MonkeyPatch, profile: str | None, sets: list[str], score: float, *, is_there: bool
) -> None:
    monkeypatch.setattr(OnnxEngine, "run", seeing_somebody(score))
    evidence, _ = perceiver(load_config(profile=profile, sets=sets).perception).perceive(river(), HEADER, 0.0)
    assert evidence.usable
    assert [each.label for each in evidence.detections] == [m.Label.PERSON] * is_there
    assert is_there or not evidence.candidates


@pytest.mark.parametrize(("score", "is_sure"), [(0.9, True), (0.3, False)])
@pytest.mark.parametrize(("polygon", "is_hidden"), [("[[0.3,1],[0.3,0.5],[0.7,0.5],[0.7,1]]", True), ("[]", False)])
@pytest.mark.slow
def test_who_is_seen_on_the_own_hull_is_neither_somebody_nor_may_be(
    monkeypatch: pytest.MonkeyPatch, polygon: str, score: float, *, is_hidden: bool, is_sure: bool
) -> None:
    """The boat's own figurehead would stop it for good."""
    monkeypatch.setattr(OnnxEngine, "run", seeing_somebody(score))
    no_reflection = "perception.candidates.reflection_confidence=0"
    config = load_config(sets=[f"perception.ego_polygon={polygon}", no_reflection]).perception
    evidence, _ = perceiver(config).perceive(river(), HEADER, 0.0)
    assert len(evidence.detections) == (is_sure and not is_hidden)
    assert evidence.candidates is not msgspec.UNSET
    boxes = [each for each in evidence.candidates if each.kind is m.CandidateKind.UNSURE_BOX]
    assert len(boxes) == (not is_sure and not is_hidden)


@pytest.mark.parametrize("person_confidence", [0.15, 0.9])
@pytest.mark.slow
def test_a_person_who_would_count_alone_may_be_one_where_something_else_counts_more(
    monkeypatch: pytest.MonkeyPatch, person_confidence: float
) -> None:
    """Whatever threshold candidates have: what is sure enough of a person to be one is enough for a candidate."""
    monkeypatch.setattr(OnnxEngine, "run", seeing_somebody(0.6, buoy=0.7))
    sets = ["reflection_confidence=0", f"person_confidence={person_confidence}"]
    config = load_config(sets=[f"perception.candidates.{each}" for each in sets]).perception
    evidence, _ = perceiver(config).perceive(river(), HEADER, 0.0)
    assert [each.label for each in evidence.detections] == [m.Label.BUOY]
    assert evidence.candidates is not msgspec.UNSET
    assert m.CandidateKind.UNSURE_BOX in [each.kind for each in evidence.candidates]


@pytest.mark.slow
def test_c15_the_threshold_is_one_setting_and_travels() -> None:
    """C15."""
    config = load_config(sets=["perception.detections.confidence=0.25"]).perception
    evidence, _ = perceiver(config).perceive(river(), HEADER, 0.0)
    assert evidence.confidence_threshold == 0.25


@pytest.mark.parametrize(("threshold", "found"), [(0.25, 1), (0.40, 0)])
@pytest.mark.slow
def test_c15_the_recorded_threshold_is_the_one_that_detections_pass(
    monkeypatch: pytest.MonkeyPatch, threshold: float, found: int
) -> None:
    """C15: a person of 0.30 is one by the threshold of the paper's replay, and none by that of its board."""
    monkeypatch.setattr(OnnxEngine, "run", seeing_somebody(0.30))
    config = load_config(profile="paper", sets=[f"perception.detections.confidence={threshold}"]).perception
    evidence, _ = perceiver(config).perceive(river(), HEADER, 0.0)
    assert (len(evidence.detections), evidence.confidence_threshold) == (found, threshold)


@pytest.mark.slow
def test_b5_each_group_of_fields_has_its_own_content(monkeypatch: pytest.MonkeyPatch) -> None:
    """B5: the detections, the lane that each summary is of, and the time that each network took."""
    config = load_config(profile="paper").perception
    eyes, picture = perceiver(config), river()
    picture[:, :100] = (40, 60, 90)
    monkeypatch.setattr(OnnxEngine, "run", seeing_somebody(0.6))
    evidence, mask = eyes.perceive(picture, HEADER, 0.0)
    assert mask is not None
    lanes = summarise_corridors(mask, np.ones(mask.shape, np.float32), config.corridors)
    stated = (evidence.left, evidence.center, evidence.right)
    assert len({lane.non_water for lane in stated}) == 3
    assert [lane.non_water for lane in stated] == pytest.approx([lane.non_water for lane in lanes])
    assert [each.label for each in evidence.detections] == [m.Label.PERSON]
    times = evidence.timing
    assert len({times.detector_ms, times.segmenter_ms, times.gate_ms, times.decode_ms, times.inference_ms}) == 5
    assert times.segmenter_run_ms <= times.segmenter_ms
    assert times.detector_ms + times.segmenter_ms <= times.inference_ms


@pytest.mark.slow
def test_v18_a_networks_time_has_its_preprocessing_and_decoding_and_the_segmenters_run_has_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a clock that each step moves on by a time of its own."""
    elapsed_ms = 0.0

    def lasting(step_ms: float, step: Callable[..., Any]) -> Callable[..., Any]:
        def run_step(*arguments: Any) -> Any:
            nonlocal elapsed_ms
            elapsed_ms += step_ms
            return step(*arguments)

        return run_step

    eyes = Perceiver(load_config(profile="paper").perception, lambda: elapsed_ms)
    monkeypatch.setattr(OnnxEngine, "run", lasting(10.0, OnnxEngine.run))
    before, after = {"letterbox_picture": 1.0, "stretch_picture": 2.0}, {"decode_boxes": 100.0, "classify_cells": 200.0}
    for name, step_ms in (before | after).items():
        monkeypatch.setattr(pipeline, name, lasting(step_ms, getattr(pipeline, name)))
    times = eyes.perceive(river(), HEADER, 0.0)[0].timing
    assert (times.detector_ms, times.segmenter_ms, times.segmenter_run_ms) == (111.0, 212.0, 10.0)


@pytest.mark.slow
def test_concurrent_and_sequential_agree() -> None:
    """B4: the order of the models changes nothing they say."""
    one, _ = perceiver(PerceptionConfig(concurrent=True)).perceive(river(), HEADER, 0.0)
    two, _ = perceiver(PerceptionConfig(concurrent=False)).perceive(river(), HEADER, 0.0)
    assert (one.detections, one.left, one.center, one.right) == (two.detections, two.left, two.center, two.right)


@pytest.mark.slow
def test_b4_the_paper_runs_the_detector_and_then_the_segmenter(monkeypatch: pytest.MonkeyPatch) -> None:
    """B4: one run ends before the next begins, in one thread, on the same picture; one frame id names both."""
    eyes, runs = perceiver(load_config(profile="paper").perception), []
    run = OnnxEngine.run

    def watched(engine: OnnxEngine, tensor: Any) -> Any:
        runs.append(("begins", engine.info().split()[0], threading.get_ident()))
        output = run(engine, tensor)
        runs.append(("ends", engine.info().split()[0], threading.get_ident()))
        return output

    monkeypatch.setattr(OnnxEngine, "run", watched)
    evidence, mask = eyes.perceive(river(), HEADER, 0.0)
    here = threading.get_ident()
    assert runs == [(what, name, here) for name in ("detector", "segmenter") for what in ("begins", "ends")]
    assert (evidence.frame_epoch, evidence.frame_seq) == (HEADER.frame_epoch, HEADER.frame_seq)
    assert mask is not None


@pytest.mark.parametrize(("detector_ms", "begins"), [(30.0, "_detect"), (11.0, "_segment"), (5.0, "_segment")])
@pytest.mark.slow
def test_the_clearly_slower_network_starts_beside_the_image_quality_check(
    detector_ms: float, begins: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What took 10 ms is the segmenter; the first run of each does not count. No answer depends on the order."""
    readings = itertools.chain(
        (0.0, 90.0, 90.0, 91.0, 100.0, 100.0 + detector_ms, 200.0, 210.0), itertools.repeat(211.0)
    )
    eyes = Perceiver(PerceptionConfig(), lambda: next(readings))
    begun = []
    submit = ThreadPoolExecutor.submit

    def watched(pool: ThreadPoolExecutor, *call: Any) -> Future[Any]:
        begun.append(call[0].__name__)
        return submit(pool, *call)

    monkeypatch.setattr(ThreadPoolExecutor, "submit", watched)
    one, _ = eyes.perceive(river(), HEADER, 0.0)
    two, _ = perceiver(PerceptionConfig(concurrent=False)).perceive(river(), HEADER, 0.0)
    assert begun == [begins]
    assert (one.detections, one.left, one.center, one.right) == (two.detections, two.left, two.center, two.right)
    assert not eyes.perceive(PICTURES["black"], msgspec.structs.replace(HEADER, frame_epoch=2), 0.0)[0].usable
    eyes.close()


@pytest.mark.parametrize(
    ("data", "cause"),
    [
        (b"", m.UnusableCause.UNDECODABLE),
        (b"no picture", m.UnusableCause.UNDECODABLE),
        (jpeg(river())[:200], m.UnusableCause.UNDECODABLE),
        (jpeg(PICTURES["black"]), m.UnusableCause.BLACK),
        (jpeg(PICTURES["white"]), m.UnusableCause.WHITE),
        (jpeg(PICTURES["white_noise"]), m.UnusableCause.NOISE),
        (jpeg(river()[:60]), m.UnusableCause.WRONG_SIZE),
    ],
)
@pytest.mark.slow
def test_a_bad_picture_is_a_value(data: bytes, cause: m.UnusableCause) -> None:
    """J19, W1: unusable with its cause; no detections, no lanes, no mask."""
    evidence, mask = perceiver().perceive(data, HEADER, 0.0)
    assert (evidence.usable, evidence.cause, evidence.navigation_eligible) == (False, cause, False)
    assert evidence.detections == ()
    assert evidence.center.non_water == 1.0
    assert evidence.water_edge == ()
    assert mask is None


@pytest.mark.slow
def test_age_is_judged_when_inference_starts() -> None:
    """J16: 0.8 s is still fresh, more is not looked at."""
    assert perceiver().perceive(river(), HEADER, 0.8)[0].usable
    old, _ = perceiver().perceive(river(), HEADER, 0.81)
    assert (old.usable, old.cause) == (False, m.UnusableCause.STALE)


@pytest.mark.slow
def test_a_frozen_camera() -> None:
    eyes = perceiver()
    data = jpeg(river())
    causes = [eyes.perceive(data, msgspec.structs.replace(HEADER, frame_seq=i), 0.0)[0].cause for i in range(6)]
    assert causes == [m.UnusableCause.NONE] * 2 + [m.UnusableCause.FROZEN] * 4
    assert eyes.perceive(jpeg(noisy(river(), 3.0)), HEADER, 0.0)[0].usable


@pytest.mark.slow
def test_f2_without_a_segmenter() -> None:
    """F1, F2: a mask to look at, declared not learned and not eligible."""
    evidence, mask = perceiver(PerceptionConfig(segmenter="none")).perceive(river(), HEADER, 0.0)
    assert evidence.usable
    assert (evidence.segmentation, evidence.navigation_eligible) == (m.SegmentationSource.FALLBACK, False)
    assert mask is not None


@pytest.mark.parametrize("weights", ["open", "paper"])
@pytest.mark.slow
def test_another_set_sees_by_its_own_networks_and_a_file_of_ones_own_goes_before(weights: WeightSet) -> None:
    other = load_catalogue(OTHER_SETS[weights])
    names = [f"{role} {other[role].sha256[:12]}" for role in ("detector", "segmenter")]
    eyes = perceiver(PerceptionConfig(weights=weights))
    evidence, _ = eyes.perceive(river(), HEADER, 0.0)
    eyes.close()
    assert evidence.usable
    assert evidence.models == ", ".join(names)
    assert {role: other[role].sha256 for role in other}.items().isdisjoint(
        {role: model.sha256 for role, model in load_catalogue().items()}.items()
    )
    own = str(verified_path("segmenter"))
    assert network_path("segmenter", PerceptionConfig(weights=weights, segmenter=own)) == own
    assert network_path("detector", PerceptionConfig()) == ""


@pytest.mark.parametrize("weights", ["open", "paper"])
def test_no_network_of_the_full_set_says_whether_a_picture_is_fit_beside_another(weights: WeightSet) -> None:
    assert load_fitness(PerceptionConfig(), 1) is not None
    assert load_fitness(PerceptionConfig(weights=weights), 1) is None
    own = msgspec.structs.replace(PerceptionConfig().image_quality, model=str(verified_path("gate")))
    assert load_fitness(PerceptionConfig(weights=weights, image_quality=own), 1) is not None


def test_a_missing_or_corrupt_model_is_the_users_to_mend(tmp_path: Path) -> None:
    missing = tmp_path / "none.onnx"
    with pytest.raises(UserError, match=r"none\.onnx"):
        OnnxEngine.load("detector", str(missing), 1)
    corrupt = tmp_path / "corrupt.onnx"
    corrupt.write_bytes(verified_path("detector").read_bytes()[:1000])
    with pytest.raises(UserError, match=r"corrupt\.onnx"):
        OnnxEngine.load("detector", str(corrupt), 1)


@pytest.mark.slow
def test_b7_a_model_of_other_shapes_is_refused(tmp_path: Path) -> None:
    """B7, C1, C4, D5: the contract is compared at start."""
    file = tmp_path / "swapped.onnx"
    shutil.copy(verified_path("segmenter"), file)
    with pytest.raises(UserError, match=r"swapped\.onnx: detector must have"):
        OnnxEngine.load("detector", str(file), 1)
    assert OnnxEngine.load("segmenter", str(file), 1).info().startswith("segmenter ")


@pytest.mark.slow
def test_j19_the_paper_profile_accepts_black() -> None:
    """J19: the `paper` profile checks no picture, so black is evidence like any other."""
    paper = load_config(profile="paper").perception
    evidence, _ = perceiver(paper).perceive(jpeg(PICTURES["black"]), HEADER, 0.0)
    assert evidence.usable
    assert not paper.concurrent


@pytest.mark.slow
def test_refused_pictures_leave_at_most_one_run_under_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """However fast pictures are refused, at most one run that started beside the check is under way."""
    eyes, begun = perceiver(), []
    submit = ThreadPoolExecutor.submit

    def watched(pool: ThreadPoolExecutor, *call: Any) -> Future[Any]:
        begun.append(submit(pool, *call))
        return begun[-1]

    monkeypatch.setattr(ThreadPoolExecutor, "submit", watched)
    for epoch in range(20):
        header = msgspec.structs.replace(HEADER, frame_epoch=epoch)
        assert not eyes.perceive(PICTURES["black"], header, 0.0)[0].usable
        assert sum(not work.done() for work in begun) <= 1
    assert len(begun) == 20
    assert eyes.perceive(river(), HEADER, 0.81)[0].cause is m.UnusableCause.STALE
    assert len(begun) == 20, "what is too old costs nothing more"
    assert eyes.perceive(river(), msgspec.structs.replace(HEADER, frame_epoch=99), 0.0)[0].usable
    eyes.close()


@pytest.mark.slow
@pytest.mark.parametrize("picture", [river(), PICTURES["black"]], ids=["river", "black"])
def test_i17_evidence_has_its_pictures_own_time(picture: U8) -> None:
    header = msgspec.structs.replace(HEADER, media_us=1_234, time_base=m.TimeBase.MEDIA)
    found, _ = perceiver().perceive(picture, header, 0.0)
    assert (found.source_us, found.media_us, found.time_base) == (HEADER.source_us, 1_234, m.TimeBase.MEDIA)
