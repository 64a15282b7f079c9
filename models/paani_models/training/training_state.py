"""State of a training run: schedule, averaged weights (Polyak and Juditsky 1992), prefetch, checkpoints, records."""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar

import cv2
import msgspec
import torch
from torch import Tensor, nn

from paani.errors import UserError
from paani.undecodable import UNDECODABLE
from paani.whole_file import replacement_file

Batch = TypeVar("Batch")

Side = Annotated[int, msgspec.Meta(ge=0, le=4096, multiple_of=32)]

PRETRAINED_RATE_FACTOR = 0.3  # of the learning rate, for a part that starts from pretrained weights


@dataclass(frozen=True)
class Stage:
    """`epochs` passes at one input size; smaller inputs first make the early passes cheap."""

    epochs: int
    height_px: int
    width_px: int


def stage_at_epoch(stages: tuple[Stage, ...], epoch: int) -> Stage:
    """Stage that a zero-based epoch belongs to."""
    for stage in stages:
        if epoch < stage.epochs:
            return stage
        epoch -= stage.epochs
    raise IndexError(epoch)


def learning_rate(peak: float, step: int, total_steps: int, warmup_steps: int, final_frac: float = 0.01) -> float:
    """Linear warm-up, then a cosine (Loshchilov and Hutter 2017) down to `final_frac` of the peak, by default S3's."""
    if step < warmup_steps:
        return peak * (step + 1) / warmup_steps
    progress = (step - warmup_steps) / max(1, total_steps - warmup_steps)
    return peak * (final_frac + (1.0 - final_frac) * 0.5 * (1.0 + math.cos(math.pi * min(1.0, progress))))


def count_steps(drawn: int, batch: int) -> int:
    """Whole batches in an epoch's pictures. Raises UserError where there is none, so that nothing would be learnt."""
    if drawn < batch:
        raise UserError(f"sources: {drawn} pictures an epoch, and a batch has {batch} (--sources, --batch)")
    return drawn // batch


class AveragedWeights:
    """Exponential moving average of a model's floating-point state; `model` is what is evaluated and exported."""

    def __init__(self, model: nn.Module, decay: float = 0.997) -> None:
        self.model = deepcopy(model).eval().requires_grad_(False)
        self.decay = decay
        self.updates = 0

    @torch.no_grad()
    def update(self, model: nn.Module) -> None:
        """Blend the model in. Early updates weigh more, so that the random start is soon forgotten."""
        self.updates += 1
        keep = min(self.decay, self.updates / (self.updates + 10.0))
        current = model.state_dict()
        for name, value in self.model.state_dict().items():
            if value.dtype.is_floating_point:
                value.lerp_(current[name], 1.0 - keep)
            else:
                value.copy_(current[name])


class Prefetch(Generic[Batch]):
    """Batches in order, made in `workers` threads, by default one a core, twice as many ahead, while the net trains."""

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or os.cpu_count() or 2
        self.ahead = 2 * self.workers

    def __call__(self, make: Callable[[int], Batch], count: int) -> Iterator[Batch]:
        """Yield make(0) .. make(count - 1)."""
        cv2.setNumThreads(1)
        with ThreadPoolExecutor(self.workers) as pool:
            pending: list[Future[Batch]] = [pool.submit(make, i) for i in range(min(self.ahead, count))]
            for index in range(count):
                batch = pending.pop(0).result()
                if index + self.ahead < count:
                    pending.append(pool.submit(make, index + self.ahead))
                yield batch


def save_checkpoint(path: Path, state: dict[str, Any]) -> None:
    """Whole or not at all. Raises UserError naming a file that cannot be written."""
    with replacement_file(path) as beside:
        torch.save(state, beside)


def load_checkpoint(path: Path) -> dict[str, Any]:
    """What `save_checkpoint` wrote. Raises UserError naming the file where it is missing or unreadable."""
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:
        raise UserError(f"{path}: not a readable checkpoint ({type(error).__name__})") from error
    if not isinstance(state, dict):
        raise UserError(f"{path}: not a checkpoint of this training")
    return state


class TrainedWith(msgspec.Struct, frozen=True):
    """What an export knows of the recipe in a checkpoint. Sides are those of a detector's input, 0 where unstated."""

    seed: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
    height_px: Side = 0
    width_px: Side = 0


def read_recipe(checkpoint: Path) -> TrainedWith:
    """Raises UserError naming a checkpoint without a recipe, or with one of other values than a training has."""
    try:
        return msgspec.convert(load_checkpoint(checkpoint).get("recipe"), TrainedWith)
    except UNDECODABLE as error:
        raise UserError(f"{checkpoint}: recipe: {error}") from error


class TrainingState:
    """Everything of a run that a checkpoint keeps, so that a resumed run equals an uninterrupted one (S11).

    extra: parameters that are trained along with the model and are not part of it.
    pretrained: a part of the model that learns at PRETRAINED_RATE_FACTOR times the rate.
    """

    def __init__(
        self,
        model: nn.Module,
        peak_rate: float,
        weight_decay: float,
        extra: nn.Module | None = None,
        pretrained: nn.Module | None = None,
    ) -> None:
        self.model = model.to(training_device())
        for parameter in self.model.parameters():
            if parameter.dim() == 4:
                parameter.data = parameter.data.contiguous(memory_format=torch.channels_last)
        self.average = AveragedWeights(self.model)
        self.extra = extra.to(training_device()) if extra is not None else nn.Module()
        trained = [p for net in (self.model, self.extra) for p in net.parameters() if p.requires_grad]
        pretrained_ids = {id(p) for p in pretrained.parameters()} if pretrained is not None else set()
        groups = [
            {
                "params": [p for p in trained if (id(p) in pretrained_ids) == is_pretrained],
                "gain": PRETRAINED_RATE_FACTOR if is_pretrained else 1.0,
            }
            for is_pretrained in (False, True)
        ]
        self.optimiser = torch.optim.AdamW([g for g in groups if g["params"]], peak_rate, weight_decay=weight_decay)
        self.epoch = 0
        self.step = 0
        self.best = -math.inf

    def start_from(self, checkpoint: Path) -> None:
        """Take the averaged weights of another run. Raises UserError where they do not fit."""
        load_averaged_weights(self.model, checkpoint)
        self.average_from_model()

    def average_from_model(self) -> None:
        """Begin the average with the model's weights, as with those of a finished training."""
        self.average = AveragedWeights(self.model)
        self.average.updates = 10_000

    def update(self, loss: Tensor, rate: float, clip_norm: float) -> None:
        """One optimiser step at a learning rate."""
        for group in self.optimiser.param_groups:
            group["lr"] = rate * group["gain"]
        self.optimiser.zero_grad(set_to_none=True)
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(self.model.parameters(), clip_norm)
        self.optimiser.step()
        self.average.update(self.model)
        self.step += 1

    def finish_epoch(self, folder: Path, recipe: dict[str, Any], score: float) -> None:
        """Count the epoch and save `last.pt`, and `best.pt` if it scored higher than every epoch before."""
        self.epoch += 1
        is_best = score > self.best
        self.best = max(self.best, score)
        state = {
            "model": self.model.state_dict(),
            "average": self.average.model.state_dict(),
            "extra": self.extra.state_dict(),
            "updates": self.average.updates,
            "optimiser": self.optimiser.state_dict(),
            "rng": torch.get_rng_state(),
            "epoch": self.epoch,
            "step": self.step,
            "best": self.best,
            "recipe": recipe,
        }
        if is_best:
            save_checkpoint(folder / "best.pt", state)
        save_checkpoint(folder / "last.pt", state)

    def resume(self, folder: Path, recipe: dict[str, Any]) -> None:
        """Go on from `last.pt` if there is one. Raises UserError where it was made with another recipe."""
        path = folder / "last.pt"
        if not path.exists():
            return
        state = load_checkpoint(path)
        if state.get("recipe") != recipe:
            raise UserError(f"{path}: was made with another recipe; choose another folder")
        self.model.load_state_dict(state["model"])
        self.average.model.load_state_dict(state["average"])
        self.average.updates = state["updates"]
        self.extra.load_state_dict(state["extra"])
        self.optimiser.load_state_dict(state["optimiser"])
        torch.set_rng_state(state["rng"])
        self.epoch, self.step, self.best = state["epoch"], state["step"], state["best"]


def load_averaged_weights(model: nn.Module, checkpoint: Path) -> None:
    """Fill a network with a checkpoint's averaged weights. Raises UserError naming a checkpoint that does not fit."""
    try:
        model.load_state_dict(load_checkpoint(checkpoint)["average"])
    except (KeyError, RuntimeError, TypeError) as error:
        raise UserError(f"{checkpoint}: not a checkpoint of this net") from error


def append_record(path: Path, record: Mapping[str, object]) -> None:
    """One JSON line per epoch (S10)."""
    with path.open("ab") as file:
        file.write(msgspec.json.encode(record) + b"\n")


def training_device() -> torch.device:
    """The accelerator if there is one."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def to_device(tensor: Tensor) -> Tensor:
    """On the training device; four-dimensional tensors channels-last, which is 1.3 times faster on a CPU."""
    if tensor.dim() == 4:
        return tensor.to(training_device(), memory_format=torch.channels_last)
    return tensor.to(training_device())


def mixed_precision() -> torch.autocast:
    """S4: bfloat16 where the device has instructions for it, which halves a step; else all stays float32."""
    device = training_device().type
    return torch.autocast(device, torch.bfloat16, enabled=device == "cuda" or _multiplies_bfloat16())


@contextlib.contextmanager
def deterministic_algorithms() -> Iterator[None]:
    """S4: operations take the algorithm that repeats its result; what has none warns and goes on."""
    torch.use_deterministic_algorithms(True, warn_only=True)
    try:
        yield
    finally:
        torch.use_deterministic_algorithms(False)


def _multiplies_bfloat16() -> bool:
    """Whether this CPU has tiles of bfloat16, as Linux tells; without them a step takes longer than in float32."""
    cpu = Path("/proc/cpuinfo")
    return cpu.is_file() and "amx_bf16" in cpu.read_text().split()
