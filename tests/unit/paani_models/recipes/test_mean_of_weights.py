"""Weights that are the mean of two trainings."""

import copy
from functools import partial
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")
pytest.importorskip("onnx", reason="needs the extra paani[train]")

from paani_models.catalogue import verified_path  # noqa: E402
from paani_models.detector.shipped_network import Detector  # noqa: E402
from paani_models.image_quality.network import ImageQualityNetwork, start_from_export  # noqa: E402
from paani_models.recipes.onnx_export import export_network  # noqa: E402
from paani_models.recipes.train_and_export import TrainingOptions, start_detector, take_share  # noqa: E402
from paani_models.recipes.warm_start import load_exported  # noqa: E402
from paani_models.training.training_state import save_checkpoint  # noqa: E402

pytestmark = pytest.mark.train


def test_a_detector_may_start_from_the_mean_of_two(tmp_path: Path) -> None:
    """A checkpoint and an exported file."""
    stored = Detector()
    save_checkpoint(tmp_path / "a.pt", {"average": stored.state_dict()})
    options = TrainingOptions(tmp_path, start=tmp_path / "a.pt", mean_with=verified_path("detector"))
    mean = start_detector(tmp_path, options).dark4[0][0].conv.weight
    alone = [
        start_detector(tmp_path, TrainingOptions(tmp_path, start=path)).dark4[0][0].conv.weight
        for path in (options.start, options.mean_with)
    ]
    assert not torch.equal(*alone)
    torch.testing.assert_close(mean, (alone[0] + alone[1]) / 2)


def test_an_image_quality_check_takes_its_share_of_an_earlier_one() -> None:
    mixed, earlier = ImageQualityNetwork(), ImageQualityNetwork()
    start_from_export(earlier, verified_path("gate"))
    before = copy.deepcopy(mixed.state_dict())
    take_share(mixed, verified_path("gate"), 0.25)
    for name, weight in mixed.state_dict().items():
        torch.testing.assert_close(weight, 0.75 * before[name] + 0.25 * earlier.state_dict()[name])


def test_a_detector_is_exported_with_a_share_of_earlier_weights(tmp_path: Path) -> None:
    earlier, later, loaded = Detector(), Detector(), Detector()
    recipe = {"seed": 1, "height_px": 64, "width_px": 96}
    save_checkpoint(tmp_path / "earlier.pt", {"average": earlier.state_dict()})
    save_checkpoint(tmp_path / "later.pt", {"average": later.state_dict(), "recipe": recipe})
    inputs = [np.random.default_rng(0).random((1, 3, 64, 96), dtype=np.float32)]
    change = partial(take_share, path=tmp_path / "earlier.pt", share=0.25)
    export_network("detector", tmp_path / "later.pt", tmp_path, inputs, (), change=change)
    load_exported(loaded, tmp_path / "detector.onnx", torch.zeros(1, 3, 64, 96))
    wanted = 0.25 * earlier.stem.conv.weight + 0.75 * later.stem.conv.weight
    torch.testing.assert_close(loaded.stem.conv.weight, wanted)
