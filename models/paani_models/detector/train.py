"""Train the detector from YOLOX-nano's COCO weights or a checkpoint; resumable after any epoch."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from tqdm import tqdm

from paani_models.datasets.sources import DETECTOR_CLASSES, SOURCES
from paani_models.detector.data import BoxedPicture, TrainingExample, augment_example, letterbox_example
from paani_models.detector.distillation import Teacher
from paani_models.detector.loss import detector_loss
from paani_models.detector.metrics import Detections, class_figures, decode_boxes
from paani_models.detector.shipped_network import FIRST_STAGES, Detector
from paani_models.network_input import DETECTOR_SIZE_WH, detector_batch
from paani_models.training.augment import draw_null_picture
from paani_models.training.training_state import (
    Prefetch,
    TrainingState,
    append_record,
    count_steps,
    learning_rate,
    to_device,
    training_device,
)

# Pictures drawn per epoch and source; a source not named here is drawn once each.
DRAWS_PER_EPOCH = {
    "hsu_shore_tiles": 420,
    "uon_robotx": 220,
    "tunai_sooke": 120,
    "inland_vessel": 48,
    "redyellow_buoy": 60,
    "dasha_pier": 320,
    "tampere_pier": 480,
    "tbiseg_usvinland": 480,
    "tbiseg_tampere": 60,
    "tbiseg_dasha": 80,
    "bath_river": 200,
    "mastr1325": 40,
    "oasis": 80,
    "rendered": 1200,
    "lifeguard_swim": 600,
    "surf_people": 270,
    "coco_mini": 178,
    "typesofships_kayak_buoy": 321,
    "lake_robotx_buoys": 140,
}
NULL_DRAWS = 60  # pictures per epoch that show nothing

Batch = tuple[Tensor, list[Tensor], Tensor]


@dataclass(frozen=True)
class DetectorRecipe:
    """Everything that decides a detector training besides the pictures."""

    epochs: int = 18
    batch: int = 16
    peak_rate: float = 1e-3  # S3
    weight_decay: float = 5e-4  # S3
    warmup_steps: int = 200
    mosaic_frac: float = 0.35
    plain_epochs: int = 4  # the last epochs, without mosaic
    seed: int = 42  # S4
    draws_frac: float = 1.0  # of DRAWS_PER_EPOCH: shorter epochs, each of other pictures
    frozen: tuple[str, ...] = ()  # parts of the network that do not learn
    distilled: bool = False
    height_px: int = DETECTOR_SIZE_WH[1]  # of the network's input
    width_px: int = DETECTOR_SIZE_WH[0]

    @property
    def size_wh(self) -> tuple[int, int]:
        """Width and height of the network's input, in pixels."""
        return self.width_px, self.height_px


def draw_epoch(pictures: list[BoxedPicture], recipe: DetectorRecipe, epoch: int) -> list[int]:
    """Shuffled picture indices of one epoch, balanced by DRAWS_PER_EPOCH; -1 stands for a null picture."""
    rng = np.random.default_rng((recipe.seed, epoch))
    places: dict[str, list[int]] = defaultdict(list)
    for index, item in enumerate(pictures):
        places[item.source].append(index)
    drawn: list[int] = [-1] * round(NULL_DRAWS * recipe.draws_frac)
    for name, indices in sorted(places.items()):
        wanted = round(DRAWS_PER_EPOCH.get(name, len(indices)) * recipe.draws_frac)
        whole, rest = divmod(wanted, len(indices))
        drawn.extend(indices * whole)
        drawn.extend(int(i) for i in rng.choice(indices, rest, replace=False))
    return [int(i) for i in rng.permutation(drawn)]


class DetectorTraining:
    """One training run in `folder`: `run()` goes on from its last finished epoch."""

    def __init__(
        self,
        model: Detector,
        recipe: DetectorRecipe,
        folder: Path,
        train: list[BoxedPicture],
        held_out: list[BoxedPicture],
        teacher: Teacher | None = None,
    ) -> None:
        self.teacher = teacher
        self.recipe, self.folder, self.train, self.held_out = recipe, folder, train, held_out
        folder.mkdir(parents=True, exist_ok=True)
        self.model = model
        for part in recipe.frozen:
            model.get_submodule(part).requires_grad_(False)
        self.state = TrainingState(model, recipe.peak_rate, recipe.weight_decay)

    def run(self, until: int | None = None) -> None:
        """Train to the end of the recipe, or to epoch `until`; Ctrl-C loses no finished epoch."""
        recipe = asdict(self.recipe) | {"frozen": list(self.recipe.frozen)}
        self.state.resume(self.folder, recipe)
        while self.state.epoch < (self.recipe.epochs if until is None else until):
            box_loss, score_loss = self._train_epoch()
            figures = figures_by_class(self.state.average.model, self.held_out, self.recipe.size_wh)
            losses = {"box_loss": box_loss, "score_loss": score_loss}
            record = {"epoch": self.state.epoch + 1, "seed": self.recipe.seed, **losses, **figures}
            append_record(self.folder / "epochs.jsonl", record)
            self.state.finish_epoch(self.folder, recipe, mean_ap50(figures))

    def _train_epoch(self) -> tuple[float, float]:
        recipe, state, epoch = self.recipe, self.state, self.state.epoch
        order = draw_epoch(self.train, recipe, epoch)
        steps = count_steps(len(order), recipe.batch)
        total = steps * recipe.epochs

        def make(index: int) -> Batch:
            return self._batch(order, index, epoch)

        self.model.train()
        is_frozen = set(FIRST_STAGES) <= set(recipe.frozen)
        is_shared = is_frozen and self.teacher is not None and self.teacher.has_first_stages_of(self.model)
        losses = []
        title = f"epoch {epoch + 1}/{recipe.epochs}"
        for pictures, truths, judged in tqdm(Prefetch[Batch]()(make, steps), title, steps, mininterval=5.0):
            seen = to_device(pictures)
            first = self.model.first_stages(seen)
            boxes, logits = self.model.raw_after(first)
            known = [truth.to(training_device()) for truth in truths]
            taught = None
            if self.teacher is not None:
                taught = self.teacher.answer(first.detach() if is_shared else self.teacher.first_stages(seen))
            size_hw = (recipe.height_px, recipe.width_px)
            box_loss, score_loss = detector_loss(boxes, logits, known, to_device(judged), size_hw, taught)
            rate = learning_rate(recipe.peak_rate, state.step, total, recipe.warmup_steps)
            state.update(box_loss + score_loss, rate, clip_norm=10.0)
            losses.append((box_loss.item(), score_loss.item()))
        box_mean, score_mean = np.mean(losses, 0)
        return round(float(box_mean), 4), round(float(score_mean), 4)

    def _batch(self, order: list[int], index: int, epoch: int) -> Batch:
        examples = []
        for slot in range(index * self.recipe.batch, (index + 1) * self.recipe.batch):
            rng = np.random.default_rng((self.recipe.seed, epoch, slot))
            examples.append(self._example(rng, order, slot, epoch))
        return stack_examples(examples)

    def _example(self, rng: np.random.Generator, order: list[int], slot: int, epoch: int) -> TrainingExample:
        if order[slot] < 0:
            cells = (len(DETECTOR_CLASSES), self.recipe.height_px // 8, self.recipe.width_px // 8)
            return TrainingExample(
                draw_null_picture(rng, self.recipe.size_wh), np.zeros((0, 5), np.float32), np.ones(cells, np.bool_)
            )
        chosen = [order[slot]]
        late = epoch >= self.recipe.epochs - self.recipe.plain_epochs
        if not late and rng.random() < self.recipe.mosaic_frac:
            chosen += [max(0, order[int(i)]) for i in rng.integers(len(order), size=3)]
        return augment_example(rng, [self.train[i] for i in chosen], self.recipe.size_wh)


def stack_examples(examples: Sequence[TrainingExample]) -> Batch:
    """Network input, boxes of each picture, and where they are exhaustive."""
    return (
        torch.from_numpy(detector_batch(np.stack([e.picture for e in examples]))),
        [torch.from_numpy(e.boxes) for e in examples],
        torch.from_numpy(np.stack([e.exhaustive_mask for e in examples])),
    )


@torch.no_grad()
def figures_by_class(
    model: torch.nn.Module, pictures: list[BoxedPicture], size_wh: tuple[int, int]
) -> dict[str, dict[str, float]]:
    """Class name -> figures of `class_figures`, on letterboxed pictures of the sources that annotate the class."""
    annotated = {source.name: source.annotated for source in SOURCES}
    found: list[Detections] = []
    truths: list[NDArray[np.float32]] = []
    names: list[str] = []
    labelled = [item for item in pictures if annotated[item.source] and item.exhaustive_mask.ndim == 1]
    for start in range(0, len(labelled), 16):
        chunk = [letterbox_example(item, size_wh) for item in labelled[start : start + 16]]
        outputs = model(to_device(torch.from_numpy(detector_batch(np.stack([e.picture for e in chunk]))))).cpu().numpy()
        found.extend(decode_boxes(output, confidence=0.01, limit=100) for output in outputs)
        truths.extend(e.boxes for e in chunk)
        names.extend(item.source for item in labelled[start : start + 16])
    figures = {}
    for kind, name in enumerate(DETECTOR_CLASSES):
        chosen = [i for i, source in enumerate(names) if name in annotated[source]]
        row = class_figures([found[i] for i in chosen], [truths[i] for i in chosen], kind)
        figures[name] = {key: value if key == "n" else round(value, 4) for key, value in row.items()}
    return figures


def mean_ap50(figures: dict[str, dict[str, float]]) -> float:
    """Over the classes that have truths; 0 where none has."""
    ap50 = [row["ap50"] for row in figures.values() if row["n"] > 0]
    return float(np.mean(ap50)) if ap50 else 0.0
