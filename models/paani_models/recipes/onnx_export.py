"""Checkpoint -> static FP32 ONNX of opset 17, compared with the PyTorch network on real pictures (T1, T2)."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional as F

from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani.whole_file import replacement_file
from paani_models.catalogue import (
    Model,
    Origin,
    Preprocessing,
    Tensor,
    file_sha256,
    load_catalogue,
    save_catalogue,
)
from paani_models.datasets.sources import DETECTOR_CLASSES, RENDERED, SEGMENTER_CLASSES, Source
from paani_models.detector.paper_network import FUSED_PARAMETERS, Yolo11n
from paani_models.detector.shipped_network import Detector, count_candidates
from paani_models.engines.onnx_runner import open_network
from paani_models.image_quality.network import ImageQualityNetwork
from paani_models.network_input import DETECTOR_SIZE_WH, IMAGE_QUALITY_WH, SIZE_WH
from paani_models.segmenter.paper_network import PaperSegmenter, parameter_count
from paani_models.segmenter.shipped_network import ShippedSegmenter
from paani_models.training.training_state import TrainedWith, load_averaged_weights, read_recipe

OPSET = 17  # T1
MAX_EXPORT_DIFFERENCE = 1e-3  # T2; in logits, scores, and boxes as fractions of the input

_UNCHANGED: tuple[float, float, float] = (0.0, 0.0, 0.0)

CONTRACTS = {
    "segmenter": Model(
        name="segmenter",
        file="segmenter.onnx",
        sha256="",
        size_bytes=0,
        parameters=0,
        opset=OPSET,
        input=Tensor("input", (1, 3, SIZE_WH[1], SIZE_WH[0])),
        output=Tensor("logits", (1, 3, SIZE_WH[1], SIZE_WH[0])),
        classes=SEGMENTER_CLASSES,
        preprocessing=Preprocessing("stretch", (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)),
        architecture="MobileNetV2 encoder at 11/16 size, 48-channel separable top-down decoder",
        licence="weights: for research; see the terms of each training source",
    ),
    "detector": Model(
        name="detector",
        file="detector.onnx",
        sha256="",
        size_bytes=0,
        parameters=0,
        opset=OPSET,
        input=Tensor("input", (1, 3, *DETECTOR_SIZE_WH[::-1])),
        output=Tensor("candidates", (1, 8, count_candidates(*DETECTOR_SIZE_WH[::-1]))),
        classes=DETECTOR_CLASSES,
        preprocessing=Preprocessing("letterbox", _UNCHANGED, (1.0, 1.0, 1.0), pad_grey=114),
        architecture="YOLOX-nano shape, joint objectness and class scores",
        licence="weights: for research; see the terms of each training source",
    ),
}


CONTRACTS["gate"] = Model(
    name="gate",
    file="gate.onnx",
    sha256="",
    size_bytes=0,
    parameters=0,
    opset=OPSET,
    input=Tensor("input", (1, 3, IMAGE_QUALITY_WH[1], IMAGE_QUALITY_WH[0])),
    output=Tensor("fitness", (1, 1)),
    classes=("fit",),
    preprocessing=Preprocessing("stretch", _UNCHANGED, (1.0, 1.0, 1.0)),
    architecture="first four stages of MobileNetV2, two dense layers",
    licence="weights: for research; see the terms of each training source",
)


def sized_detector(contract: Model, height_px: int, width_px: int) -> Model:
    """The contract of a detector for another size of input."""
    return msgspec.structs.replace(
        contract,
        input=Tensor(contract.input.name, (1, 3, height_px, width_px)),
        output=Tensor(contract.output.name, (1, 8, count_candidates(height_px, width_px))),
    )


# The paper's networks are exported as what they are for, so that a folder with both is a set of weights.
CONTRACTS["yolo11n"] = msgspec.structs.replace(
    sized_detector(CONTRACTS["detector"], *SIZE_WH[::-1]),
    architecture="YOLO11n shape, independent implementation; not affiliated with its authors",
)
CONTRACTS["paper-segmenter"] = msgspec.structs.replace(
    CONTRACTS["segmenter"],
    architecture="MobileNetV3-Small encoder, 64-channel top-down decoder",
)


def build_network(name: str) -> nn.Module:
    """An untrained network of a contract."""
    nets = {
        "segmenter": ShippedSegmenter,
        "paper-segmenter": PaperSegmenter,
        "detector": Detector,
        "yolo11n": Yolo11n,
        "gate": ImageQualityNetwork,
    }
    return nets[name]()


class SmallerInside(nn.Module):
    """A segmenter that looks at a smaller picture than its input, as in its training; its scores are interpolated."""

    def __init__(self, net: nn.Module, size_hw: tuple[int, int]) -> None:
        super().__init__()
        self.net, self.size_hw = net, size_hw

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        outer = (int(x.shape[2]), int(x.shape[3]))
        scores = self.net(F.interpolate(x, size=self.size_hw, mode="bilinear", align_corners=False))
        return F.interpolate(scores, size=outer, mode="bilinear", align_corners=False)


def export_network(
    name: str,
    checkpoint: Path,
    folder: Path,
    inputs: Sequence[NDArray[np.float32]],
    origins: tuple[Origin, ...],
    licence: str | None = None,
    *,
    looks_at: tuple[int, int] | None = None,
    change: Callable[[nn.Module], None] | None = None,
) -> Model:
    """Write the ONNX file into `folder` and its manifest entry, both by renaming, and return the entry.

    licence: that of the contract, which is for research, where not given.
    change: what is done to the checkpoint's weights before.
    looks_at: height and width of the picture inside a segmenter whose training ended at that size.
    inputs: real pictures, already preprocessed, for the comparison. Figures are left empty.
    Raises UserError where the checkpoint does not fit or the outputs differ by more than TOLERANCE.
    """
    net = build_network(name)
    load_averaged_weights(net, checkpoint)
    if change is not None:
        change(net)
    if looks_at is not None:
        net = SmallerInside(net, looks_at)
    recipe = read_recipe(checkpoint)
    return _export_and_place(contract_of(name, recipe), net, folder, inputs, origins, recipe.seed, licence)


def contract_of(name: str, recipe: TrainedWith) -> Model:
    """The contract of a network; of a detector, for the size of input that it was trained with."""
    if name != "detector":
        return CONTRACTS[name]
    return sized_detector(CONTRACTS[name], recipe.height_px or SIZE_WH[1], recipe.width_px or SIZE_WH[0])


def export_untrained(name: str, folder: Path) -> Model:
    """Write a network of random weights and its manifest entry: as fast as a trained one, and good for nothing else."""
    seed = 42
    torch.manual_seed(seed)
    shape = CONTRACTS[name].input.shape
    noise = np.random.default_rng(seed).random(shape, dtype=np.float32)
    net = build_network(name).train()
    for module in net.modules():
        if isinstance(module, nn.BatchNorm2d):
            module.momentum = 1.0
    with torch.no_grad():
        net(torch.from_numpy(noise))  # without statistics the numbers shrink from step to step until they slow it down
    return _export_and_place(CONTRACTS[name], net.eval(), folder, [noise], (), seed)


def _export_and_place(
    contract: Model,
    net: nn.Module,
    folder: Path,
    inputs: Sequence[NDArray[np.float32]],
    origins: tuple[Origin, ...],
    seed: int,
    licence: str | None = None,
) -> Model:
    name = contract.name
    folder.mkdir(parents=True, exist_ok=True)
    with replacement_file(folder / contract.file) as beside:
        write_onnx(net, contract, beside)
        difference = largest_export_difference(net, beside, inputs)
        if not difference <= MAX_EXPORT_DIFFERENCE:
            raise UserError(
                f"{name}: the exported net differs by {difference:.2e}, more than {MAX_EXPORT_DIFFERENCE:.0e}"
            )
        model = msgspec.structs.replace(
            contract,
            sha256=file_sha256(beside),
            size_bytes=beside.stat().st_size,
            parameters=FUSED_PARAMETERS if isinstance(net, Yolo11n) else parameter_count(net),
            export_max_abs_diff=float(f"{difference:.2e}"),
            origins=origins,
            seed=seed,
            licence=licence or contract.licence,
        )
        catalogue = load_catalogue(folder) if (folder / "manifest.json").exists() else {}
    save_catalogue({**catalogue, name: model}, folder)
    return model


def write_onnx(net: nn.Module, contract: Model, path: Path) -> None:
    """Export in evaluation mode with static shapes, and check the file's structure."""
    net.eval().to("cpu", memory_format=torch.contiguous_format)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the TorchScript exporter announces its age and every traced constant
        torch.onnx.export(
            net,
            (torch.zeros(contract.input.shape),),
            str(path),
            input_names=[contract.input.name],
            output_names=[contract.output.name],
            opset_version=OPSET,
            dynamo=False,
        )
    onnx.checker.check_model(onnx.load(str(path)), full_check=True)


@torch.no_grad()
def largest_export_difference(net: nn.Module, path: Path, inputs: Sequence[NDArray[np.float32]]) -> float:
    """Largest absolute difference between the PyTorch network and the ONNX file over the inputs.

    The detector's box rows are compared as fractions of the input's size: in pixels, the exponential that makes a
    side of 300 px turns single-precision rounding of either engine into some 1e-3.
    """
    run = open_network(path)
    worst = 0.0
    for x in inputs:
        difference = np.abs(net(torch.from_numpy(x)).numpy() - run(x))
        if isinstance(net, Detector | Yolo11n):
            height, width = x.shape[2:]
            difference[:, :4] /= np.array([width, height, width, height], np.float32)[:, None]
        worst = max(worst, float(difference.max()))
    return worst


class _DeclaredTerms(msgspec.Struct):
    repo: str = ""
    commit: str = ""
    licence: str = "not stated"


def read_origin(folder: Path, source: Source) -> Origin:
    """Read a source's provenance from its manifest; rendered pictures are the project's own."""
    if source.name == RENDERED:
        return Origin(source.name, "paani_sim", "", "Apache-2.0")
    path = folder / "manifest.json"
    try:
        stated = msgspec.json.decode(path.read_bytes(), type=_DeclaredTerms)
    except UNREADABLE as error:
        raise UserError(f"{path}: {error}") from error
    return Origin(source.name, stated.repo, stated.commit, stated.licence)
