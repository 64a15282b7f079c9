"""Train the image-quality network by binary cross-entropy on fitness targets that the segmenter's errors set.

After every epoch the validation scenes choose the largest threshold that refuses few enough fit pictures.
"""

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
from paani.undecodable import UNDECODABLE
from paani.whole_file import write_json
from paani_models.catalogue import file_sha256
from paani_models.datasets.sources import Sample
from paani_models.engines.onnx_runner import open_network
from paani_models.image_quality.data import FaultLevel, Scene, Segment, measure_fault_levels, read_scenes
from paani_models.image_quality.draws import CLEAN, WITHOUT_WATER, FitnessExample, draw_epoch_plan, draw_example
from paani_models.image_quality.network import ImageQualityNetwork, start_from_export, start_from_imagenet
from paani_models.network_input import segmenter_input
from paani_models.training.training_state import (
    Prefetch,
    TrainingState,
    append_record,
    count_steps,
    learning_rate,
    to_device,
)

MEASURED_SCENES = 84  # pictures on which a fault level's mIoU is measured: exact to one or two points
VALIDATION_LEVELS = 8  # fault levels shown of each validation scene
MIN_DRAW_WEIGHT = 0.03  # added to a fault level's error, so that each is drawn sometimes
ERROR_DECAY = 0.95  # of the moving average of a fault level's error, per batch that shows it
# Largest shares of fit corrupted pictures and of clean pictures that the threshold may refuse; one clean picture
# always.
MAX_REFUSED_FRAC, MAX_CLEAN_REFUSED_FRAC = 0.01, 0.002


@dataclass(frozen=True)
class ImageQualityRecipe:
    """Everything that decides a training besides the pictures and the segmenter. Checkpoints store these names.

    per_scene: faults shown of each scene per epoch. checked: whether validation sequences are kept out of training.
    """

    epochs: int = 12
    batch: int = 64
    peak_rate: float = 1.5e-3
    weight_decay: float = 1e-3
    per_scene: int = 4
    seed: int = 42
    checked: bool = True


class FaultLevelErrors(nn.Module):
    """Moving average of the network's absolute error on each fault level. Checkpoints keep it, as the draws need it."""

    error: Tensor

    def __init__(self, count: int) -> None:
        super().__init__()
        self.register_buffer("error", torch.ones(count))

    def update(self, contents: NDArray[np.int64], absolute_errors: NDArray[np.float32]) -> None:
        """Blend in one batch.

        contents: fault level indices, CLEAN or WITHOUT_WATER; absolute_errors: of each picture.
        """
        for level in np.unique(contents[contents >= 0]).tolist():
            batch_error = float(absolute_errors[contents == level].mean())
            self.error[level] = ERROR_DECAY * self.error[level] + (1.0 - ERROR_DECAY) * batch_error

    def weights(self) -> NDArray[np.float64]:
        """Weights by which fault levels are drawn."""
        return self.error.cpu().numpy().astype(np.float64) + MIN_DRAW_WEIGHT


class ImageQualityTraining:
    """One training in a folder: cells.json (the segmenter's error per fault level), checkpoints, log.jsonl."""

    def __init__(
        self,
        folder: Path,
        samples: Sequence[Sample],
        weights: Path,
        imagenet: Path,
        recipe: ImageQualityRecipe,
        start: Path | None = None,
    ) -> None:
        """samples: training side only.

        weights: the segmenter's ONNX file. start: an export of the network to begin from, instead of ImageNet's weights
        alone. Raises UserError for a file that does not fit.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.recipe = recipe
        segment = _open_segmenter(weights)
        found = read_scenes(samples, segment)
        self.levels = self._measure_or_read_levels([one for one in found if one.is_hand_drawn], segment)
        self.scenes = [one for one in found if not (recipe.checked and one.is_validation)]
        self.validation = self._draw_validation_examples([one for one in found if recipe.checked and one.is_validation])
        torch.manual_seed(recipe.seed)
        net = ImageQualityNetwork()
        start_from_imagenet(net, imagenet)
        self.errors = FaultLevelErrors(len(self.levels))
        if start is not None:
            start_from_export(net, start)
        self.state = TrainingState(net, recipe.peak_rate, recipe.weight_decay, self.errors, pretrained=net.front)
        if start is not None:
            self.state.average_from_model()
        self._identity = {**asdict(recipe), "segmenter": file_sha256(weights), "pictures": len(self.scenes)}
        self.state.resume(folder, self._identity)

    def run(self) -> None:
        """Train to the last epoch; record each with what its averaged weights do to the validation scenes, if any."""
        while self.state.epoch < self.recipe.epochs:
            loss = self._train_epoch()
            validation_figures = self._validate() if self.validation else {}
            append_record(
                self.folder / "log.jsonl", {"epoch": self.state.epoch + 1, "loss": loss, **validation_figures}
            )
            self.state.finish_epoch(self.folder, self._identity, float(self.state.epoch + 1))

    def _measure_or_read_levels(self, scenes: list[Scene], segment: Segment) -> list[FaultLevel]:
        path = self.folder / "cells.json"
        if path.exists():
            try:
                return msgspec.json.decode(path.read_bytes(), type=list[FaultLevel])
            except UNDECODABLE as error:
                raise UserError(f"{path}: {error}") from error
        found = measure_fault_levels(scenes[:: max(1, len(scenes) // MEASURED_SCENES)], segment)
        write_json(path, found)
        return found

    def _draw_validation_examples(self, scenes: list[Scene]) -> list[FitnessExample]:
        """Draw the validation examples, the same for every epoch: faults alone, no mirroring, crop or brightness."""
        examples = []
        for index, one in enumerate(tqdm(scenes, desc="checked", unit="scene")):
            rng = np.random.default_rng([self.recipe.seed, 1, index])
            faults = rng.choice(len(self.levels), VALIDATION_LEVELS, replace=False).tolist()
            examples += [
                draw_example(one, content, self.levels, rng, vary=False) for content in (CLEAN, WITHOUT_WATER, *faults)
            ]
        return examples

    def _train_epoch(self) -> float:
        seed, epoch = self.recipe.seed, self.state.epoch
        rows = draw_epoch_plan(
            len(self.scenes), self.errors.weights(), self.recipe.per_scene, np.random.default_rng([seed, 2, epoch])
        )
        size = self.recipe.batch
        steps = count_steps(len(rows), size)

        def batch(step: int) -> list[FitnessExample]:
            rng = np.random.default_rng([seed, 3, epoch, step])
            chosen = rows[step * size : (step + 1) * size].tolist()
            return [draw_example(self.scenes[index], content, self.levels, rng) for index, content in chosen]

        total = 0.0
        self.state.model.train()
        batches = tqdm(
            Prefetch[list[FitnessExample]]()(batch, steps), f"epoch {epoch + 1}", steps, unit="batch", mininterval=2.0
        )
        for examples in batches:
            x, target = _to_tensors(examples)
            logit = self.state.model.logit(x)
            loss = nn.functional.binary_cross_entropy_with_logits(logit, target)
            rate = learning_rate(self.recipe.peak_rate, self.state.step, steps * self.recipe.epochs, 100)
            self.state.update(loss, rate, 5.0)
            total += float(loss.detach())
            absolute_errors = (torch.sigmoid(logit.detach()) - target).abs().cpu().numpy()[:, 0]
            self.errors.update(np.array([one.content for one in examples]), absolute_errors)
        return total / steps

    @torch.no_grad()
    def _validate(self) -> dict[str, float]:
        """Measure the averaged weights on the validation examples, as `threshold_figures` does."""
        net = self.state.average.model
        size = 256
        parts = [_to_tensors(self.validation[i : i + size])[0] for i in range(0, len(self.validation), size)]
        fitness = np.concatenate([net(x).cpu().numpy()[:, 0] for x in parts])
        target = np.array([one.target for one in self.validation])
        clean = np.array([one.content == CLEAN for one in self.validation])
        without_water = np.array([one.content == WITHOUT_WATER for one in self.validation])
        return threshold_figures(fitness, target, clean, without_water)


def threshold_figures(
    fitness: NDArray[np.float32],
    target: NDArray[np.float64],
    clean: NDArray[np.bool_],
    without_water: NDArray[np.bool_],
) -> dict[str, float]:
    """Choose the largest threshold that refuses few enough fit pictures, and say what it refuses and accepts (shares).

    fitness, target: of each picture, as the network estimates it and as it should be. clean: nothing was done to it.
    """
    fit, unfit = target == 1.0, target == 0.0
    corrupted = fit & ~clean
    limits = [
        float(np.sort(fitness[which])[max(spared, int(widest * which.sum()))])
        for which, widest, spared in ((corrupted, MAX_REFUSED_FRAC, 0), (clean, MAX_CLEAN_REFUSED_FRAC, 1))
        if which.sum() > spared
    ]
    threshold = min([*limits, 0.5])

    def refused_frac(which: NDArray[np.bool_]) -> float:
        return float((fitness[which] < threshold).mean()) if which.any() else 0.0

    return {
        "min_fitness": threshold,
        "refused": refused_frac(corrupted),
        "refused_clean": refused_frac(clean),
        "accepted": 1.0 - refused_frac(unfit) if unfit.any() else 0.0,
        "accepted_dry": 1.0 - refused_frac(without_water) if without_water.any() else 0.0,
    }


def _open_segmenter(weights: Path) -> Segment:
    run = open_network(weights)

    def segment(bgr: U8) -> U8:
        classes = run(segmenter_input(bgr[:, :, ::-1]))[0].argmax(0).astype(np.uint8)
        return np.asarray(cv2.resize(classes, bgr.shape[1::-1], interpolation=cv2.INTER_NEAREST), np.uint8)

    return segment


def _to_tensors(examples: Sequence[FitnessExample]) -> tuple[Tensor, Tensor]:
    """Pictures float32 [N,3,120,160] in 0..1 and targets [N,1]."""
    pictures = np.stack([one.picture for one in examples]).astype(np.float32) / 255.0
    targets = np.array([[one.target] for one in examples], np.float32)
    return to_device(torch.from_numpy(pictures)), to_device(torch.from_numpy(targets))
