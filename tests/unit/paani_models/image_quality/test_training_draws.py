"""Training of the image-quality network: targets, content of an epoch, choice of the threshold, and resuming."""

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
from paani_models.catalogue import WEIGHTS  # noqa: E402
from paani_models.datasets.sources import Sample, Source  # noqa: E402
from paani_models.engines.onnx_runner import open_network  # noqa: E402
from paani_models.image_quality import train  # noqa: E402
from paani_models.image_quality.data import FaultLevel, Scene, choose_validation_sequences, read_scenes  # noqa: E402
from paani_models.image_quality.draws import CLEAN, WITHOUT_WATER, draw_epoch_plan, draw_example  # noqa: E402
from paani_models.image_quality.network import (  # noqa: E402
    ImageQualityNetwork,
    start_from_export,
    start_from_imagenet,
)
from paani_models.image_quality.train import FaultLevelErrors, ImageQualityTraining, threshold_figures  # noqa: E402
from paani_models.recipes.train_and_export import TrainingOptions, image_quality_recipe  # noqa: E402
from paani_models.segmenter.shipped_network import ShippedSegmenter  # noqa: E402
from paani_models.training.training_state import load_checkpoint  # noqa: E402
from tests.pictures import river  # noqa: E402

pytestmark = pytest.mark.train

LEVELS = [
    FaultLevel("black", 1, 0.1, 84),
    FaultLevel("glare", 5, 0.71, 84),
    FaultLevel("fog", 1, 0.95, 84),
    FaultLevel("tilted", 5, 0.2, 84),
]


def shore(is_validation: bool = False) -> Scene:
    mask = np.zeros((240, 320), np.uint8)
    mask[:60], mask[60:110] = 2, 1
    return Scene(river(), mask, True, is_validation)


def test_the_target_of_a_fault_level_allows_for_the_segmenters_training_bias() -> None:
    targets = [FaultLevel("fog", 1, miou, 84).target for miou in (0.2, 0.65, 0.725, 0.80, 0.9)]
    assert targets == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.0])


def test_an_epoch_shows_each_scene_clean_without_water_and_with_the_faults_of_the_largest_error() -> None:
    rows = draw_epoch_plan(50, np.array([0.01, 1.0, 0.01, 1.0]), 2, np.random.default_rng(0))
    content = rows[:, 1].tolist()
    assert content.count(CLEAN) == content.count(WITHOUT_WATER) == 50
    assert sorted(rows[rows[:, 1] == CLEAN][:, 0].tolist()) == list(range(50))
    assert content.count(0) + content.count(2) < 0.2 * (content.count(1) + content.count(3))


@pytest.mark.parametrize(
    ("content", "target"), [(CLEAN, 1.0), (WITHOUT_WATER, 0.0), (0, 0.0), (1, 0.4), (2, 1.0), (3, 0.0)]
)
def test_every_content_has_its_target(content: int, target: float) -> None:
    one = draw_example(shore(), content, LEVELS, np.random.default_rng(1))
    assert one.picture.shape == (3, 120, 160)
    assert one.target == pytest.approx(target)
    assert one.content == content
    again = draw_example(shore(), content, LEVELS, np.random.default_rng(1))
    assert np.array_equal(one.picture, again.picture)


def test_a_scene_that_is_all_water_allows_no_view_without_water() -> None:
    sea = Scene(river(), np.full((240, 320), WATER, np.uint8), False, False)
    assert {draw_example(sea, WITHOUT_WATER, LEVELS, np.random.default_rng(seed)).content for seed in range(9)} <= {
        0,
        1,
        2,
        3,
    }


def test_predicted_water_grows_by_a_margin_and_fills_a_picture_of_little_water(tmp_path: Path) -> None:
    path = tmp_path / "one.png"
    cv2.imwrite(str(path), river())
    sample = Sample(Source("boats", "boats"), "run0", False, path, None, None)

    def segment(bgr: np.ndarray) -> np.ndarray:
        found = np.ones(bgr.shape[:2], np.uint8)
        found[120:] = WATER
        return found

    (one,) = read_scenes([sample], segment)
    assert not one.is_hand_drawn
    assert (one.mask[116:] == WATER).all()
    assert (one.mask[:115] != WATER).all()
    (none,) = read_scenes([sample], lambda bgr: np.ones(bgr.shape[:2], np.uint8))
    assert (none.mask == WATER).all()


def test_a_picture_without_water_is_unfit_as_it_is_and_in_every_fault(tmp_path: Path) -> None:
    path = tmp_path / "yard.png"
    cv2.imwrite(str(path), river())
    sample = Sample(Source("boats", "boats"), "run0", False, path, None, None, without_water=True)
    (one,) = read_scenes([sample], lambda bgr: np.full(bgr.shape[:2], WATER, np.uint8))
    assert one.is_without_water
    assert not (one.mask == WATER).any()
    content = [
        draw_example(one, content, LEVELS, np.random.default_rng(0)) for content in (CLEAN, WITHOUT_WATER, 0, 1, 2, 3)
    ]
    assert {(each.target, each.content) for each in content} == {(0.0, WITHOUT_WATER)}
    assert not np.array_equal(content[0].picture, content[2].picture)


def test_validation_takes_a_tenth_to_a_fifth_of_every_source_with_enough_sequences() -> None:
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


def test_the_threshold_keeps_to_the_largest_refused_shares() -> None:
    fitness = np.concatenate([np.linspace(0.0, 1.0, 1001), np.full(500, 0.3), np.zeros(100)]).astype(np.float32)
    target = np.concatenate([np.ones(1501), np.zeros(100)])
    clean = np.arange(1601) >= 1001
    clean[1501:] = False
    found = threshold_figures(fitness, target, clean, np.zeros(1601, np.bool_))
    assert found["min_fitness"] == pytest.approx(0.010)
    assert found["refused"] <= train.MAX_REFUSED_FRAC
    assert found["refused_clean"] == found["accepted"] == found["accepted_dry"] == 0.0
    fitness[1001] = 0.001  # one clean picture may always be refused, a second one may not
    assert threshold_figures(fitness, target, clean, np.zeros(1601, np.bool_))["min_fitness"] == pytest.approx(0.010)
    fitness[1002] = 0.002
    assert threshold_figures(fitness, target, clean, np.zeros(1601, np.bool_))["min_fitness"] == pytest.approx(0.002)


def test_fault_levels_of_small_error_are_drawn_less() -> None:
    errors = FaultLevelErrors(2)
    for _ in range(100):
        errors.update(np.array([0, 0, CLEAN, WITHOUT_WATER, 1]), np.array([0.0, 0.0, 1.0, 1.0, 0.5], np.float32))
    assert errors.weights() == pytest.approx([0.006 + train.MIN_DRAW_WEIGHT, 0.503 + train.MIN_DRAW_WEIGHT], abs=0.01)


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


def test_the_convolutional_front_starts_from_imagenet_with_its_first_stages_frozen(imagenet: Path) -> None:
    net = ImageQualityNetwork()
    start_from_imagenet(net, imagenet)
    given = np.load(imagenet)["conv00.weight"].astype(np.float32)
    assert np.array_equal(net.front[0].conv.weight.detach().numpy(), given)
    learns = [any(p.requires_grad for p in part.parameters()) for part in net.front]
    assert learns == [False, False, False, True, True]
    assert net(torch.zeros(1, 3, 120, 160)).shape == (1, 1)


def test_a_training_begins_with_the_weights_of_an_export(
    tmp_path: Path, imagenet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(train, "read_scenes", lambda *_: [shore()])
    monkeypatch.setattr(train, "measure_fault_levels", lambda *_: LEVELS)
    begun = ImageQualityTraining(
        tmp_path, [], WEIGHTS / "segmenter.onnx", imagenet, train.ImageQualityRecipe(), start=WEIGHTS / "gate.onnx"
    ).state
    x = np.random.default_rng(3).random((1, 3, 120, 160), dtype=np.float32)
    expected = open_network(WEIGHTS / "gate.onnx", 1)(x)
    for net in (begun.model, begun.average.model):
        assert np.allclose(net.eval()(torch.from_numpy(x)).detach().numpy(), expected, atol=1e-4)
    assert begun.average.updates > 0  # as of a finished training: one step hardly moves it
    for file, wrong in ((WEIGHTS / "segmenter.onnx", "no export of"), (imagenet, "not a readable ONNX file")):
        with pytest.raises(UserError, match=wrong):
            start_from_export(ImageQualityNetwork(), file)


def test_unchecked_training_also_uses_the_validation_sequences(
    tmp_path: Path, imagenet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(train, "read_scenes", lambda *_: [shore(), shore(), shore(is_validation=True)])
    monkeypatch.setattr(train, "measure_fault_levels", lambda *_: LEVELS)
    monkeypatch.setattr(train, "_open_segmenter", lambda *_: None)
    weights = tmp_path / "segmenter.onnx"
    weights.write_bytes(b"a segmenter")
    recipe = train.ImageQualityRecipe(epochs=1, batch=4, per_scene=2, checked=False)
    training = ImageQualityTraining(tmp_path / "run", [], weights, imagenet, recipe)
    assert (len(training.scenes), training.validation) == (3, [])
    training.run()
    assert set(json.loads((tmp_path / "run" / "log.jsonl").read_text())) == {"epoch", "loss"}


def test_seed_epochs_and_rate_are_those_asked_for(tmp_path: Path) -> None:
    given = image_quality_recipe(TrainingOptions(tmp_path, seed=7, epochs=3, peak_rate=1e-4, unchecked=True))
    assert given == train.ImageQualityRecipe(epochs=3, peak_rate=1e-4, seed=7, checked=False)
    assert image_quality_recipe(TrainingOptions(tmp_path)) == train.ImageQualityRecipe()


def test_a_resumed_run_equals_an_unbroken_one_s11(
    tmp_path: Path, imagenet: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(train, "read_scenes", lambda *_: [shore(), shore(), shore(is_validation=True)])
    monkeypatch.setattr(train, "measure_fault_levels", lambda *_: LEVELS)
    monkeypatch.setattr(train, "VALIDATION_LEVELS", 2)
    segmenter = WEIGHTS / "segmenter.onnx"
    recipe = train.ImageQualityRecipe(epochs=2, batch=4, per_scene=2)

    ImageQualityTraining(tmp_path / "whole", [], segmenter, imagenet, recipe).run()
    last = load_checkpoint(tmp_path / "whole" / "last.pt")
    broken = ImageQualityTraining(tmp_path / "broken", [], segmenter, imagenet, recipe)
    with monkeypatch.context() as patch:
        patch.setattr(broken.state, "finish_epoch", _stops_after(broken.state.finish_epoch))
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
