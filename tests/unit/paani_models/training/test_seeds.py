"""Training under several seeds, on a miniature."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")

from paani_models.recipes.train_and_export import start_segmenter  # noqa: E402
from paani_models.segmenter import train  # noqa: E402
from paani_models.segmenter.paper_network import PaperSegmenter  # noqa: E402
from paani_models.segmenter.train import CACHE_WH, CachedPicture, SegmenterTraining  # noqa: E402
from paani_models.training.training_state import Stage  # noqa: E402
from tests.places import ROOT  # noqa: E402

pytestmark = pytest.mark.train
RECIPE = train.SegmenterRecipe(stages=(Stage(3, 64, 64),), batch=4, warmup_steps=2)


def striped(rng: np.random.Generator) -> CachedPicture:
    """Sky above bank above water."""
    mask = np.zeros((CACHE_WH[1], CACHE_WH[0]), np.uint8)
    top, bank = sorted(int(y) for y in rng.integers(40, 240, 2))
    mask[:top], mask[top:bank] = 2, 1
    return CachedPicture("river", np.array([[30, 60, 90], [40, 90, 30], [200, 210, 230]], np.uint8)[mask], mask)


@pytest.mark.slow
def test_w8_every_seed_learns_and_gives_its_own_network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """W8: the seed is the recipe's. Three seeds give three networks whose loss falls; one seed repeats its network."""
    monkeypatch.setitem(train.DRAWS_PER_EPOCH, "river", 7)
    pictures = [striped(np.random.default_rng(k)) for k in range(6)]

    def losses(name: str, seed: int) -> list[float]:
        torch.manual_seed(seed)
        SegmenterTraining(PaperSegmenter(), replace(RECIPE, seed=seed), tmp_path / name, pictures, pictures[:2]).run()
        lines = (tmp_path / name / "epochs.jsonl").read_bytes().splitlines()
        return [msgspec.json.decode(line)["loss"] for line in lines]

    found = {seed: losses(str(seed), seed) for seed in (1, 2, 3)}
    assert all(curve[-1] < curve[0] for curve in found.values())
    assert len({tuple(curve) for curve in found.values()}) == 3
    assert losses("again", 2) == found[2]
    orders = [train.draw_epoch(pictures, replace(RECIPE, seed=seed), 0) for seed in (1, 2, 3)]
    assert len({tuple(order) for order in orders}) == 3


@pytest.mark.slow
def test_w8_a_segmenter_begins_with_the_weights_of_its_seed(tmp_path: Path) -> None:
    first, again, other = (start_segmenter("paper", tmp_path, seed).state_dict() for seed in (1, 1, 2))
    drawn = {name for name, weight in first.items() if not torch.equal(weight, other[name])}
    assert any(name.endswith("weight") for name in drawn)
    assert all(torch.equal(weight, again[name]) for name, weight in first.items())


def test_z4_the_spread_of_six_is_stated() -> None:
    text = (ROOT / "models/paani_models/segmenter/README.md").read_text(encoding="utf-8")
    [stated] = [" ".join(part.split()) for part in text.split("\n* ") if "standard deviation" in part]
    assert "42 to 47" in stated
    assert "standard deviation 0.013; edge F1 0.528 to 0.565" in stated
