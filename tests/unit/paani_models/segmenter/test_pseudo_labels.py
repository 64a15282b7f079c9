"""Machine-made masks: only sure answers, and never water where a box says that something is."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")

from pathlib import Path  # noqa: E402

from torch import Tensor, nn  # noqa: E402

from paani_models.datasets.sources import IGNORE, Sample, Source  # noqa: E402
from paani_models.segmenter.pseudo_labels import ignore_box_cores, pseudo_label_pictures  # noqa: E402
from paani_models.segmenter.train import CACHE_WH, UNSEGMENTED, CachedPicture  # noqa: E402

pytestmark = pytest.mark.train


class SureBelow(nn.Module):  # type: ignore[misc]
    """Sky above; below, water where the picture is dark, else undecided between water and obstacle."""

    def forward(self, x: Tensor) -> Tensor:
        dark = (x.mean(1) < 0).float()
        logits = torch.stack([10 + 10 * dark, 10 - 10 * dark, torch.zeros_like(dark)], 1)
        logits[:, :, :128] = torch.tensor([0.0, 0.0, 20.0]).view(1, 3, 1, 1)
        return logits


def test_only_confident_predictions_become_labels_and_drawn_masks_stay() -> None:
    width, height = CACHE_WH
    picture = np.zeros((height, width, 3), np.uint8)
    picture[:, width // 2 :] = 255
    drawn = CachedPicture("river", picture, np.full((height, width), 1, np.uint8))
    bare = CachedPicture(UNSEGMENTED, picture, np.full((height, width), IGNORE, np.uint8))
    samples = [Sample(Source("s", "s"), "", False, Path("a.jpg"), None, None)] * 2
    kept, made = pseudo_label_pictures(SureBelow(), [drawn, bare], samples)
    assert kept is drawn
    assert (made.mask[: height // 2 - 2] == 2).all()
    assert (made.mask[height // 2 + 2 :, : width // 2 - 4] == 0).all()
    assert (made.mask[height // 2 + 2 :, width // 2 + 4 :] == IGNORE).all()


def test_the_core_of_a_box_is_never_water() -> None:
    mask = np.zeros((100, 100), np.uint8)
    mask[50:] = 1
    cleaned = ignore_box_cores(mask, np.array([[1, 0.2, 0.2, 0.8, 0.8]], np.float32))
    assert (cleaned[33:50, 33:67] == IGNORE).all()
    assert (cleaned[50:] == 1).all()
    assert (cleaned[:30] == 0).all()
    assert mask[40, 50] == 0
