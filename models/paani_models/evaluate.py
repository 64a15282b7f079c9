"""Figures of the exported nets on held-out sequences, per source (checklist T3, U1 - U4)."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from paani.errors import UserError
from paani_models.augment import null_picture
from paani_models.catalogue import Figure
from paani_models.detection_metrics import CONFIDENCE, Found, class_figures, decode
from paani_models.detector_data import BoxedPicture, plain, read_boxed
from paani_models.network_input import SIZE_WH, detector_input, segmenter_input
from paani_models.onnx_runner import Floats, open_net
from paani_models.segmenter_metrics import class_iou, confusion, edge_counts, f1
from paani_models.sources import DETECTOR_CLASSES, SEGMENTER_CLASSES, WATER_MASKS, Sample, read_mask, read_picture

WATER, OBSTACLE = SEGMENTER_CLASSES.index("water"), SEGMENTER_CLASSES.index("obstacle")
NULL_PICTURES = 200


def segmenter_figures(net: Path, samples: list[Sample]) -> list[Figure]:
    """IoU per class, their mean, and edge F1 per source, at the mask's own size; and the share of water in nothing.

    A source whose people marked only water is scored on water against the rest.
    """
    run = open_net(net)
    figures: list[Figure] = []
    for name in dict.fromkeys(sample.source.name for sample in samples):
        chosen = [sample for sample in samples if sample.source.name == name]
        counts = np.zeros((len(SEGMENTER_CLASSES), len(SEGMENTER_CLASSES)), np.int64)
        edges = np.zeros(4, np.int64)
        for sample in tqdm(chosen, name, unit="picture", mininterval=5.0):
            truth = read_truth(sample)
            label = _label(run(segmenter_input(read_picture(sample.picture))), truth.shape[:2])
            if sample.source.water_only:
                label = np.minimum(label, OBSTACLE)
            counts += confusion(label, truth, len(SEGMENTER_CLASSES))
            edges += edge_counts(label, truth)
        scored = ("water",) if chosen[0].source.water_only else SEGMENTER_CLASSES
        iou = class_iou(counts)
        rows = {f"iou_{kind}": float(iou[SEGMENTER_CLASSES.index(kind)]) for kind in scored}
        if len(scored) == len(SEGMENTER_CLASSES):
            rows["miou"] = float(np.nanmean(iou))
        if not chosen[0].source.soft_edges:
            rows["edge_f1"] = f1(*(int(count) for count in edges))
        figures.extend(Figure(metric, name, round(value, 4), len(chosen)) for metric, value in rows.items())
    return [*figures, null_figure(net)]


def read_truth(sample: Sample) -> NDArray[np.uint8]:
    """Read what people drew, in segmenter classes; where they drew only water, the rest is obstacle."""
    if sample.mask is None:
        raise UserError(f"{sample.picture}: has no mask")
    drawn = sample.mask.parent.parent / WATER_MASKS / sample.mask.name if sample.source.water_only else sample.mask
    return read_mask(drawn)


def null_figure(net: Path) -> Figure:
    """Largest share of water over seeded pictures that show nothing."""
    run = open_net(net)
    worst = 0.0
    for seed in range(NULL_PICTURES):
        label = _label(run(segmenter_input(null_picture(np.random.default_rng(seed), SIZE_WH))), SIZE_WH[::-1])
        worst = max(worst, float((label == WATER).mean()))
    return Figure("max_water_frac", "null_pictures", round(worst, 4), NULL_PICTURES)


def _label(logits: Floats, shape: tuple[int, ...]) -> NDArray[np.uint8]:
    label = logits[0].argmax(0).astype(np.uint8)
    return np.asarray(cv2.resize(label, (shape[1], shape[0]), interpolation=cv2.INTER_NEAREST), np.uint8)


def detector_figures(net: Path, samples: list[Sample]) -> list[Figure]:
    """AP50, AP50:95, recall and precision at 0.40 per class and source that annotates it, and over all sources."""
    run = open_net(net)
    items: list[BoxedPicture] = []
    found: list[Found] = []
    truths: list[NDArray[np.float32]] = []
    for sample in tqdm(samples, "detector", unit="picture", mininterval=5.0):
        item = read_boxed(sample)
        example = plain(item, SIZE_WH)
        items.append(item)
        truths.append(example.boxes)
        found.append(decode(run(detector_input(item.picture))[0], confidence=0.01, limit=100))
    figures: list[Figure] = []
    annotated = {sample.source.name: sample.source.annotated for sample in samples}
    for kind, label in enumerate(DETECTOR_CLASSES):
        for group in [*annotated, "all"]:
            chosen = [
                index
                for index, item in enumerate(items)
                if label in annotated[item.source] and group in (item.source, "all")
            ]
            if not chosen:
                continue
            row = class_figures([found[i] for i in chosen], [truths[i] for i in chosen], kind)
            positives = int(row.pop("n"))
            figures.extend(
                Figure(f"{label}_{metric}", group, round(value, 4), positives)
                for metric, value in row.items()
                if np.isfinite(value)
            )
    return figures


def false_alarm_figures(net: Path, samples: list[Sample]) -> list[Figure]:
    """Boxes above 0.40 per picture, of classes that a source's pictures do not show; n counts pictures."""
    run = open_net(net)
    figures = []
    for source in dict.fromkeys(sample.source for sample in samples if sample.source.empty_of):
        chosen = [sample for sample in samples if sample.source == source]
        absent = [DETECTOR_CLASSES.index(kind) for kind in source.empty_of]
        alarms = 0
        for sample in tqdm(chosen, f"{source.name} alarms", unit="picture", mininterval=5.0):
            found = decode(run(detector_input(read_picture(sample.picture)))[0], CONFIDENCE)
            alarms += int(np.isin(found.classes, absent).sum())
        figures.append(Figure("false_alarms_per_picture", source.name, round(alarms / len(chosen), 4), len(chosen)))
    return figures
