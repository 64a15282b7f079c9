"""The best epoch by validation is kept; the last is not put in its place (S9)."""

from pathlib import Path

import pytest

torch = pytest.importorskip("torch")

from paani_models.training.training_state import TrainingState, load_checkpoint  # noqa: E402

pytestmark = pytest.mark.train


def finished(folder: Path, scores: list[float]) -> TrainingState:
    """A run whose only weight counts the epochs."""
    progress = TrainingState(torch.nn.Linear(1, 1, bias=False), 1e-3, 0.0)
    for epoch, score in enumerate(scores, 1):
        progress.average.model.weight.data.fill_(epoch)
        progress.finish_epoch(folder, {}, score)
    return progress


@pytest.mark.parametrize(
    ("scores", "best"),
    [([0.2, 0.9, 0.5, 0.8], 2), ([0.1, 0.2, 0.3], 3), ([0.3, 0.2, 0.1], 1), ([0.3, 0.3], 1), ([0.0, -1.0], 1)],
)
def test_best_is_the_epoch_with_the_highest_validation_score_s9(tmp_path: Path, scores: list[float], best: int) -> None:
    finished(tmp_path, scores)
    kept, last = (load_checkpoint(tmp_path / f"{name}.pt") for name in ("best", "last"))
    assert kept["average"]["weight"].item() == kept["epoch"] == best
    assert last["average"]["weight"].item() == last["epoch"] == len(scores)


def test_a_resumed_run_still_knows_its_best_s9(tmp_path: Path) -> None:
    finished(tmp_path, [0.2, 0.9, 0.5])
    resumed = TrainingState(torch.nn.Linear(1, 1, bias=False), 1e-3, 0.0)
    resumed.resume(tmp_path, {})
    resumed.finish_epoch(tmp_path, {}, 0.6)
    assert load_checkpoint(tmp_path / "best.pt")["epoch"] == 2


def test_a_resumed_run_draws_what_an_unbroken_one_draws_s11(tmp_path: Path) -> None:
    """S11: the random numbers go on where the last finished epoch left them."""
    torch.manual_seed(7)
    finished(tmp_path, [0.2, 0.9])
    unbroken = torch.rand(4)
    torch.manual_seed(999)
    TrainingState(torch.nn.Linear(1, 1, bias=False), 1e-3, 0.0).resume(tmp_path, {})
    assert torch.equal(torch.rand(4), unbroken)


@pytest.mark.slow
def test_s11_what_is_trained_beside_the_model_is_resumed_too(tmp_path: Path) -> None:
    """The part that a distillation trains."""

    def state(weight: float) -> TrainingState:
        beside = torch.nn.Linear(1, 1, bias=False)
        torch.nn.init.constant_(beside.weight, weight)
        return TrainingState(torch.nn.Linear(1, 1, bias=False), 1e-3, 0.0, beside)

    state(0.25).finish_epoch(tmp_path, {}, 0.5)
    resumed = state(0.75)
    resumed.resume(tmp_path, {})
    assert resumed.extra.state_dict()["weight"].item() == 0.25
