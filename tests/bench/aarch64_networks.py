"""Do FP32 and INT8 networks say on the board's processor what they say here? Under emulation: answers, not speed.

    tests/bench/aarch64_root.sh runs/aarch64
    .venv/bin/python tests/bench/aarch64_networks.py runs/aarch64 segmenter runs/int8/segmenter-equalised.onnx

Prints one JSON object: the score (mIoU, AP50) of both networks here and there on the same held-out pictures, and how
far the answers lie apart.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32
from paani_models.catalogue import verified_path
from paani_models.commands.models import data_folder
from paani_models.datasets.selection import PictureSelection
from paani_models.datasets.sources import DETECTOR_CLASSES, SEGMENTER_CLASSES, Sample, read_picture
from paani_models.detector.data import letterbox_example, read_boxed
from paani_models.detector.exported import open_detector
from paani_models.detector.metrics import ap50, decode_boxes, match_class
from paani_models.engines.onnx_runner import open_network
from paani_models.network_input import segmenter_input
from paani_models.segmenter.metrics import class_iou, confusion_matrix
from paani_models.segmenter.scores import label_from_logits, merge_undrawn_sky, read_truth, scored_classes

TIME_LIMIT_S = 900
WORKER = """
import sys, numpy as np, onnxruntime as ort
net, source, target = sys.argv[1:]
options = ort.SessionOptions()
options.intra_op_num_threads = options.inter_op_num_threads = 1
session = ort.InferenceSession(net, options, providers=["CPUExecutionProvider"])
name = session.get_inputs()[0].name
np.save(target, np.concatenate([session.run(None, {name: x[None]})[0] for x in np.load(source)]))
"""


def main() -> int:
    """Compare, print, and return 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=Path, help="folder that aarch64_root.sh made")
    parser.add_argument("net", choices=("segmenter", "detector"))
    parser.add_argument("int8", type=Path)
    parser.add_argument("--pictures", type=int, default=40)
    options = parser.parse_args()
    pictures = PictureSelection(data_folder(), [], None)
    segmenting = options.net == "segmenter"
    held_out = pictures.segmented_samples(held_out=True) if segmenting else pictures.boxed_samples(held_out=True)
    samples = held_out[:: max(1, len(held_out) // options.pictures)][: options.pictures]
    prepare = segmenter_input if segmenting else open_detector(verified_path(options.net), 1).prepare
    inputs = np.concatenate([prepare(read_picture(sample.picture)) for sample in samples])
    score = _miou if segmenting else partial(_ap50, inputs.shape[:1:-1])
    result: dict[str, float] = {"pictures": len(samples)}
    for kind, net in (("fp32", verified_path(options.net)), ("int8", options.int8)):
        run = open_network(net, 1)
        here = np.concatenate([run(x[None]) for x in inputs])
        there = _emulated(options.root, net, inputs)
        if segmenting:
            result[f"{kind}_labels_alike"] = float((here.argmax(1) == there.argmax(1)).mean())
        else:
            result[f"{kind}_largest_score_difference"] = float(np.abs(here[:, 4:] - there[:, 4:]).max())
        result[f"{kind}_here"], result[f"{kind}_cortex_a53"] = score(here, samples), score(there, samples)
    sys.stdout.write(msgspec.json.encode({key: round(value, 4) for key, value in result.items()}).decode() + "\n")
    return 0


def _emulated(root: Path, net: Path, inputs: F32) -> F32:
    with tempfile.TemporaryDirectory() as folder:
        source, target, worker = (Path(folder) / name for name in ("inputs.npy", "outputs.npy", "worker.py"))
        np.save(source, inputs)
        worker.write_text(WORKER)
        command = [str(root / "python"), str(worker), str(net.resolve()), str(source), str(target)]
        subprocess.run(command, check=True, timeout=TIME_LIMIT_S)
        return np.asarray(np.load(target), np.float32)


def _miou(outputs: F32, samples: list[Sample]) -> float:
    """Mean IoU per source, averaged."""
    counts: dict[str, NDArray[np.int64]] = {}
    kinds = {sample.source.name: scored_classes(sample.source) for sample in samples}
    for output, sample in zip(outputs, samples, strict=True):
        truth = read_truth(sample)
        label = merge_undrawn_sky(label_from_logits(output[None], truth.shape), sample.source)
        counts[sample.source.name] = counts.get(sample.source.name, 0) + confusion_matrix(
            label, truth, len(SEGMENTER_CLASSES)
        )
    ious = [class_iou(counts[name])[[SEGMENTER_CLASSES.index(k) for k in kinds[name]]] for name in counts]
    return float(np.mean([np.nanmean(iou) for iou in ious]))


def _ap50(size_wh: tuple[int, int], outputs: F32, samples: list[Sample]) -> float:
    """AP50 averaged over the classes that occur."""
    found = [decode_boxes(output, 0.01, 100) for output in outputs]
    truths = [letterbox_example(read_boxed(sample), size_wh).boxes for sample in samples]
    values = []
    for kind, name in enumerate(DETECTOR_CLASSES):
        judged = [
            match_class(f, t, kind)
            for f, t, s in zip(found, truths, samples, strict=True)
            if name in s.source.annotated
        ]
        values.append(ap50(judged) if judged else float("nan"))
    return float(np.nanmean(values))


if __name__ == "__main__":
    sys.exit(main())
