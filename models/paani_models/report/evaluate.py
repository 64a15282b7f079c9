"""Figures of the exported nets on held-out sequences, per source (T3, U1 - U4)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from paani_models.catalogue import Figure
from paani_models.datasets.sources import DETECTOR_CLASSES, Sample
from paani_models.detector.metrics import summary
from paani_models.detector.scores import annotating, false_alarms, score_boxes
from paani_models.network_input import SIZE_WH
from paani_models.segmenter.scores import WATER, added, mask_measures, score_masks, segmenter
from paani_models.training.augment import null_picture

NULL_PICTURES = 200


def segmenter_figures(net: Path, samples: list[Sample]) -> list[Figure]:
    """IoU per class, their mean, and edge F1 per source, at the mask's own size; and the share of water in nothing.

    A source whose people marked only water is scored on water against the rest.
    """
    scored = score_masks(net, samples)
    figures = []
    for source in dict.fromkeys(item.sample.source for item in scored):
        chosen = [item for item in scored if item.sample.source == source]
        for metric, measure in mask_measures(source).items():
            figures.append(Figure(metric, source.name, round(measure(added(chosen)), 4), len(chosen)))
    return [*figures, null_figure(net)]


def null_figure(net: Path) -> Figure:
    """Largest share of water over seeded pictures that show nothing."""
    segment = segmenter(net)
    worst = 0.0
    for seed in range(NULL_PICTURES):
        label = segment(null_picture(np.random.default_rng(seed), SIZE_WH), SIZE_WH[::-1])
        worst = max(worst, float((label == WATER).mean()))
    return Figure("max_water_frac", "null_pictures", round(worst, 4), NULL_PICTURES)


def detector_figures(net: Path, samples: list[Sample]) -> list[Figure]:
    """AP50, AP50:95, recall and precision at 0.40 per class and source that annotates it, and over all sources."""
    scored = score_boxes(net, samples)
    figures: list[Figure] = []
    for kind, label in enumerate(DETECTOR_CLASSES):
        judged = [(item.sample.source.name, item.judged(kind)) for item in annotating(scored, kind)]
        for group in [*dict.fromkeys(name for name, _ in judged), *(["all"] if judged else [])]:
            row = summary([each for name, each in judged if group in (name, "all")])
            positives = int(row.pop("n"))
            figures.extend(
                Figure(f"{label}_{metric}", group, round(value, 4), positives)
                for metric, value in row.items()
                if np.isfinite(value)
            )
    return figures


def false_alarm_figures(net: Path, samples: list[Sample]) -> list[Figure]:
    """Boxes above 0.40 per picture, of classes that a source's pictures do not show; n counts pictures."""
    figures = []
    for source in dict.fromkeys(sample.source for sample in samples if sample.source.empty_of):
        alarms = false_alarms(net, [sample for sample in samples if sample.source == source])
        rate = round(sum(alarms) / len(alarms), 4)
        figures.append(Figure("false_alarms_per_picture", source.name, rate, len(alarms)))
    return figures
