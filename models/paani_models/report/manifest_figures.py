"""Measure the figures of the exported networks on held-out sequences that the manifest records (T3, U1 - U4)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from paani.cluster import Workers
from paani_models.catalogue import Figure
from paani_models.datasets.sources import DETECTOR_CLASSES, Sample
from paani_models.detector.metrics import summarise_class
from paani_models.detector.scores import count_false_alarms, score_boxes, select_annotated
from paani_models.network_input import SIZE_WH
from paani_models.segmenter.scores import WATER, mask_measures, open_segmenter, score_masks, sum_counts
from paani_models.training.augment import draw_null_picture

NULL_PICTURES = 200


def measure_segmenter(net: Path, samples: list[Sample], workers: Workers | None = None) -> list[Figure]:
    """IoU per class, their mean, and edge F1 per source, at the mask's own size; and the share of water in nothing.

    A class that is nowhere is left out. A source whose people marked only water is scored on water against the rest.
    """
    scored = score_masks(net, samples, workers)
    figures = []
    for source in dict.fromkeys(item.sample.source for item in scored):
        chosen = [item for item in scored if item.sample.source == source]
        counts = sum_counts(chosen)
        measured = {metric: measure(counts) for metric, measure in mask_measures(source).items()}
        figures += [
            Figure(metric, source.name, round(value, 4), len(chosen))
            for metric, value in measured.items()
            if np.isfinite(value)  # a class may be nowhere
        ]
    return [*figures, measure_null_pictures(net)]


def measure_null_pictures(net: Path) -> Figure:
    """Largest share of water over seeded pictures that show nothing."""
    segment = open_segmenter(net)
    worst = 0.0
    for seed in range(NULL_PICTURES):
        label = segment(draw_null_picture(np.random.default_rng(seed), SIZE_WH), SIZE_WH[::-1])
        worst = max(worst, float((label == WATER).mean()))
    return Figure("max_water_frac", "null_pictures", round(worst, 4), NULL_PICTURES)


def measure_detector(net: Path, samples: list[Sample], workers: Workers | None = None) -> list[Figure]:
    """AP50, AP50:95, recall and precision at 0.40 per class and source that annotates it, and over all sources."""
    scored = score_boxes(net, samples, workers)
    figures: list[Figure] = []
    for kind, label in enumerate(DETECTOR_CLASSES):
        matches = [(item.sample.source.name, item.class_matches(kind)) for item in select_annotated(scored, kind)]
        for group in [*dict.fromkeys(name for name, _ in matches), *(["all"] if matches else [])]:
            row = summarise_class([each for name, each in matches if group in (name, "all")])
            positives = int(row.pop("n"))
            figures.extend(
                Figure(f"{label}_{metric}", group, round(value, 4), positives)
                for metric, value in row.items()
                if positives and np.isfinite(value)
            )
    return figures


def measure_false_alarms(net: Path, samples: list[Sample], workers: Workers | None = None) -> list[Figure]:
    """Boxes above 0.40 per picture, of classes that a source's pictures do not show; n counts pictures."""
    figures = []
    for source in dict.fromkeys(sample.source for sample in samples if sample.source.empty_of):
        alarms = count_false_alarms(net, [sample for sample in samples if sample.source == source], workers)
        rate = round(sum(alarms) / len(alarms), 4)
        figures.append(Figure("false_alarms_per_picture", source.name, rate, len(alarms)))
    return figures
