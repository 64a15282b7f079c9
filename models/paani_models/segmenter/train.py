"""Train a segmenter by cross-entropy plus Dice, with AdamW, a cosine schedule and averaged weights.

Ours: draws balanced by source, pictures that show nothing labelled obstacle, and pasted walls and banks, so that an
unusable picture or a wall does not read as open water. A run resumes after any epoch with the same result.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import cast

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from tqdm import tqdm

from paani_models.datasets.sources import IGNORE, RENDERED, SEGMENTER_CLASSES, Sample, read_mask, read_picture
from paani_models.network_input import segmenter_batch
from paani_models.segmenter.distillation import Distillation
from paani_models.segmenter.metrics import class_iou, confusion_matrix, count_edge_matches, f1_score
from paani_models.segmenter.paper_augmentation import augment_paper_pair
from paani_models.segmenter.paper_network import segmenter_loss
from paani_models.segmenter.shipped_network import ShippedSegmenter
from paani_models.training.augment import (
    CONCRETE_FRAC,
    LAND_FRAC,
    augment_segmenter_pair,
    crop_land,
    crop_obstacle,
    draw_concrete,
    draw_null_pair,
)
from paani_models.training.training_state import (
    Prefetch,
    Stage,
    TrainingState,
    append_record,
    count_steps,
    learning_rate,
    mixed_precision,
    stage_at_epoch,
    to_device,
)

CACHE_WH = (384, 288)  # size at which pictures and masks are kept in memory [px]
NULL_FRAC = 0.12  # share of pictures that show nothing
PASTE_ATTEMPT_FRAC = 0.9  # share of pictures for which a patch is sought; about one donor in four has one
UNSEGMENTED = "unsegmented"  # name of the pictures of all sources without masks, which a teacher or pseudo-labels label

# Pictures drawn per epoch and source: sources with three human classes weigh more than their number.
DRAWS_PER_EPOCH = {
    "tbiseg_usvinland": 340,
    "tbiseg_tampere": 170,
    "tbiseg_dasha": 130,
    "bath_river": 300,
    "mastr1325": 190,
    "oasis": 170,
    UNSEGMENTED: 600,
}


@dataclass(frozen=True)
class SegmenterRecipe:
    """Everything that decides a segmenter training besides the pictures."""

    stages: tuple[Stage, ...] = (Stage(18, 128, 160), Stage(8, 256, 320))
    batch: int = 16
    peak_rate: float = 2e-3
    weight_decay: float = 1e-4  # S7
    warmup_steps: int = 100
    final_frac: float = 0.01
    rendered_frac: float = 0.2
    seed: int = 42  # S7
    workers: int = 2  # S6: 4
    # Every picture once an epoch, augmented as in the paper (S8); else balanced by source, with pasted walls and nulls.
    as_in_paper: bool = False
    without: tuple[str, ...] = ()  # of the paper's augmentations

    @property
    def epochs(self) -> int:
        """Length of the training."""
        return sum(stage.epochs for stage in self.stages)


# S6, S7: 50 epochs at full size, batches of 16 by 4 workers, AdamW at 3e-4 with a cosine down to nothing.
PAPER_RECIPE = SegmenterRecipe(
    stages=(Stage(50, 256, 320),), peak_rate=3e-4, warmup_steps=0, final_frac=0.0, workers=4, as_in_paper=True
)


@dataclass(frozen=True)
class CachedPicture:
    """A decoded picture and its mask in segmenter classes, both CACHE_WH."""

    source: str
    picture: NDArray[np.uint8]
    mask: NDArray[np.uint8]


def cache_pictures(samples: list[Sample]) -> list[CachedPicture]:
    """Decode pictures and masks once, at CACHE_WH: 3,000 take about 1.5 GB. Without a mask, every pixel is ignored."""
    cached = []
    for sample in tqdm(samples, desc="decoding", unit="picture", mininterval=2.0):
        picture = cv2.resize(read_picture(sample.picture), CACHE_WH, interpolation=cv2.INTER_AREA)
        mask = np.full(CACHE_WH[::-1], IGNORE, np.uint8)
        if sample.mask is not None:
            mask = np.asarray(cv2.resize(read_mask(sample.mask), CACHE_WH, interpolation=cv2.INTER_NEAREST), np.uint8)
        name = sample.source.name if sample.mask is not None else UNSEGMENTED
        cached.append(CachedPicture(name, np.asarray(picture, np.uint8), mask))
    return cached


def draw_epoch(pictures: list[CachedPicture], recipe: SegmenterRecipe, epoch: int) -> list[int]:
    """Shuffled picture indices of one epoch, balanced by DRAWS_PER_EPOCH; -1 stands for a null picture.

    As in the paper, every picture once and no null picture.
    """
    rng = np.random.default_rng((recipe.seed, epoch))
    if recipe.as_in_paper:
        return [int(i) for i in rng.permutation(len(pictures))]
    drawn: list[int] = []
    for name in sorted({p.source for p in pictures} - {RENDERED}):
        drawn.extend(
            _draw_evenly(rng, [i for i, p in enumerate(pictures) if p.source == name], DRAWS_PER_EPOCH.get(name, 100))
        )
    rendered = [i for i, p in enumerate(pictures) if p.source == RENDERED]
    if rendered:
        share = recipe.rendered_frac / (1 - recipe.rendered_frac)
        drawn.extend(_draw_evenly(rng, rendered, round(len(drawn) * share) if drawn else len(rendered)))
    drawn.extend([-1] * round(len(drawn) * NULL_FRAC / (1 - NULL_FRAC)))
    return [int(i) for i in rng.permutation(drawn)]


def _draw_evenly(rng: np.random.Generator, indices: list[int], count: int) -> list[int]:
    whole, rest = divmod(count, len(indices))
    return indices * whole + [int(i) for i in rng.choice(indices, rest, replace=False)]


class SegmenterTraining:
    """One training run in `folder`: `run()` goes on from its last finished epoch."""

    def __init__(
        self,
        model: nn.Module,
        recipe: SegmenterRecipe,
        folder: Path,
        train: list[CachedPicture],
        held_out: list[CachedPicture],
        distillation: Distillation | None = None,
    ) -> None:
        self.recipe, self.folder, self.train, self.held_out = recipe, folder, train, held_out
        folder.mkdir(parents=True, exist_ok=True)
        self.model, self.distillation = model, distillation
        gentle = model.encoder() if isinstance(model, ShippedSegmenter) else None
        self.state = TrainingState(model, recipe.peak_rate, recipe.weight_decay, distillation, gentle)

    def run(self, until: int | None = None) -> None:
        """Train to the end of the recipe, or to epoch `until`; Ctrl-C loses no finished epoch."""
        recipe = asdict(self.recipe)
        self.state.resume(self.folder, recipe)
        while self.state.epoch < (self.recipe.epochs if until is None else until):
            loss = self._train_epoch()
            figures = self.validate()
            record = {"epoch": self.state.epoch + 1, "seed": self.recipe.seed, "loss": round(loss, 4), **figures}
            append_record(self.folder / "epochs.jsonl", record)
            self.state.finish_epoch(self.folder, recipe, figures["miou"])

    def _train_epoch(self) -> float:
        recipe, state, epoch = self.recipe, self.state, self.state.epoch
        stage = stage_at_epoch(recipe.stages, epoch)
        order = draw_epoch(self.train, recipe, epoch)
        steps = count_steps(len(order), recipe.batch)
        total = steps * recipe.epochs

        def make(index: int) -> tuple[Tensor, Tensor]:
            return self._batch(order[index * recipe.batch : (index + 1) * recipe.batch], stage, (epoch, index))

        self.model.train()
        losses = []
        batches = Prefetch[tuple[Tensor, Tensor]](recipe.workers)
        title = f"epoch {epoch + 1}/{recipe.epochs} {stage.width_px}x{stage.height_px}"
        for pictures, masks in tqdm(batches(make, steps), title, steps, mininterval=5.0):
            loss = self._loss(to_device(pictures), to_device(masks))
            rate = learning_rate(recipe.peak_rate, state.step, total, recipe.warmup_steps, recipe.final_frac)
            state.update(loss, rate, clip_norm=5.0)
            losses.append(loss.item())
        return float(np.mean(losses))

    def _loss(self, pictures: Tensor, masks: Tensor) -> Tensor:
        if self.distillation is None:
            with mixed_precision() if self.recipe.as_in_paper else nullcontext():  # S7
                return segmenter_loss(self.model(pictures), masks)
        logits, distance = self.distillation(pictures, self.model)
        return segmenter_loss(logits, masks) + cast(Tensor, distance)

    def _batch(self, chosen: list[int], stage: Stage, place: tuple[int, int]) -> tuple[Tensor, Tensor]:
        size = (stage.width_px, stage.height_px)
        pairs = []
        for slot, index in enumerate(chosen):
            rng = np.random.default_rng((self.recipe.seed, *place, slot))
            if index < 0:
                pairs.append(draw_null_pair(rng, size))
            elif self.recipe.as_in_paper:
                item = self.train[index]
                pairs.append(augment_paper_pair(rng, item.picture, item.mask, size, self.recipe.without))
            else:
                item, donor = self.train[index], self.train[int(rng.integers(len(self.train)))]
                land = crop_land(rng, item.picture, item.mask) if rng.random() < LAND_FRAC else None
                picture, mask = land or (item.picture, item.mask)
                seeks_patch = rng.random() < PASTE_ATTEMPT_FRAC
                patch = crop_obstacle(rng, donor.picture, donor.mask) if seeks_patch else None
                patch = draw_concrete(rng) if rng.random() < CONCRETE_FRAC else patch
                pairs.append(augment_segmenter_pair(rng, picture, mask, size, patch))
        pictures = torch.from_numpy(segmenter_batch(np.stack([picture for picture, _ in pairs])))
        return pictures, torch.from_numpy(np.stack([mask for _, mask in pairs]).astype(np.int64))

    @torch.no_grad()
    def validate(self) -> dict[str, float]:
        """IoU and edge F1 of the averaged weights on the held-out pictures at the current input size (S10)."""
        stage = stage_at_epoch(self.recipe.stages, min(self.state.epoch, self.recipe.epochs - 1))
        size = (stage.width_px, stage.height_px)
        counts = np.zeros((len(SEGMENTER_CLASSES), len(SEGMENTER_CLASSES)), np.int64)
        edges = np.zeros(4, np.int64)
        for start in range(0, len(self.held_out), 16):
            chunk = self.held_out[start : start + 16]
            resized = np.stack([np.asarray(cv2.resize(p.picture, size), np.uint8) for p in chunk])
            logits = self.state.average.model(to_device(torch.from_numpy(segmenter_batch(resized))))
            labels = logits.argmax(1).cpu().numpy().astype(np.uint8)
            for item, label in zip(chunk, labels, strict=True):
                truth = np.asarray(cv2.resize(item.mask, size, interpolation=cv2.INTER_NEAREST), np.uint8)
                counts += confusion_matrix(label, truth, len(SEGMENTER_CLASSES))
                edges += count_edge_matches(label, truth)
        iou = class_iou(counts)
        return {"miou": round(float(np.nanmean(iou)), 4), "edge_f1": round(f1_score(*edges.tolist()), 4)} | {
            name: round(float(value), 4) for name, value in zip(SEGMENTER_CLASSES, iou, strict=True)
        }
