"""Train and export each network: which pictures, which starting weights, which recipe."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import nn

from paani.errors import UserError
from paani_models.catalogue import OTHER_SETS, PAPER_WEIGHTS, WEIGHTS, verified_path
from paani_models.datasets.selection import PictureSelection
from paani_models.datasets.sources import read_picture
from paani_models.datasets.terms import OPEN_LICENCE, OPEN_TERMS
from paani_models.detector.data import read_boxed_pictures
from paani_models.detector.distillation import Teacher, add_teachers_boxes, blend_weights
from paani_models.detector.off_the_shelf import open_off_the_shelf
from paani_models.detector.paper_network import Yolo11n
from paani_models.detector.shipped_network import FIRST_STAGES, Detector, load_yolox_weights
from paani_models.detector.train import DetectorRecipe, DetectorTraining
from paani_models.detector.train_paper_network import Yolo11nRecipe, Yolo11nTraining
from paani_models.engines.onnx_file import read_onnx
from paani_models.image_quality.network import ImageQualityNetwork, start_from_export
from paani_models.image_quality.train import ImageQualityRecipe, ImageQualityTraining
from paani_models.network_input import (
    DETECTOR_SIZE_WH,
    SIZE_WH,
    detector_input,
    image_quality_input,
    segmenter_batch,
    segmenter_input,
)
from paani_models.recipes.onnx_export import contract_of, export_network, export_untrained, read_origin
from paani_models.recipes.warm_start import load_exported
from paani_models.segmenter.distillation import Distillation
from paani_models.segmenter.paper_network import PaperSegmenter
from paani_models.segmenter.pseudo_labels import pseudo_label_pictures
from paani_models.segmenter.shipped_network import ShippedSegmenter, load_imagenet_encoder
from paani_models.segmenter.train import PAPER_RECIPE, SegmenterRecipe, SegmenterTraining, cache_pictures
from paani_models.training.training_state import Stage, load_averaged_weights, load_checkpoint, read_recipe

IMAGENET_FILE = "_weights/mobilenetv2_1.0_imagenet_folded_fp16.npz"
COCO_FILE = "_weights/yolox_nano_coco.onnx"
SHIPPED = [folder.resolve() for folder in (WEIGHTS, *OTHER_SETS.values())]
PAPER_NETWORKS = ("paper-segmenter", "yolo11n")
COMPARED_PICTURES = 8  # on which an exported network must agree with its checkpoint

STAGE = re.compile(r"[1-9][0-9]{0,3}x[1-9][0-9]{0,3}x[1-9][0-9]{0,3}")

IMAGENET_RECIPE = SegmenterRecipe(stages=(Stage(12, 128, 160), Stage(12, 256, 320)), peak_rate=1e-3)


@dataclass(frozen=True)
class TrainingOptions:
    """Options of one training on the command line; None and () stand for the recipe's own."""

    folder: Path
    start: Path | None = None
    teacher: Path | None = None
    labels_from: Path | None = None
    stages: tuple[str, ...] = ()
    epochs: int | None = None
    peak_rate: float | None = None
    unchecked: bool = False
    blend: float | None = None
    mean_with: Path | None = None
    draws_frac: float = 1.0
    size: str | None = None
    batch: int | None = None
    seed: int | None = None
    without: tuple[str, ...] = ()


def train_network(net: str, pictures: PictureSelection, options: TrainingOptions, threads: int) -> None:
    """Train a network into `options.folder`, from its last finished epoch if there is one.

    Raises UserError naming a file that cannot be read.
    """
    torch.set_num_threads(threads)
    for path in (options.start, options.teacher, options.labels_from, options.mean_with):
        if path is not None:  # reading pictures takes minutes
            (read_onnx if path.suffix == ".onnx" else load_checkpoint)(path)
    if net == "detector":
        _train_detector(pictures, options)
    elif net == "yolo11n":
        _train_yolo11n(pictures, options)
    elif net == "gate":
        _train_image_quality(pictures, options)
    else:
        _train_segmenter(net, pictures, options)


def parse_stages(stages: tuple[str, ...]) -> tuple[Stage, ...]:
    """`4x128x160` -> Stage(4, 128, 160). Raises UserError where it is malformed or no multiple of 32."""
    parsed = []
    for text in stages:
        if not STAGE.fullmatch(text):
            raise UserError(f"stage: {text!r} is not EPOCHSxHEIGHTxWIDTH")
        stage = Stage(*map(int, text.split("x")))
        if stage.height_px % 32 or stage.width_px % 32:
            raise UserError(f"stage: {text!r}: height and width must be multiples of 32")
        parsed.append(stage)
    return tuple(parsed)


def parse_size(text: str) -> tuple[int, int]:
    """`320x416` -> height and width. Raises UserError as `parse_stages`."""
    (stage,) = parse_stages((f"1x{text}",))
    return stage.height_px, stage.width_px


def segmenter_recipe(net: str, options: TrainingOptions) -> SegmenterRecipe:
    """What decides a training of this segmenter. Raises UserError naming an option that is malformed."""
    recipe = IMAGENET_RECIPE if net == "segmenter" else PAPER_RECIPE
    return replace(
        recipe,
        stages=parse_stages(options.stages) or recipe.stages,
        peak_rate=options.peak_rate or recipe.peak_rate,
        batch=options.batch or recipe.batch,
        seed=recipe.seed if options.seed is None else options.seed,
        without=options.without,
    )


def image_quality_recipe(options: TrainingOptions) -> ImageQualityRecipe:
    """What decides a training of the image-quality network."""
    recipe = ImageQualityRecipe(checked=not options.unchecked)
    return replace(
        recipe,
        epochs=options.epochs or recipe.epochs,
        peak_rate=options.peak_rate or recipe.peak_rate,
        seed=recipe.seed if options.seed is None else options.seed,
    )


def detector_recipe(options: TrainingOptions) -> DetectorRecipe:
    """What decides a training of the detector. Raises UserError naming an option that is malformed."""
    height_px, width_px = parse_size(options.size) if options.size else DETECTOR_SIZE_WH[::-1]
    recipe = DetectorRecipe(height_px=height_px, width_px=width_px)
    return replace(
        recipe,
        epochs=options.epochs or recipe.epochs,
        peak_rate=options.peak_rate or recipe.peak_rate,
        batch=options.batch or recipe.batch,
        seed=recipe.seed if options.seed is None else options.seed,
        draws_frac=options.draws_frac,
        distilled=options.blend is not None,
    )


def _train_segmenter(net: str, pictures: PictureSelection, options: TrainingOptions) -> None:
    recipe = segmenter_recipe(net, options)
    model = start_segmenter(net, pictures.data, recipe.seed)
    samples, distillation = pictures.segmented_samples(held_out=False), None
    if options.teacher is not None:
        teacher = ShippedSegmenter()
        load_averaged_weights(teacher, options.teacher)
        distillation = Distillation(teacher)
    if options.teacher is not None or options.labels_from is not None:
        samples += pictures.unsegmented_samples()
    held_out = cache_pictures(pictures.segmented_samples(held_out=True))
    cached = cache_pictures(samples)
    if options.labels_from is not None:
        labeller = ShippedSegmenter()
        load_averaged_weights(labeller, options.labels_from)
        cached = pseudo_label_pictures(labeller, cached, samples)
    training = SegmenterTraining(model, recipe, options.folder, cached, held_out, distillation)
    if options.start is not None and options.start.suffix == ".onnx":
        resized = np.stack(
            [np.asarray(cv2.resize(p.picture, SIZE_WH), np.uint8) for p in cached[:: max(1, len(cached) // 32)]]
        )
        load_exported(model, options.start, torch.from_numpy(segmenter_batch(resized)))
        training.state.average_from_model()
    elif options.start is not None:
        training.state.start_from(options.start)
    training.run()


def start_segmenter(net: str, data: Path, seed: int) -> ShippedSegmenter | PaperSegmenter:
    """The segmenter that a training begins with: random weights of `seed`, the shipped one's encoder ImageNet's."""
    torch.manual_seed(seed)
    if net != "segmenter":
        return PaperSegmenter()
    model = ShippedSegmenter()
    load_imagenet_encoder(model, data / IMAGENET_FILE)
    return model


def _train_detector(pictures: PictureSelection, options: TrainingOptions) -> None:
    recipe = detector_recipe(options)
    torch.manual_seed(recipe.seed)
    model = start_detector(pictures.data, options)
    cached = read_boxed_pictures(pictures.boxed_samples(held_out=False))
    held_out = read_boxed_pictures(pictures.boxed_samples(held_out=True))
    teacher = None
    if options.blend is not None:
        teacher = Teacher(pictures.data / COCO_FILE)
        blend_weights(model, teacher.net, options.blend)
        if options.blend > 0 or teacher.has_first_stages_of(model):
            recipe = replace(recipe, frozen=FIRST_STAGES)
        found = options.folder / "teachers_boxes.json"
        cached = add_teachers_boxes(cached, open_off_the_shelf(pictures.data, torch.get_num_threads()), found)
    training = DetectorTraining(model, recipe, options.folder, cached, held_out, teacher)
    if recipe.distilled:
        training.state.average_from_model()
    training.run()


def start_detector(data: Path, options: TrainingOptions) -> Detector:
    """The detector that a training begins with: YOLOX-nano's weights, `start`, or the mean of that and `mean_with`."""
    model = Detector()
    if options.start is None:
        load_yolox_weights(model, data / COCO_FILE)
    else:
        _load_detector(model, options.start)
    if options.mean_with is not None:
        take_share(model, options.mean_with, 0.5)
    return model


def take_share(model: nn.Module, path: Path, share: float) -> None:
    """Give the weights of a detector, or of an image-quality network, that share of those of an exported file.

    Of a detector a checkpoint will do as well. Raises UserError.
    """
    other: Detector | ImageQualityNetwork
    if isinstance(model, ImageQualityNetwork):
        other = ImageQualityNetwork()
        start_from_export(other, path)
    else:
        other = Detector()
        _load_detector(other, path)
    blend_weights(model, other, share, "--share")


def _load_detector(model: Detector, path: Path) -> None:
    """From a checkpoint or an exported ONNX file."""
    if path.suffix == ".onnx":
        load_exported(model, path, torch.zeros(1, 3, SIZE_WH[1], SIZE_WH[0]))
    else:
        load_averaged_weights(model, path)


def _train_yolo11n(pictures: PictureSelection, options: TrainingOptions) -> None:
    recipe = Yolo11nRecipe()
    recipe = replace(recipe, epochs=options.epochs or recipe.epochs, peak_rate=options.peak_rate or recipe.peak_rate)
    model = start_yolo11n(recipe.seed, options.start)
    cached = read_boxed_pictures(pictures.boxed_samples(held_out=False))
    held_out = read_boxed_pictures(pictures.boxed_samples(held_out=True))
    Yolo11nTraining(model, recipe, options.folder, cached, held_out).run()


def start_yolo11n(seed: int, start: Path | None) -> Yolo11n:
    """The paper-shaped detector that a training begins with: the weights of `start`, or random ones of `seed`."""
    torch.manual_seed(seed)
    model = Yolo11n()
    if start is not None:
        load_averaged_weights(model, start)
    return model


def _train_image_quality(pictures: PictureSelection, options: TrainingOptions) -> None:
    """`options.labels_from`: the segmenter whose errors decide what is fit; the shipped one if not given."""
    recipe = image_quality_recipe(options)
    never = {sample.picture: sample for sample in pictures.training_samples()}
    masked = {
        sample.picture: sample for sample in pictures.segmented_samples(held_out=False) if sample.picture in never
    }
    samples = list({**never, **masked}.values())
    segmenter = options.labels_from or verified_path("segmenter")
    imagenet = pictures.data / IMAGENET_FILE
    ImageQualityTraining(options.folder, samples, segmenter, imagenet, recipe, options.start).run()


def export_untrained_network(net: str, weights: Path) -> int:
    """Write the ONNX file and its manifest entry. Raises UserError rather than write among the shipped weights."""
    if weights.resolve() in SHIPPED:
        raise UserError("--untrained: name a folder with --weights; the shipped nets stay")
    model = export_untrained(net, weights)
    sys.stdout.write(f"{weights / model.file}: {model.size_bytes} bytes, random weights\n")
    return 0


def export_checkpoint(
    net: str,
    checkpoint: Path,
    weights: Path,
    pictures: PictureSelection,
    *,
    looks_at: str | None = None,
    mean_with: Path | None = None,
    share: float | None = None,
) -> None:
    """Write the ONNX file and its manifest entry, with the provenance of the chosen sources.

    looks_at: `HEIGHTxWIDTH` of the picture inside a segmenter. mean_with, share: a detector's or a gate's earlier
    weights, and how much of them the mean with the checkpoint's takes (None: half). Raises UserError where one is
    malformed, not for the network or without the other, and rather than put one of the paper's networks in the place
    of ours.
    """
    if net in PAPER_NETWORKS and weights.resolve() == WEIGHTS.resolve():
        raise UserError(f"--weights: {net} is not what ships there; the set `paper` lies in {PAPER_WEIGHTS}")
    inside = None
    if looks_at is not None:
        if "segmenter" not in net:
            raise UserError(f"--looks-at: {net} is no segmenter")
        inside = parse_size(looks_at)
    if mean_with is not None and net not in ("detector", "gate"):
        raise UserError(f"--mean-with: {net} is neither our detector nor our gate")
    if share is not None and mean_with is None:
        raise UserError(f"--share {share:g}: of what? --mean-with says whose weights")
    chosen = (
        pictures.boxed_samples(held_out=True)
        if net in ("detector", "yolo11n")
        else pictures.segmented_samples(held_out=True)
    )
    step = max(1, len(chosen) // COMPARED_PICTURES)
    size_wh = contract_of(net, read_recipe(checkpoint)).size_hw[::-1]
    prepare = {
        "detector": lambda picture: detector_input(picture, size_wh),
        "yolo11n": lambda picture: detector_input(picture, size_wh),
        "gate": image_quality_input,
    }.get(net, segmenter_input)
    inputs = [prepare(read_picture(sample.picture)) for sample in chosen[::step][:COMPARED_PICTURES]]
    if not inputs:
        raise UserError("sources: no held-out picture to compare the export on")
    used = {sample.source.name for sample in pictures.samples}
    origins = tuple(read_origin(pictures.source_folder(s), s) for s in pictures.sources if s.name in used)
    licence = OPEN_LICENCE if used <= set(OPEN_TERMS) else None
    change = None
    if mean_with is not None:
        change = partial(take_share, path=mean_with, share=0.5 if share is None else share)
    model = export_network(net, checkpoint, weights, inputs, origins, licence, looks_at=inside, change=change)
    sys.stdout.write(
        f"{weights / model.file}: {model.size_bytes} bytes, differs by {model.export_max_abs_diff:.1e} at most\n"
    )
