"""How far the confidence of a mask is to be trusted, and the temperature of its softmax that makes it so.

One temperature divides all logits, fitted by likelihood (Guo et al. 2017): it changes no class, and how sure each cell
is of its own. The error is the expected calibration error over cells, before and after, on held-out sequences. Each is
judged at the temperature that the other half of them asks for, so that none is judged by its own fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import msgspec
import numpy as np

from paani.arrays import F32, F64, U8
from paani.cluster import Workers
from paani.errors import UserError
from paani_models.datasets.batches import Batch, network_of, score_batches
from paani_models.datasets.sources import IGNORE, Sample, read_picture
from paani_models.report.bootstrap import draw_sequence_counts, percentile_interval
from paani_models.report.height_scores import Interval
from paani_models.report.reliability import BINS, calibration_error
from paani_models.segmenter.scores import open_logits, read_truth

CELL_ROWS = 64  # perception judges masks in so many rows
TEMPERATURES = np.round(np.geomspace(0.25, 4.0, 81), 3)  # that are tried
AS_IT_IS = int(np.flatnonzero(TEMPERATURES == 1.0)[0])


class MaskCells(msgspec.Struct, frozen=True):
    """Sums over the judged cells of some pictures, at each of TEMPERATURES.

    loss: negative log-likelihood of the true classes [T]. bins: cells, their confidence and right ones [T, BINS, 3].
    """

    loss: F64
    bins: F64


class MaskCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """temperature: the likeliest over all sequences. before, after: expected calibration error at 1, and as fitted."""

    temperature: float
    before: Interval
    after: Interval
    sequences: int
    pictures: int
    cells: int


def measure_mask_calibration(net: Path, samples: Sequence[Sample], workers: Workers | None = None) -> MaskCalibration:
    """Fit and judge on held-out samples. Raises UserError where too little is held out, or a file cannot be read."""
    samples = [sample for sample in samples if not sample.source.water_only]
    places = {name: i for i, name in enumerate(sorted({f"{s.source.name}/{s.sequence}" for s in samples}))}
    if len(places) < 2:
        raise UserError(f"--sources: {len(places)} held-out sequences with masks of all classes; two are needed")
    size = len(places)
    loss, bins = np.zeros((size, len(TEMPERATURES))), np.zeros((size, len(TEMPERATURES), BINS, 3))
    for sample, cells in zip(samples, score_batches(score_cell_batch, net, samples, workers, "mask"), strict=True):
        place = places[f"{sample.source.name}/{sample.sequence}"]
        loss[place] += cells.loss
        bins[place] += cells.bins
    return calibrate(loss, bins, pictures=len(samples))


def calibrate(loss: F64, bins: F64, *, pictures: int) -> MaskCalibration:
    """From the sums of each sequence; see `MaskCells`."""
    size = len(loss)
    is_odd = np.arange(size) % 2 == 1
    fitted = np.where(is_odd, loss[~is_odd].sum(0).argmin(), loss[is_odd].sum(0).argmin())
    before, after = bins[:, AS_IT_IS], bins[np.arange(size), fitted]
    return MaskCalibration(
        temperature=float(TEMPERATURES[loss.sum(0).argmin()]),
        before=_error(before),
        after=_error(after),
        sequences=size,
        pictures=pictures,
        cells=int(before[..., 0].sum()),
    )


def score_cell_batch(batch: Batch) -> list[MaskCells]:
    """Of one batch, picture by picture."""
    logits_of = open_logits(network_of(batch))
    return [count_cells(logits_of(read_picture(sample.picture)), read_truth(sample)) for sample in batch.samples]


def count_cells(logits: F32, truth: U8) -> MaskCells:
    """The sums of one picture. logits: [1,3,h,w]. truth: classes [H,W]; what is ignored there is not judged."""
    height, width = logits.shape[2:]
    step = max(1, height // CELL_ROWS)
    label = cv2.resize(truth, (width, height), interpolation=cv2.INTER_NEAREST)[step // 2 :: step, step // 2 :: step]
    judged = label != IGNORE
    scores = logits[0, :, step // 2 :: step, step // 2 :: step][:, judged].astype(np.float64)
    right, of_truth = scores.argmax(0) == label[judged], scores[label[judged], np.arange(int(judged.sum()))]
    loss, bins = np.zeros(len(TEMPERATURES)), np.zeros((len(TEMPERATURES), BINS, 3))
    below, apart = scores - scores.max(0), scores.max(0) - of_truth
    for i, temperature in enumerate(TEMPERATURES):
        total = np.exp(below / temperature).sum(0)
        loss[i] = (np.log(total) + apart / temperature).sum()
        place = np.minimum((BINS / total).astype(np.int64), BINS - 1)
        for column, weights in enumerate((None, 1.0 / total, right)):
            bins[i, :, column] = np.bincount(place, weights, BINS)
    return MaskCells(loss, bins)


def format_mask_calibration(found: MaskCalibration) -> str:
    """Three lines: the temperature, and the error before and after."""
    head = f"{found.cells} cells of {found.pictures} pictures of {found.sequences} held-out sequences"
    return (
        f"perception.temperature = {found.temperature:g}: the likeliest on {head}\n"
        f"expected calibration error at 1: {_text(found.before)}\n"
        f"at the temperature of the other half of the sequences: {_text(found.after)}\n"
    )


def _error(cells: F64) -> Interval:
    drawn = np.tensordot(draw_sequence_counts(len(cells)).astype(np.float64), cells, 1)
    return Interval(float(calibration_error(cells.sum(0)[None])[0]), *percentile_interval(calibration_error(drawn)))


def _text(error: Interval) -> str:
    return f"{error.value:.4f} [{error.low:.4f}, {error.high:.4f}]"
