"""The paper's segmenter and its training, number by number (D4, D8, S6, S7, Z4)."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")

from paani.errors import UserError  # noqa: E402
from paani_models.catalogue import verified_path  # noqa: E402
from paani_models.recipes import train_and_export  # noqa: E402
from paani_models.recipes.train_and_export import TrainingOptions, segmenter_recipe  # noqa: E402
from paani_models.segmenter import train  # noqa: E402
from paani_models.segmenter.paper_network import PaperSegmenter, segmenter_loss  # noqa: E402
from paani_models.segmenter.train import CACHE_WH, PAPER_RECIPE, CachedPicture, SegmenterTraining  # noqa: E402
from paani_models.training.training_state import Stage  # noqa: E402
from tests.unit.paani_models.training.noted_workers import note_workers  # noqa: E402

pytestmark = [pytest.mark.train, pytest.mark.slow]
SHORT = replace(PAPER_RECIPE, stages=(Stage(2, 64, 64),), batch=2)


def drawn_pictures(count: int) -> list[CachedPicture]:
    rng = np.random.default_rng(0)
    width, height = CACHE_WH
    return [
        CachedPicture(
            "river",
            rng.integers(0, 255, (height, width, 3)).astype(np.uint8),
            rng.integers(0, 3, (height, width)).astype(np.uint8),
        )
        for _ in range(count)
    ]


def test_d4_d8_the_output_is_the_heads_each_value_four_times_either_way() -> None:
    torch.manual_seed(0)
    network, scores = PaperSegmenter().eval(), []
    network.head.register_forward_hook(lambda _module, _inputs, output: scores.append(output))
    with torch.no_grad():
        answer = network(torch.rand(1, 3, 256, 320))
    assert torch.equal(scores[0].repeat_interleave(4, 2).repeat_interleave(4, 3), answer)


def test_s6_s7_every_step_of_two_epochs_is_by_the_papers_recipe(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four workers; half a cosine over all steps; decay of the weights."""
    assert segmenter_recipe("paper-segmenter", TrainingOptions(tmp_path)) == PAPER_RECIPE
    asked = note_workers(monkeypatch, train)
    pictures = drawn_pictures(4)
    training = SegmenterTraining(PaperSegmenter(), SHORT, tmp_path, pictures, pictures[:1])
    rates: list[float] = []
    update: Any = training.state.update

    def update_noting(loss: Any, rate: float, clip_norm: float) -> None:
        rates.append(rate)
        update(loss, rate, clip_norm)

    monkeypatch.setattr(training.state, "update", update_noting)
    training.run()
    assert asked == [4, 4]
    assert rates == pytest.approx([3e-4 * 0.5 * (1.0 + math.cos(math.pi * step / 4)) for step in range(4)])
    assert {group["weight_decay"] for group in training.state.optimiser.param_groups} == {1e-4}


@pytest.mark.parametrize("has_bfloat16", [True, False])
def test_s7_mixed_precision_is_used_where_the_machine_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_bfloat16: bool
) -> None:
    monkeypatch.setattr("paani_models.training.training_state._multiplies_bfloat16", lambda: has_bfloat16)
    network, kinds = PaperSegmenter(), set()
    network.head.register_forward_hook(lambda _module, _inputs, output: kinds.add(output.dtype))
    pictures = drawn_pictures(2)
    training = SegmenterTraining(network, replace(SHORT, stages=(Stage(1, 64, 64),)), tmp_path, pictures, pictures[:1])
    monkeypatch.setattr(training, "validate", lambda: {"miou": 0.0})
    training.run()
    assert kinds == {torch.bfloat16 if has_bfloat16 else torch.float32}


def test_s7_the_loss_is_cross_entropy_and_dice_of_what_is_labelled() -> None:
    """Three pixels, the last of which nobody labelled: it counts for neither."""
    shares = torch.tensor([[0.7, 0.2, 0.1], [0.2, 0.5, 0.3], [0.1, 0.1, 0.8]])
    loss = segmenter_loss(torch.log(shares).T.reshape(1, 3, 1, 3), torch.tensor([[[0, 1, 255]]]))
    dice = [(2.0 * overlap + 1.0) / (total + 1.0) for overlap, total in ((0.7, 1.9), (0.5, 1.7), (0.0, 0.4))]
    assert loss.item() == pytest.approx(-(math.log(0.7) + math.log(0.5)) / 2.0 + 1.0 - sum(dice) / 3.0)


def test_z4_the_seed_asked_for_draws_the_first_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """0 is a seed as well."""
    assert segmenter_recipe("paper-segmenter", TrainingOptions(tmp_path, seed=0)).seed == 0
    drawn = []

    class Enough(Exception):
        """The weights are known; nothing is trained."""

    def stop(model: Any, *_more: Any) -> None:
        drawn.append(torch.nn.utils.parameters_to_vector(model.parameters()).detach().clone())
        raise Enough

    monkeypatch.setattr(train_and_export, "SegmenterTraining", stop)
    monkeypatch.setattr(train_and_export, "cache_pictures", list)
    pictures: Any = SimpleNamespace(data=tmp_path, segmented_samples=lambda held_out: [])
    for seed in (0, 42, 42):
        with pytest.raises(Enough):
            train_and_export._train_segmenter("paper-segmenter", pictures, TrainingOptions(tmp_path, seed=seed))
    assert torch.equal(drawn[1], drawn[2])
    assert not torch.equal(drawn[0], drawn[1])


def test_an_epoch_of_less_than_a_batch_is_refused(tmp_path: Path) -> None:
    training = SegmenterTraining(PaperSegmenter(), replace(SHORT, batch=7), tmp_path, drawn_pictures(6), [])
    with pytest.raises(UserError, match=r"^sources: 6 pictures an epoch, and a batch has 7"):
        training.run()
    assert list(tmp_path.iterdir()) == []


def test_a_few_pictures_suffice_to_begin_from_an_exported_segmenter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[int] = []
    monkeypatch.setattr(train_and_export, "cache_pictures", lambda samples: drawn_pictures(6))
    monkeypatch.setattr(train_and_export, "load_exported", lambda model, path, batch: seen.append(len(batch)))
    monkeypatch.setattr(SegmenterTraining, "run", lambda training: None)
    pictures: Any = SimpleNamespace(data=tmp_path, segmented_samples=lambda held_out: [])
    options = TrainingOptions(tmp_path / "run", start=verified_path("segmenter"))
    train_and_export.train_network("paper-segmenter", pictures, options, 1)
    assert seen == [6]


def test_a_file_that_a_training_begins_from_is_opened_before_pictures_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(train_and_export, "cache_pictures", lambda samples: pytest.fail("pictures were read"))
    pictures: Any = SimpleNamespace(data=tmp_path, segmented_samples=lambda held_out: [])
    for name in ("bad.pt", "bad.onnx"):
        (tmp_path / name).write_text("text")
        options = TrainingOptions(tmp_path / "run", start=tmp_path / name)
        with pytest.raises(UserError, match=f"{name}: not a readable"):
            train_and_export.train_network("paper-segmenter", pictures, options, 1)
