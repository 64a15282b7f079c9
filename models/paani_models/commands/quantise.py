"""`paani models quantise`: an INT8 network, the record of how it came about, and whether it may take FP32's place."""

from __future__ import annotations

import argparse
import sys

from paani.errors import UserError
from paani.whole_file import write_json
from paani_models.catalogue import file_sha256, verified_path
from paani_models.datasets.selection import PictureSelection
from paani_models.datasets.sources import read_picture
from paani_models.detector.exported import open_detector
from paani_models.engines.contract_check import require_contract
from paani_models.network_input import segmenter_input
from paani_models.quantisation import acceptance
from paani_models.quantisation.acceptance import QuantisationRecord
from paani_models.quantisation.calibration_pictures import choose_calibration_samples, hash_sample_names
from paani_models.quantisation.quantise import RECIPES, quantise_network


def run(arguments: argparse.Namespace, pictures: PictureSelection) -> int:
    """Write <network>-<recipe>.onnx and .json into --out.

    Returns 0 where the acceptance test passes, 1 where it fails.
    """
    net, recipe = arguments.net, RECIPES[arguments.recipe][arguments.net]
    source = arguments.model or verified_path(net)
    require_contract(source, net)
    is_segmenter = net == "segmenter"
    labelled = [s for s in pictures.samples if (s.mask if is_segmenter else s.label)]
    held_out = pictures.segmented_samples(held_out=True) if is_segmenter else pictures.boxed_samples(held_out=True)
    if not held_out:
        raise UserError("sources: no held-out picture to judge on")
    chosen = choose_calibration_samples(labelled, arguments.calibrate, spread=recipe.spread)
    prepare = segmenter_input if is_segmenter else open_detector(source).prepare
    inputs = [prepare(read_picture(sample.picture)) for sample in chosen]
    target = arguments.out / f"{net}-{recipe.name}.onnx"
    quantise_network(source, target, recipe, inputs)
    score = acceptance.score_segmenter if is_segmenter else acceptance.score_detector
    (float_score, float_figures), (int8_score, figures) = score(source, held_out), score(target, held_out)
    best = None if is_segmenter else acceptance.largest_score(target, inputs)
    float_best = None if is_segmenter else acceptance.largest_score(source, inputs)
    timing = acceptance.time_networks(source, target, inputs[0])
    metric = "mIoU" if is_segmenter else "AP50"
    verdict = acceptance.decide_acceptance(
        100.0 * (float_score - int8_score),
        timing.ratio,
        for_size=arguments.for_size,
        metric=metric,
        largest_score=best,
        float_largest_score=float_best,
    )
    record = QuantisationRecord(
        net=net,
        recipe=recipe.name,
        file=target.name,
        sha256=file_sha256(target),
        float_sha256=file_sha256(source),
        size_bytes=target.stat().st_size,
        float_size_bytes=source.stat().st_size,
        calibration_pictures=len(chosen),
        calibration_sha256=hash_sample_names(chosen),
        metric=metric,
        score=round(int8_score, 4),
        float_score=round(float_score, 4),
        figures=figures,
        float_figures=float_figures,
        best_score=best,
        float_best_score=float_best,
        timing=timing,
        threads=acceptance.THREADS,
        machine=acceptance.describe_machine(),
        for_size=arguments.for_size,
        verdict=verdict,
    )
    write_json(target.with_suffix(".json"), record)
    sys.stdout.write(_format_record(record))
    return 0 if verdict.accepted else 1


def _format_record(record: QuantisationRecord) -> str:
    word = "accepted" if record.verdict.accepted else "rejected"
    lines = [
        f"{record.file}: {record.size_bytes} bytes (FP32 {record.float_size_bytes}), "
        f"{record.metric} {record.score:.4f} (FP32 {record.float_score:.4f}), "
        f"{record.timing.int8_ms:.2f} ms (FP32 {record.timing.float_ms:.2f})",
        *(
            f"  {new.source:18} {new.metric:12} {new.value:.4f}  FP32 {old.value:.4f}  n {new.n}"
            for new, old in zip(record.figures, record.float_figures, strict=True)
        ),
        f"{word}: {record.verdict.reason}",
    ]
    return "\n".join(lines) + "\n"
