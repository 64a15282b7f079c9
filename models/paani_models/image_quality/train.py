"""Train the gate's net: pictures as they are against faults that the segmenter does not survive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import msgspec
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from tqdm import tqdm

from paani.arrays import U8
from paani.errors import UserError
from paani_models.catalogue import file_sha256
from paani_models.datasets.sources import Sample
from paani_models.engines.onnx_runner import open_network
from paani_models.image_quality.data import FaultLevel, Scene, Segment, measure_fault_levels, read_scenes
from paani_models.image_quality.draws import CLEAN, DRY, FitnessExample, draw_epoch_plan, draw_example
from paani_models.image_quality.network import ImageQualityNetwork, start_from_imagenet
from paani_models.network_input import segmenter_input
from paani_models.training.training_state import Prefetch, TrainingState, append_record, learning_rate, to_device

MEASURED_SCENES = 84  # enough for a cell's mIoU to one or two points
VALIDATION_LEVELS = 8  # of each scene that is not trained on
MIN_DRAW_WEIGHT, ERROR_DECAY = 0.03, 0.95  # of a cell's mean error, by which it is drawn
# By the threshold that the checked scenes choose: the gate's bars. Of clean pictures one may always be refused.
MAX_REFUSED_FRAC, MAX_CLEAN_REFUSED_FRAC = 0.01, 0.002


@dataclass(frozen=True)
class ImageQualityRecipe:
    """Everything that decides a gate training besides the pictures and the segmenter whose errors it learns."""

    epochs: int = 12
    batch: int = 64
    peak_rate: float = 1.5e-3
    weight_decay: float = 1e-3
    per_scene: int = 4
    seed: int = 42
    checked: bool = True  # False: also train on the sequences that would choose the threshold


class FaultLevelErrors(nn.Module):
    """How far the net is off on each cell, lately; checkpoints keep it, as it decides what is drawn."""

    error: Tensor

    def __init__(self, count: int) -> None:
        super().__init__()
        self.register_buffer("error", torch.ones(count))

    def update(self, shown: NDArray[np.int64], off: NDArray[np.float32]) -> None:
        """shown: cells' numbers, CLEAN or DRY; off: absolute error of each picture."""
        for cell in np.unique(shown[shown >= 0]).tolist():
            seen = float(off[shown == cell].mean())
            self.error[cell] = ERROR_DECAY * self.error[cell] + (1.0 - ERROR_DECAY) * seen

    def weights(self) -> NDArray[np.float64]:
        """By which cells are drawn."""
        return self.error.cpu().numpy().astype(np.float64) + MIN_DRAW_WEIGHT


class ImageQualityTraining:
    """One training in a folder: cells.json (what each fault does), checkpoints, log.jsonl."""

    def __init__(
        self, folder: Path, samples: Sequence[Sample], weights: Path, imagenet: Path, recipe: ImageQualityRecipe
    ) -> None:
        """samples: of the training side only; weights: the segmenter's ONNX file. Raises UserError."""
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.recipe = recipe
        segment = _open_segmenter(weights)
        found = read_scenes(samples, segment)
        self.cells = self._cells([one for one in found if one.drawn], segment)
        self.scenes = [one for one in found if not (recipe.checked and one.validation)]
        self.validation = self._checked([one for one in found if recipe.checked and one.validation])
        torch.manual_seed(recipe.seed)
        net = ImageQualityNetwork()
        start_from_imagenet(net, imagenet)
        self.errors = FaultLevelErrors(len(self.cells))
        self.progress = TrainingState(net, recipe.peak_rate, recipe.weight_decay, self.errors, pretrained=net.front)
        self._identity = {**asdict(recipe), "segmenter": file_sha256(weights), "pictures": len(self.scenes)}
        self.progress.resume(folder, self._identity)

    def run(self) -> None:
        """Train to the last epoch; each is recorded with what its averaged weights do to the checked scenes, if any."""
        while self.progress.epoch < self.recipe.epochs:
            loss = self._epoch()
            stands = self._standing() if self.validation else {}
            append_record(self.folder / "log.jsonl", {"epoch": self.progress.epoch + 1, "loss": loss, **stands})
            self.progress.finish_epoch(self.folder, self._identity, float(self.progress.epoch + 1))

    def _cells(self, drawn: list[Scene], segment: Segment) -> list[FaultLevel]:
        path = self.folder / "cells.json"
        if path.exists():
            try:
                return msgspec.json.decode(path.read_bytes(), type=list[FaultLevel])
            except msgspec.DecodeError as error:
                raise UserError(f"{path}: {error}") from error
        found = measure_fault_levels(drawn[:: max(1, len(drawn) // MEASURED_SCENES)], segment)
        beside = path.with_suffix(".partial")
        beside.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=1))
        beside.replace(path)
        return found

    def _checked(self, chosen: list[Scene]) -> list[FitnessExample]:
        """The same pictures after every epoch, none of them changed beside its fault."""
        drawn = []
        for index, one in enumerate(tqdm(chosen, desc="checked", unit="scene")):
            rng = np.random.default_rng([self.recipe.seed, 1, index])
            faults = rng.choice(len(self.cells), VALIDATION_LEVELS, replace=False).tolist()
            drawn += [draw_example(one, shown, self.cells, rng, vary=False) for shown in (CLEAN, DRY, *faults)]
        return drawn

    def _epoch(self) -> float:
        seed, epoch = self.recipe.seed, self.progress.epoch
        rows = draw_epoch_plan(
            len(self.scenes), self.errors.weights(), self.recipe.per_scene, np.random.default_rng([seed, 2, epoch])
        )
        size = self.recipe.batch
        steps = len(rows) // size

        def batch(step: int) -> list[FitnessExample]:
            rng = np.random.default_rng([seed, 3, epoch, step])
            chosen = rows[step * size : (step + 1) * size].tolist()
            return [draw_example(self.scenes[index], shown, self.cells, rng) for index, shown in chosen]

        total = 0.0
        self.progress.model.train()
        batches = tqdm(
            Prefetch[list[FitnessExample]]()(batch, steps), f"epoch {epoch + 1}", steps, unit="batch", mininterval=2.0
        )
        for shown in batches:
            x, target = _to_tensors(shown)
            logit = self.progress.model.logit(x)
            loss = nn.functional.binary_cross_entropy_with_logits(logit, target)
            rate = learning_rate(self.recipe.peak_rate, self.progress.step, steps * self.recipe.epochs, 100)
            self.progress.update(loss, rate, 5.0)
            total += float(loss.detach())
            off = (torch.sigmoid(logit.detach()) - target).abs().cpu().numpy()[:, 0]
            self.errors.update(np.array([one.shown for one in shown]), off)
        return total / max(1, steps)

    @torch.no_grad()
    def _standing(self) -> dict[str, float]:
        """On the checked scenes: the threshold that refuses few enough, and the shares that it refuses and accepts."""
        net = self.progress.average.model
        size = 256
        parts = [_to_tensors(self.validation[i : i + size])[0] for i in range(0, len(self.validation), size)]
        said = np.concatenate([net(x).cpu().numpy()[:, 0] for x in parts])
        target = np.array([one.target for one in self.validation])
        clean = np.array([one.shown == CLEAN for one in self.validation])
        dry = np.array([one.shown == DRY for one in self.validation])
        return threshold_figures(said, target, clean, dry)


def threshold_figures(
    said: NDArray[np.float32], target: NDArray[np.float64], clean: NDArray[np.bool_], dry: NDArray[np.bool_]
) -> dict[str, float]:
    """The largest threshold that refuses few enough of what is fit, and what it does; shares of 1.

    said, target: fitness of each picture, as the net has it and as it should be; clean: nothing was done to it.
    """
    fit, unfit = target == 1.0, target == 0.0
    spoilt = fit & ~clean
    limits = [
        float(np.sort(said[which])[max(spared, int(widest * which.sum()))])
        for which, widest, spared in ((spoilt, MAX_REFUSED_FRAC, 0), (clean, MAX_CLEAN_REFUSED_FRAC, 1))
        if which.sum() > spared
    ]
    at = min([*limits, 0.5])

    def below(which: NDArray[np.bool_]) -> float:
        return float((said[which] < at).mean()) if which.any() else 0.0

    return {
        "min_fitness": at,
        "refused": below(spoilt),
        "refused_clean": below(clean),
        "accepted": 1.0 - below(unfit) if unfit.any() else 0.0,
        "accepted_dry": 1.0 - below(dry) if dry.any() else 0.0,
    }


def _open_segmenter(weights: Path) -> Segment:
    run = open_network(weights)

    def segment(bgr: U8) -> U8:
        classes = run(segmenter_input(bgr[:, :, ::-1]))[0].argmax(0).astype(np.uint8)
        return np.asarray(cv2.resize(classes, bgr.shape[1::-1], interpolation=cv2.INTER_NEAREST), np.uint8)

    return segment


def _to_tensors(shown: Sequence[FitnessExample]) -> tuple[Tensor, Tensor]:
    """Pictures float32 [N,3,120,160] in 0..1 and targets [N,1]."""
    pictures = np.stack([one.picture for one in shown]).astype(np.float32) / 255.0
    targets = np.array([[one.target] for one in shown], np.float32)
    return to_device(torch.from_numpy(pictures)), to_device(torch.from_numpy(targets))
