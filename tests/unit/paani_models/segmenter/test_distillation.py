"""The teacher: its shape, its start, and what the segmenter takes from it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")

from paani.errors import UserError  # noqa: E402
from paani_models.commands.models import data_folder  # noqa: E402
from paani_models.recipes.train_and_export import IMAGENET_FILE  # noqa: E402
from paani_models.segmenter.distillation import Distillation, kl_divergence, standardise_channels  # noqa: E402
from paani_models.segmenter.paper_network import PaperSegmenter  # noqa: E402
from paani_models.segmenter.shipped_network import ENCODER_SCALE, TAP_CHANNELS, ShippedSegmenter, load_imagenet_encoder  # noqa: E402

pytestmark = pytest.mark.train

IMAGENET = data_folder() / IMAGENET_FILE


def test_the_imagenet_segmenter_has_the_segmenters_contract() -> None:
    teacher = ShippedSegmenter().eval()
    x = torch.zeros(1, 3, 256, 320)
    height = 256 * ENCODER_SCALE
    assert [(t.shape[1], int(height // t.shape[2])) for t in teacher.taps(x)] == [
        (channels, stride if stride < 32 else 35) for channels, stride in zip(TAP_CHANNELS, (4, 8, 16, 32), strict=True)
    ]
    assert tuple(teacher(x).shape) == (1, 3, 256, 320)


def test_equal_logits_have_zero_divergence() -> None:
    logits = torch.randn(1, 3, 8, 8, generator=torch.Generator().manual_seed(0))
    assert float(kl_divergence(logits, logits)) == pytest.approx(0.0, abs=1e-6)
    assert float(kl_divergence(logits, logits + 5.0)) == pytest.approx(0.0, abs=1e-5)
    assert float(kl_divergence(logits, -logits)) > 0.1


def test_kl_divergence_by_hand() -> None:
    """Teacher sure of one of two classes, student undecided: log 2."""
    answer = torch.tensor([50.0, 0.0, -50.0]).view(1, 3, 1, 1)
    logits = torch.tensor([0.0, 0.0, -50.0]).view(1, 3, 1, 1)
    assert float(kl_divergence(logits, answer)) == pytest.approx(np.log(2), abs=1e-5)


def test_standardised_features() -> None:
    features = standardise_channels(torch.randn(4, 5, 6, 7, generator=torch.Generator().manual_seed(0)) * 9 + 3)
    assert torch.allclose(features.mean((0, 2, 3)), torch.zeros(5), atol=1e-5)
    assert torch.allclose(features.std((0, 2, 3)), torch.ones(5), atol=1e-3)


@pytest.mark.train
def test_the_teacher_stays_and_the_segmenter_moves_towards_it() -> None:
    torch.manual_seed(0)
    teacher, student = ShippedSegmenter(), PaperSegmenter()
    before = {name: value.clone() for name, value in teacher.state_dict().items()}
    distillation = Distillation(teacher)
    optimiser = torch.optim.Adam([*student.parameters(), *distillation.parameters()], 1e-3)
    pictures = torch.rand(2, 3, 64, 64)
    distances = []
    for _ in range(8):
        _, distance = distillation(pictures, student)
        optimiser.zero_grad()
        torch.autograd.backward(distance)
        optimiser.step()
        distances.append(distance.item())
    assert distances[-1] < 0.9 * distances[0]
    assert all(torch.equal(value, before[name]) for name, value in teacher.state_dict().items())
    assert not any(key.startswith("teacher") for key in distillation.state_dict())


def test_a_file_that_is_no_encoder_is_named(tmp_path: Path) -> None:
    arrays: dict[str, Any] = {"conv00.weight": np.zeros((1, 1, 1, 1)), "conv00.bias": np.zeros(1)}
    np.savez(tmp_path / "other.npz", **arrays)
    with pytest.raises(UserError, match=r"other\.npz: conv00 has shape"):
        load_imagenet_encoder(ShippedSegmenter(), tmp_path / "other.npz")


@pytest.mark.data
@pytest.mark.skipif(not IMAGENET.is_file(), reason=f"no {IMAGENET}; set PAANI_DATA")
def test_imagenet_start_fills_the_encoder_and_freezes_its_first_stages() -> None:
    teacher = ShippedSegmenter()
    load_imagenet_encoder(teacher, IMAGENET)
    assert not any(p.requires_grad for p in teacher.stem.parameters())
    assert all(p.requires_grad for p in teacher.stages[-1].parameters())
    assert float(teacher.stem.conv.weight.abs().max()) > 1.0
