"""The training of the YOLO11n-shaped detector, number by number (S2 - S5, S10)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")

from paani_models.detector import train_paper_network  # noqa: E402
from paani_models.detector.data import BoxedPicture  # noqa: E402
from paani_models.detector.paper_data import (  # noqa: E402
    Augmentation,
    _flip_randomly,
    _random_scale_and_shift,
    augment_paper_example,
)
from paani_models.detector.paper_network import Yolo11n  # noqa: E402
from paani_models.detector.train_paper_network import Yolo11nRecipe, Yolo11nTraining  # noqa: E402
from paani_models.recipes.train_and_export import start_yolo11n  # noqa: E402
from paani_models.training.training_state import save_checkpoint  # noqa: E402
from tests.unit.paani_models.training.noted_workers import note_workers  # noqa: E402

pytestmark = [pytest.mark.train, pytest.mark.slow]
SHORT = Yolo11nRecipe(side_px=64, batch=2)


def drawn_pictures(count: int) -> list[BoxedPicture]:
    """Grey scenes with a block of one class each."""
    pictures = []
    for number in range(count):
        rgb = np.full((48, 64, 3), 90, np.uint8)
        rgb[10:34, 16:48] = 40 * number + 100
        box = np.array([[number % 4, 0.25, 10 / 48, 0.75, 34 / 48]], np.float32)
        pictures.append(BoxedPicture("rendered", rgb, box, np.ones(4, np.uint8)))
    return pictures


def training(folder: Path, recipe: Yolo11nRecipe, monkeypatch: pytest.MonkeyPatch) -> Yolo11nTraining:
    monkeypatch.setattr(train_paper_network, "SIZE_WH", (64, 64))
    torch.manual_seed(0)
    pictures = drawn_pictures(4)
    return Yolo11nTraining(Yolo11n(), recipe, folder, pictures, pictures)


def test_s2_a_batch_is_32_squares_of_320_px(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = training(tmp_path, Yolo11nRecipe(), monkeypatch)
    pictures, truths, _ = run._batch([0, 1, 2, 3], 0, (42, 0))
    assert tuple(pictures.shape) == (32, 3, 320, 320)
    assert len(truths) == 32


def test_s2_s3_the_first_epoch_is_by_the_papers_recipe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four workers, AdamW, and a third of a warm-up that takes three epochs: two steps of six."""
    asked = note_workers(monkeypatch, train_paper_network)
    run = training(tmp_path, SHORT, monkeypatch)
    run.run(until=1)
    assert asked == [4]
    assert type(run.state.optimiser) is torch.optim.AdamW
    groups = {group["kind"]: group for group in run.state.optimiser.param_groups}
    rate = 1e-3 * 2 / 6
    assert groups["weight"]["lr"] == pytest.approx(rate)
    assert groups["bias"]["lr"] == pytest.approx(5 / 6 * 0.1 + 1 / 6 * rate)
    assert groups["weight"]["betas"][0] == pytest.approx(0.8 + 1 / 6 * 0.137)


def test_s2_s4_s10_all_60_epochs_are_completed_and_recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The last two are trained here, as if 58 had been, each better than the one before."""
    run = training(tmp_path, SHORT, monkeypatch)
    rows = [{"epoch": epoch, "score": 0.01 * epoch} for epoch in range(1, 59)]
    (tmp_path / "epochs.jsonl").write_bytes(b"".join(msgspec.json.encode(row) + b"\n" for row in rows))
    run.state.epoch = 58
    run.run()
    recorded = [msgspec.json.decode(line) for line in (tmp_path / "epochs.jsonl").read_bytes().splitlines()]
    assert [row["epoch"] for row in recorded] == list(range(1, 61))
    for row in recorded[58:]:
        assert {"box_loss", "score_loss", "bins_loss"} <= row.keys()
        assert all({"ap50", "ap50_95", "n"} <= row[label].keys() for label in ("person", "vessel", "pier", "buoy"))
        assert all({"recall_at_0.40", "precision_at_0.40"} <= row[label].keys() for label in ("person", "buoy"))


def test_s5_every_example_is_a_mosaic_of_four_until_the_last_ten_epochs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes: list[int] = []

    def augment_noting(rng: Any, items: list[BoxedPicture], target_wh: tuple[int, int], gains: Augmentation) -> Any:
        sizes.append(len(items))
        return augment_paper_example(rng, items, target_wh, gains)

    monkeypatch.setattr(train_paper_network, "augment_paper_example", augment_noting)
    run = training(tmp_path, SHORT, monkeypatch)
    for epoch in (0, 49, 50, 59):
        run.state.epoch = epoch
        for slot in range(10):
            run._example(np.random.default_rng(slot), [0, 1, 2, 3], slot)
    assert sizes == [4] * 20 + [1] * 20


@pytest.mark.parametrize("has_bfloat16", [True, False])
def test_s4_mixed_precision_is_used_where_the_machine_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_bfloat16: bool
) -> None:
    monkeypatch.setattr("paani_models.training.training_state._multiplies_bfloat16", lambda: has_bfloat16)
    run, kinds = training(tmp_path, SHORT, monkeypatch), set()
    run.model.stem[0].conv.register_forward_hook(lambda _module, _inputs, output: kinds.add(output.dtype))
    run._train_epoch()
    assert kinds == {torch.bfloat16 if has_bfloat16 else torch.float32}


def test_s4_a_training_asks_for_algorithms_that_repeat_their_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, asked = training(tmp_path, SHORT, monkeypatch), set()
    run.model.stem[0].register_forward_hook(lambda *_: asked.add(torch.are_deterministic_algorithms_enabled()))
    run.run(until=1)
    assert asked == {True}
    assert not torch.are_deterministic_algorithms_enabled()


def test_s2_a_training_begins_with_the_weights_of_start_or_those_of_its_seed(tmp_path: Path) -> None:
    known = Yolo11n()
    save_checkpoint(tmp_path / "known.pt", {"average": known.state_dict()})
    started = start_yolo11n(1, tmp_path / "known.pt").state_dict()
    assert all(torch.equal(weight, started[name]) for name, weight in known.state_dict().items())
    first, again, other = (start_yolo11n(seed, None).stem[0].conv.weight for seed in (1, 1, 2))
    assert torch.equal(first, again)
    assert not torch.equal(first, other)


def test_s4_the_seed_draws_the_order_of_an_epoch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And what the augmentation of its pictures draws."""

    def drawn(name: str, seed: int) -> list[Any]:
        run = training(tmp_path / name, replace(SHORT, seed=seed), monkeypatch)
        batches: list[Any] = []
        batch_of = run._batch

        def batch_noting(order: list[int], index: int, place: tuple[int, int]) -> Any:
            batches.append((index, order, place))
            return batch_of(order, index, place)

        monkeypatch.setattr(run, "_batch", batch_noting)
        run._train_epoch()
        return sorted(batches)

    assert SHORT.seed == 42
    for seed in (42, 43):
        order = np.random.default_rng((seed, 0)).permutation(4).tolist()
        assert drawn(str(seed), seed) == [(index, order, (seed, 0)) for index in range(2)]


def test_s5_scale_and_shift_reach_their_gains_either_way_and_no_more() -> None:
    """The middle of the picture comes to within a tenth of the size of the target's, its scale to within 0.3 of 1."""
    size, middle = (320, 256), np.array([160.0, 128.0])
    affines = [_random_scale_and_shift(np.random.default_rng(k), middle, size, Augmentation()) for k in range(400)]
    scales = [affine[0, 0] for affine in affines]
    assert (min(scales), max(scales)) == pytest.approx((0.7, 1.3), abs=0.01)
    assert 0.7 <= min(scales) <= max(scales) <= 1.3
    assert all(affine[0, 1] == affine[1, 0] == 0.0 and affine[0, 0] == affine[1, 1] for affine in affines)
    shifts = np.array([(affine[:, :2] @ middle + affine[:, 2] - middle) / size for affine in affines])
    assert shifts.min(0) == pytest.approx([-0.1, -0.1], abs=0.005)
    assert shifts.max(0) == pytest.approx([0.1, 0.1], abs=0.005)
    assert np.abs(shifts).max() <= 0.1 + 1e-6


def test_s5_every_second_picture_is_turned_left_to_right_and_none_upside_down() -> None:
    rng, fit = np.random.default_rng(0), np.array([[2, 0, 5], [0, 2, 7]], np.float32)
    flipped = [_flip_randomly(rng, fit, 64, Augmentation()) for _ in range(1000)]
    assert np.mean([affine[0, 0] < 0 for affine in flipped]) == pytest.approx(0.5, abs=0.05)
    assert all(np.array_equal(affine[1], fit[1]) for affine in flipped)


def test_s5_every_second_picture_of_a_mosaic_is_turned_left_to_right() -> None:
    """In the middle each goes from black to white, or once turned from white to black; its rims are grey."""
    rgb = np.full((64, 64, 3), 100, np.uint8)
    rgb[:, 16:32], rgb[:, 32:48] = 0, 250
    item = BoxedPicture("rendered", rgb, np.zeros((0, 5), np.float32), np.ones(4, np.uint8))
    plain = Augmentation(hue=0.0, saturation=0.0, value=0.0, translate_frac=0.0, scale=0.0)
    turned = []
    for seed in range(200):
        example = augment_paper_example(np.random.default_rng(seed), [item] * 4, (64, 64), plain)
        for row in example.picture[[2, 61], :, 0].astype(int):
            steps = row[2:] - row[:-2]
            turned += [False] * bool(steps.max() > 180) + [True] * bool(steps.min() < -180)
    assert len(turned) > 300
    assert np.mean(turned) == pytest.approx(0.5, abs=0.07)
