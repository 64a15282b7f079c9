"""Train the gate's net: clean pictures against faults that the segmenter does not survive."""

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

from paani.errors import UserError
from paani_models.catalogue import file_sha256
from paani_models.gate import Gate
from paani_models.gate_data import Bytes, Cell, Scene, cells, clean_picture, examples, scene
from paani_models.network_input import segmenter_input
from paani_models.onnx_runner import open_net
from paani_models.sources import Sample
from paani_models.training import Progress, append_record, learning_rate, to_device

MOVED_FRAC = 0.6
MEASURED_SCENES = 84  # enough for a cell's mIoU to one or two points


@dataclass(frozen=True)
class Recipe:
    """Everything that decides a gate training besides the pictures and the segmenter whose errors it learns."""

    epochs: int = 14
    batch: int = 64
    peak_rate: float = 2e-3
    weight_decay: float = 1e-3
    per_scene: int = 32
    seed: int = 42


class GateTraining:
    """One training in a folder: cells.json (what each fault does), checkpoints, log.jsonl."""

    def __init__(
        self, folder: Path, segmented: Sequence[Sample], clean: Sequence[Sample], weights: Path, recipe: Recipe
    ) -> None:
        """segmented, clean: training samples only; weights: the segmenter's ONNX file. Raises UserError."""
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        self.recipe = recipe
        scenes = [scene(sample) for sample in tqdm(segmented, desc="reading", unit="picture")]
        self.cells = self._cells(scenes, weights)
        pictures = (clean_picture(sample) for sample in tqdm(clean, desc="reading", unit="picture"))
        self.inputs, self.fits = examples(scenes, pictures, self.cells, recipe.per_scene)
        torch.manual_seed(recipe.seed)
        self.progress = Progress(Gate(), recipe.peak_rate, recipe.weight_decay)
        self._identity = {**asdict(recipe), "segmenter": file_sha256(weights), "pictures": len(self.fits)}
        self.progress.resume(folder, self._identity)

    def run(self) -> None:
        """Train to the last epoch; the score of an epoch is how well it tells its own pictures apart, without noise."""
        while self.progress.epoch < self.recipe.epochs:
            loss = self._epoch()
            record = {"epoch": self.progress.epoch + 1, "loss": loss, **self._wrong()}
            append_record(self.folder / "log.jsonl", record)
            self.progress.finish_epoch(self.folder, self._identity, float(self.progress.epoch + 1))

    def _cells(self, scenes: list[Scene], weights: Path) -> list[Cell]:
        path = self.folder / "cells.json"
        if path.exists():
            try:
                return msgspec.json.decode(path.read_bytes(), type=list[Cell])
            except msgspec.DecodeError as error:
                raise UserError(f"{path}: {error}") from error
        run = open_net(weights)

        def segment(bgr: Bytes) -> Bytes:
            classes = run(segmenter_input(bgr[:, :, ::-1]))[0].argmax(0).astype(np.uint8)
            return np.asarray(cv2.resize(classes, bgr.shape[1::-1], interpolation=cv2.INTER_NEAREST), np.uint8)

        step = max(1, len(scenes) // MEASURED_SCENES)
        found = cells(scenes[::step], segment)
        beside = path.with_suffix(".partial")
        beside.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=1))
        beside.replace(path)
        return found

    def _epoch(self) -> float:
        rng = np.random.default_rng([self.recipe.seed, self.progress.epoch])
        order = rng.permutation(len(self.fits))
        steps = len(order) // self.recipe.batch
        total = 0.0
        self.progress.model.train()
        for step in tqdm(range(steps), desc=f"epoch {self.progress.epoch + 1}", unit="batch", mininterval=2.0):
            chosen = order[step * self.recipe.batch : (step + 1) * self.recipe.batch]
            x, fit = self._batch(chosen, rng)
            logit = self.progress.model.logit(x)
            loss = nn.functional.binary_cross_entropy_with_logits(logit, fit)
            rate = learning_rate(self.recipe.peak_rate, self.progress.step, steps * self.recipe.epochs, 100)
            self.progress.update(loss, rate, 5.0)
            total += float(loss)
        return total / max(1, steps)

    def _batch(self, chosen: NDArray[np.intp], rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        """Flipped, brighter or darker, and shifted a little at random."""
        pictures = self.inputs[chosen].astype(np.float32) / 255.0
        flips = rng.random(len(chosen)) < 0.5
        pictures[flips] = pictures[flips, :, :, ::-1]
        gains = rng.uniform(0.9, 1.1, (len(chosen), 1, 1, 1)).astype(np.float32)
        pictures = np.clip(pictures * gains, 0.0, 1.0)
        for index in np.flatnonzero(rng.random(len(chosen)) < MOVED_FRAC):
            pictures[index] = _moved(pictures[index], rng)
        x = to_device(torch.from_numpy(np.ascontiguousarray(pictures)))
        return x, to_device(torch.from_numpy(self.fits[chosen][:, None]))

    @torch.no_grad()
    def _wrong(self) -> dict[str, float]:
        """Shares of fit pictures refused and of unfit ones accepted, at 0.5, by the averaged weights."""
        net = self.progress.average.model
        said = np.concatenate(
            [
                net(to_device(torch.from_numpy(self.inputs[i : i + 256].astype(np.float32) / 255.0)))
                .cpu()
                .numpy()[:, 0]
                for i in range(0, len(self.fits), 256)
            ]
        )
        fit = self.fits > 0.5
        return {"refused": float((said[fit] < 0.5).mean()), "accepted": float((said[~fit] >= 0.5).mean())}


def _moved(picture: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """Shifted by up to a twelfth of the picture and zoomed by up to a tenth; what comes in repeats the border."""
    channels, height, width = picture.shape
    zoom = rng.uniform(0.9, 1.1)
    across, down = (rng.uniform(-1.0, 1.0) * size / 12.0 for size in (width, height))
    to = np.array([[zoom, 0.0, across], [0.0, zoom, down]], np.float32)
    planes = [cv2.warpAffine(p, to, (width, height), borderMode=cv2.BORDER_REPLICATE) for p in picture]
    return np.stack(planes).reshape(channels, height, width).astype(np.float32)
