"""A training of the shipped detector that was broken off and goes on (S11)."""

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")

from paani_models.detector import train  # noqa: E402
from paani_models.detector.data import BoxedPicture  # noqa: E402
from paani_models.detector.shipped_network import Detector  # noqa: E402
from paani_models.training.training_state import load_checkpoint  # noqa: E402

pytestmark = [pytest.mark.train, pytest.mark.slow]
RECIPE = train.DetectorRecipe(epochs=2, batch=2, warmup_steps=1, height_px=64, width_px=96, plain_epochs=1)


def test_s11_a_resumed_detector_equals_an_unbroken_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(train, "NULL_DRAWS", 1)
    picture = np.full((96, 128, 3), 90, np.uint8)
    picture[30:60, 40:90] = (200, 30, 30)
    box = np.array([[1, 40 / 128, 30 / 96, 90 / 128, 60 / 96]], np.float32)
    item = BoxedPicture("mcoe_boats", picture, box, np.array([0, 1, 0, 1], np.uint8))

    def training(name: str) -> train.DetectorTraining:
        torch.manual_seed(0)
        return train.DetectorTraining(Detector(), RECIPE, tmp_path / name, [item] * 3, [item])

    training("whole").run()
    training("broken").run(until=1)
    resumed = training("broken")
    torch.manual_seed(999)
    resumed.run()
    whole, broken = ((tmp_path / name / "epochs.jsonl").read_bytes() for name in ("whole", "broken"))
    assert whole == broken
    one, other = (load_checkpoint(tmp_path / name / "last.pt") for name in ("whole", "broken"))
    for part in ("model", "average"):
        assert all(torch.equal(one[part][key], other[part][key]) for key in one[part])
