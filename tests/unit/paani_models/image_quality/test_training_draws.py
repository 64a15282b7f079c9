"""The gate's training: what a fault's verdict becomes, what an epoch shows, which threshold is chosen, and resuming."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")

from paani.errors import UserError  # noqa: E402
from paani.picture_faults import WATER  # noqa: E402
from paani_models.datasets.sources import Sample, Source  # noqa: E402
from paani_models.image_quality import train as train_gate  # noqa: E402
from paani_models.image_quality.data import FaultLevel, Scene, choose_validation_sequences, read_scenes  # noqa: E402
from paani_models.image_quality.draws import CLEAN, DRY, draw_epoch_plan, draw_example  # noqa: E402
from paani_models.image_quality.network import ImageQualityNetwork, start_from_imagenet  # noqa: E402
from paani_models.image_quality.train import FaultLevelErrors, ImageQualityTraining, threshold_figures  # noqa: E402
from paani_models.segmenter.shipped_network import ShippedSegmenter  # noqa: E402
from paani_models.training.training_state import load_checkpoint  # noqa: E402
from tests.pictures import river  # noqa: E402

pytestmark = pytest.mark.train

CELLS = [
    FaultLevel("black", 1, 0.1, 84),
    FaultLevel("glare", 5, 0.71, 84),
    FaultLevel("fog", 1, 0.95, 84),
    FaultLevel("tilted", 5, 0.2, 84),
]


def shore(checked: bool = False) -> Scene:
    mask = np.zeros((240, 320), np.uint8)
    mask[:60], mask[60:110] = 2, 1
    return Scene(river(), mask, True, checked)


def test_a_cells_target_allows_for_a_segmenter_that_knows_its_pictures() -> None:
    targets = [FaultLevel("fog", 1, miou, 84).target for miou in (0.2, 0.65, 0.725, 0.80, 0.9)]
    assert targets == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])


def test_an_epoch_shows_each_scene_clean_dry_and_in_the_cells_that_it_gets_wrong() -> None:
    rows = draw_epoch_plan(50, np.array([0.01, 1.0, 0.01, 1.0]), 2, np.random.default_rng(0))
    shown = rows[:, 1].tolist()
    assert shown.count(CLEAN) == shown.count(DRY) == 50
    assert sorted(rows[rows[:, 1] == CLEAN][:, 0].tolist()) == list(range(50))
    assert shown.count(0) + shown.count(2) < 0.2 * (shown.count(1) + shown.count(3))


@pytest.mark.parametrize(("shown", "target"), [(CLEAN, 1.0), (DRY, 0.0), (0, 0.0), (1, 0.4), (2, 1.0), (3, 0.0)])
def test_what_is_shown_has_its_target(shown: int, target: float) -> None:
    one = draw_example(shore(), shown, CELLS, np.random.default_rng(1))
    assert one.picture.shape == (3, 120, 160)
    assert one.target == pytest.approx(target)
    assert one.shown == shown
    again = draw_example(shore(), shown, CELLS, np.random.default_rng(1))
    assert np.array_equal(one.picture, again.picture)


def test_a_scene_that_is_all_water_has_no_dry_view() -> None:
    sea = Scene(river(), np.full((240, 320), WATER, np.uint8), False, False)
    assert {draw_example(sea, DRY, CELLS, np.random.default_rng(seed)).shown for seed in range(9)} <= {0, 1, 2, 3}


def test_a_picture_that_nobody_segmented_is_dry_only_well_above_the_water_found(tmp_path: Path) -> None:
    path = tmp_path / "one.png"
    cv2.imwrite(str(path), river())
    sample = Sample(Source("boats", "boats"), "run0", False, path, None, None)

    def segment(bgr: np.ndarray) -> np.ndarray:
        found = np.ones(bgr.shape[:2], np.uint8)
        found[120:] = WATER
        return found

    (one,) = read_scenes([sample], segment)
    assert not one.drawn
    assert (one.mask[116:] == WATER).all()
    assert (one.mask[:115] != WATER).all()
    (none,) = read_scenes([sample], lambda bgr: np.ones(bgr.shape[:2], np.uint8))
    assert (none.mask == WATER).all()


def test_a_picture_without_water_is_unfit_as_it_is_and_in_every_fault(tmp_path: Path) -> None:
    path = tmp_path / "yard.png"
    cv2.imwrite(str(path), river())
    sample = Sample(Source("boats", "boats"), "run0", False, path, None, None, without_water=True)
    (one,) = read_scenes([sample], lambda bgr: np.full(bgr.shape[:2], WATER, np.uint8))
    assert one.without_water
    assert not (one.mask == WATER).any()
    shown = [draw_example(one, shown, CELLS, np.random.default_rng(0)) for shown in (CLEAN, DRY, 0, 1, 2, 3)]
    assert {(each.target, each.shown) for each in shown} == {(0.0, DRY)}
    assert not np.array_equal(shown[0].picture, shown[2].picture)


def test_every_source_of_many_sequences_has_some_to_check_and_none_loses_more_than_a_fifth() -> None:
    lengths = {"canal": [9, 8, 7, 30, 6, 5, 12, 3], "boats": [1] * 50, "harbour": [80, 83], "pond": [10]}
    samples = [
        Sample(Source(source, source), f"run{index}", False, Path(f"{source}/{index}/{n}.jpg"), None, None)
        for source, sequences in lengths.items()
        for index, length in enumerate(sequences)
        for n in range(length)
    ]
    chosen = choose_validation_sequences(samples)
    share = {
        source: sum(lengths[source][int(name[3:])] for of, name in chosen if of == source) / sum(lengths[source])
        for source in lengths
    }
    assert 0.1 <= share["canal"] <= 0.2
    assert share["boats"] == pytest.approx(0.1)
    assert share["harbour"] == share["pond"] == 0.0
    assert choose_validation_sequences(samples[::-1]) == chosen


def test_the_threshold_refuses_few_enough() -> None:
    said = np.concatenate([np.linspace(0.0, 1.0, 1001), np.full(500, 0.3), np.zeros(100)]).astype(np.float32)
    target = np.concatenate([np.ones(1501), np.zeros(100)])
    clean = np.arange(1601) >= 1001
    clean[1501:] = False
    found = threshold_figures(said, target, clean, np.zeros(1601, np.bool_))
    assert found["min_fitness"] == pytest.approx(0.010)
    assert found["refused"] <= train_gate.MAX_REFUSED_FRAC
    assert found["refused_clean"] == found["accepted"] == found["accepted_dry"] == 0.0
    said[1001] = 0.001  # one odd photograph does not open the gate, a second one does
    assert threshold_figures(said, target, clean, np.zeros(1601, np.bool_))["min_fitness"] == pytest.approx(0.010)
    said[1002] = 0.002
    assert threshold_figures(said, target, clean, np.zeros(1601, np.bool_))["min_fitness"] == pytest.approx(0.002)


def test_cells_that_the_net_knows_are_drawn_less() -> None:
    errors = FaultLevelErrors(2)
    for _ in range(100):
        errors.note(np.array([0, 0, CLEAN, DRY, 1]), np.array([0.0, 0.0, 1.0, 1.0, 0.5], np.float32))
    assert errors.weights() == pytest.approx(
        [0.006 + train_gate.MIN_DRAW_WEIGHT, 0.503 + train_gate.MIN_DRAW_WEIGHT], abs=0.01
    )


@pytest.fixture
def imagenet(tmp_path: Path) -> Path:
    """Random weights in the form of the ImageNet file."""
    torch.manual_seed(3)
    convs = [m for m in ShippedSegmenter().encoder().modules() if isinstance(m, torch.nn.Conv2d)]
    parts = {
        f"conv{index:02d}.{part}": getattr(conv, part).detach().numpy().astype(np.float16)
        for index, conv in enumerate(convs)
        for part in ("weight", "bias")
    }
    np.savez(tmp_path / "imagenet.npz", **parts)
    return tmp_path / "imagenet.npz"


def test_the_front_starts_from_imagenet_and_its_first_stages_stay(imagenet: Path) -> None:
    net = ImageQualityNetwork()
    start_from_imagenet(net, imagenet)
    given = np.load(imagenet)["conv00.weight"].astype(np.float32)
    assert np.array_equal(net.front[0].conv.weight.detach().numpy(), given)
    learns = [any(p.requires_grad for p in part.parameters()) for part in net.front]
    assert learns == [False, False, False, True, True]
    assert net(torch.zeros(1, 3, 120, 160)).shape == (1, 1)


def test_what_would_be_checked_is_trained_on_where_nothing_is_to_be_chosen(
    tmp_path: Path, imagenet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(train_gate, "scenes", lambda *_: [shore(), shore(), shore(checked=True)])
    monkeypatch.setattr(train_gate, "cells", lambda *_: CELLS)
    monkeypatch.setattr(train_gate, "_segment", lambda *_: None)
    weights = tmp_path / "segmenter.onnx"
    weights.write_bytes(b"a segmenter")
    recipe = train_gate.ImageQualityRecipe(epochs=1, batch=4, per_scene=2, checked=False)
    training = ImageQualityTraining(tmp_path / "run", [], weights, imagenet, recipe)
    assert (len(training.scenes), training.validation) == (3, [])
    training.run()
    assert set(json.loads((tmp_path / "run" / "log.jsonl").read_text())) == {"epoch", "loss"}


def test_a_resumed_run_equals_an_unbroken_one_s11(
    tmp_path: Path, imagenet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(train_gate, "scenes", lambda *_: [shore(), shore(), shore(checked=True)])
    monkeypatch.setattr(train_gate, "cells", lambda *_: CELLS)
    monkeypatch.setattr(train_gate, "CHECKED_CELLS", 2)
    segmenter = Path(train_gate.__file__).with_name("weights") / "segmenter.onnx"
    recipe = train_gate.ImageQualityRecipe(epochs=2, batch=4, per_scene=2)

    ImageQualityTraining(tmp_path / "whole", [], segmenter, imagenet, recipe).run()
    last = load_checkpoint(tmp_path / "whole" / "last.pt")
    broken = ImageQualityTraining(tmp_path / "broken", [], segmenter, imagenet, recipe)
    with monkeypatch.context() as patch:
        patch.setattr(broken.progress, "finish_epoch", _stops_after(broken.progress.finish_epoch))
        with pytest.raises(KeyboardInterrupt):
            broken.run()
    ImageQualityTraining(tmp_path / "broken", [], segmenter, imagenet, recipe).run()
    again = load_checkpoint(tmp_path / "broken" / "last.pt")
    assert all(torch.equal(value, again["average"][name]) for name, value in last["average"].items())
    assert torch.equal(last["extra"]["error"], again["extra"]["error"])
    with pytest.raises(UserError, match="another recipe"):
        ImageQualityTraining(tmp_path / "broken", [], segmenter, imagenet, replace(recipe, per_scene=1))


def _stops_after(finish: Callable[..., None]) -> Callable[..., None]:
    def stopped(*arguments: object) -> None:
        finish(*arguments)
        raise KeyboardInterrupt

    return stopped
