"""Train the YOLO11n-shaped detector by the paper's recipe (S2 - S5); resumable after any epoch."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path

import msgspec
import numpy as np
import torch
from torch import Tensor, nn
from tqdm import tqdm

from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani_models.detector.data import BoxedPicture, TrainingExample
from paani_models.detector.paper_data import Augmentation, augment_paper_example
from paani_models.detector.paper_loss import task_aligned_loss
from paani_models.detector.paper_network import Yolo11n
from paani_models.detector.train import Batch, figures_by_class, mean_ap50, stack_examples
from paani_models.network_input import SIZE_WH
from paani_models.training.training_state import (
    Prefetch,
    TrainingState,
    append_record,
    deterministic_algorithms,
    learning_rate,
    mixed_precision,
    to_device,
    training_device,
)


@dataclass(frozen=True)
class Yolo11nRecipe:
    """Everything that decides a training besides the pictures. The figures are the paper's."""

    epochs: int = 60  # S2
    batch: int = 32  # S2
    workers: int = 4  # S2
    side_px: int = 320  # S2: square
    peak_rate: float = 1e-3  # S3
    weight_decay: float = 5e-4  # S3
    warmup_epochs: float = 3.0  # S3
    momentum: float = 0.937  # S3: first moment of AdamW
    warmup_momentum: float = 0.8  # S3
    warmup_bias_rate: float = 0.1  # S3
    nominal_batch: int = 64  # S3: gradients are added up to about as many pictures
    plain_epochs: int = 10  # S5: the last epochs, without mosaic
    patience: int = 12  # S4: epochs without a better one
    seed: int = 42  # S4
    augmentation: Augmentation = field(default_factory=Augmentation)  # S5


class _Row(msgspec.Struct):
    epoch: int
    score: float


class Yolo11nTraining:
    """One training run in `folder`: `run()` goes on from its last finished epoch."""

    def __init__(
        self,
        model: Yolo11n,
        recipe: Yolo11nRecipe,
        folder: Path,
        train: list[BoxedPicture],
        held_out: list[BoxedPicture],
    ) -> None:
        self.recipe, self.folder, self.train, self.held_out = recipe, folder, train, held_out
        folder.mkdir(parents=True, exist_ok=True)
        self.model = model
        self.state = TrainingState(model, recipe.peak_rate, recipe.weight_decay)
        self.state.optimiser = torch.optim.AdamW(
            _parameter_groups(model, recipe), recipe.peak_rate, betas=(recipe.momentum, 0.999)
        )

    @deterministic_algorithms()
    def run(self, until: int | None = None) -> None:
        """Train to the end, to epoch `until`, or until the figures no longer rise; Ctrl-C loses no finished epoch."""
        recipe = asdict(self.recipe)
        self.state.resume(self.folder, recipe)
        last = self.recipe.epochs if until is None else until
        while self.state.epoch < last and self._since_best() < self.recipe.patience:
            losses = self._train_epoch()
            figures = figures_by_class(self.state.average.model, self.held_out, SIZE_WH)
            score = round(mean_ap50(figures), 4)
            row = {"epoch": self.state.epoch + 1, "score": score, **losses, **figures}
            append_record(self._records(), row)
            self.state.finish_epoch(self.folder, recipe, score)

    def _records(self) -> Path:
        return self.folder / "epochs.jsonl"

    def _since_best(self) -> int:
        """Finished epochs since the first of the best."""
        if self.state.epoch == 0:
            return 0
        try:
            rows = [msgspec.json.decode(line, type=_Row) for line in self._records().read_bytes().splitlines()]
        except UNREADABLE as error:
            raise UserError(f"{self._records()}: {error}") from error
        scores = {row.epoch: row.score for row in rows if row.epoch <= self.state.epoch}
        return self.state.epoch - max(scores, key=lambda epoch: (scores[epoch], -epoch))

    def _train_epoch(self) -> dict[str, float]:
        recipe, epoch = self.recipe, self.state.epoch
        order = np.random.default_rng((recipe.seed, epoch)).permutation(len(self.train)).tolist()
        steps = max(1, len(order) // recipe.batch)
        warmup_steps = max(1, round(recipe.warmup_epochs * steps))
        cv_seed = (recipe.seed, epoch)
        self.model.train()
        losses = []
        batches = Prefetch[Batch](recipe.workers)(lambda i: self._batch(order, i, cv_seed), steps)
        for index, (pictures, truths, judged) in enumerate(tqdm(batches, f"epoch {epoch + 1}/{recipe.epochs}", steps)):
            with mixed_precision():
                boxes, bins, logits = self.model.raw(to_device(pictures))
            known = [truth.to(training_device()) for truth in truths]
            size = (recipe.side_px, recipe.side_px)
            parts = task_aligned_loss(boxes.float(), bins.float(), logits.float(), known, to_device(judged), size)
            self._update(sum(parts), index == steps - 1, steps * recipe.epochs, warmup_steps)
            losses.append([float(part.detach()) for part in parts])
        box, score, spread = np.mean(losses, 0).round(4).tolist()
        return {"box_loss": box, "score_loss": score, "bins_loss": spread}

    def _update(self, loss: Tensor, is_last: bool, total_steps: int, warmup_steps: int) -> None:
        """Add gradients up; step when about `nominal_batch` pictures are in, more often while warming up."""
        recipe, state = self.recipe, self.state
        warm = min(1.0, state.step / warmup_steps)
        rate = learning_rate(recipe.peak_rate, state.step, total_steps, warmup_steps)
        for group in state.optimiser.param_groups:
            bias = group["kind"] == "bias"
            group["lr"] = (1.0 - warm) * recipe.warmup_bias_rate + warm * rate if bias else rate
            group["betas"] = (recipe.warmup_momentum + warm * (recipe.momentum - recipe.warmup_momentum), 0.999)
        every = max(1, round(1.0 + warm * (recipe.nominal_batch / recipe.batch - 1.0)))
        torch.autograd.backward(loss)
        state.step += 1
        if state.step % every and not is_last:
            return
        nn.utils.clip_grad_norm_(self.model.parameters(), 10.0)
        state.optimiser.step()
        state.optimiser.zero_grad(set_to_none=True)
        state.average.update(self.model)

    def _batch(self, order: list[int], index: int, seed: tuple[int, int]) -> Batch:
        slots = range(index * self.recipe.batch, (index + 1) * self.recipe.batch)
        examples = [self._example(np.random.default_rng((*seed, slot)), order, slot) for slot in slots]
        return stack_examples(examples)

    def _example(self, rng: np.random.Generator, order: list[int], slot: int) -> TrainingExample:
        recipe = self.recipe
        chosen = [order[slot % len(order)]]
        late = self.state.epoch >= recipe.epochs - recipe.plain_epochs
        if not late and rng.random() < recipe.augmentation.mosaic_frac:
            chosen += [order[int(i)] for i in rng.integers(len(order), size=3)]
        pictures = [self.train[i] for i in chosen]
        return augment_paper_example(rng, pictures, (recipe.side_px, recipe.side_px), recipe.augmentation)


def _parameter_groups(model: Yolo11n, recipe: Yolo11nRecipe) -> list[dict[str, object]]:
    """Weights, which decay; normalisation scales and biases, which do not; biases warm up from above (S3)."""
    kinds: dict[str, list[nn.Parameter]] = {"weight": [], "scale": [], "bias": []}
    for name, parameter in model.named_parameters():
        if parameter.requires_grad:
            kind = "bias" if name.endswith("bias") else "scale" if parameter.dim() == 1 else "weight"
            kinds[kind].append(parameter)
    decay = {"weight": recipe.weight_decay}
    return [{"params": p, "kind": kind, "weight_decay": decay.get(kind, 0.0)} for kind, p in kinds.items()]
