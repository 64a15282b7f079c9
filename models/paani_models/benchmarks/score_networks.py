"""Score the networks on data sets in the layouts of LaRS and MODS, and write predictions in their formats.

LARS/image_list.txt, images/NAME.jpg, semantic_masks/, panoptic_masks/, panoptic_annotations.json
MODS/mods.json, sequences/NAME/frames/FILE, calibration/calibration-BASE.yaml
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from paani.arrays import F32, Bools
from paani.errors import UserError
from paani_models.benchmarks import lars, mods, mods_detection
from paani_models.datasets.checked_files import decode_picture, read_whole_file
from paani_models.datasets.sources import DETECTOR_CLASSES
from paani_models.detector.exported import open_detector
from paani_models.detector.metrics import CONFIDENCE, MAX_BOXES, Detections
from paani_models.segmenter.scores import open_segmenter

METHOD = "paani"


def score_lars(net: Path, root: Path, predictions: Path | None = None) -> dict[str, float]:
    """Figures in percent. predictions: folder for the masks in the server's colours.

    Raises UserError naming whatever of the layout is missing or unreadable.
    """
    names, segments, segment = lars.read_names(root), lars.read_segments(root), open_segmenter(net)
    tally = lars.LarsTally()
    for name in tqdm(names, "LaRS", unit="picture", mininterval=2.0):
        path = root / "images" / f"{name}.jpg"
        truth = lars.read_truth(root, name, segments)
        label = segment(decode_picture(read_whole_file(path), path), truth.semantic.shape)
        tally.add(lars.to_lars_classes(label), truth)
        if predictions is not None:
            lars.write_prediction(predictions, name, label)
    return tally.figures()


def score_mods(
    segmenter_net: Path, detector_net: Path, root: Path, predictions: Path | None = None
) -> dict[str, float]:
    """Edge error in px, shares and F1 in percent; `f_*` of the detector's three set-ups and `score`, their mean.

    predictions: folder for the masks and the detection file. Raises UserError as `score_lars`.
    """
    dataset = mods.read_dataset(root / "mods.json")
    segment, detector = open_segmenter(segmenter_net), open_detector(detector_net)
    tally = mods.ModsTally()
    above: list[tuple[F32, F32]] = []
    near: list[tuple[F32, F32]] = []
    found: dict[tuple[int, int], tuple[mods_detection.Detection, ...]] = {}
    for sequence in dataset.sequences:
        name = Path(sequence.path.strip("/")).parts[0]
        camera, distortion = read_calibration(root, name)
        for frame in tqdm(sequence.frames, name, unit="picture", mininterval=2.0):
            path = root / "sequences" / sequence.path.strip("/") / frame.image_file_name
            picture = decode_picture(read_whole_file(path), path)
            size_wh = (picture.shape[1], picture.shape[0])
            zone = mods.danger_zone(frame.roll, frame.pitch, camera, distortion, size_wh)
            label = segment(picture, picture.shape)
            complete = bool(sequence.exhaustive and frame.exhaustive)
            tally.add(mods.to_mods_classes(label), frame, zone, exhaustive=complete)
            rows = rows_inside(detector.find(picture, CONFIDENCE, MAX_BOXES), size_wh)
            kinds = [DETECTOR_CLASSES[int(kind)] for kind in rows[:, 0]]
            found[sequence.id, frame.id] = mods_detection.as_detections(kinds, rows[:, 1:])
            rows[:, 0] = [mods_detection.TYPE_OF[kind] for kind in kinds]
            land = mods.land_mask(frame.water_edges, picture.shape)
            true = annotated_rows(frame.obstacles)
            if complete:
                above.append((drop_ignored(rows, land), drop_ignored(true, land)))
            near.append((drop_ignored(rows, ~zone), drop_ignored(true, ~zone)))
            if predictions is not None:
                mods.write_prediction(predictions, METHOD, name, frame.image_file_name, mods.to_mods_classes(label))
    if predictions is not None:
        mods_detection.write_results(
            predictions / "detections.json", mods_detection.build_results(METHOD, dataset, found)
        )
    by_class = mods_detection.f_score(above, by_class=True)
    agnostic = mods_detection.f_score(above, by_class=False)
    in_zone = mods_detection.f_score(near, by_class=False)
    return {
        **tally.figures(),
        "f_by_class": by_class,
        "f_agnostic": agnostic,
        "f_zone": in_zone,
        "score": mods_detection.challenge_score(by_class, agnostic, in_zone),
    }


def rows_inside(found: Detections, size_wh: tuple[int, int]) -> F32:
    """Class and corners [n,5] of boxes in picture pixels, cut at the picture's edges."""
    return np.hstack([found.classes[:, None], found.boxes.clip(0, (*size_wh, *size_wh))]).astype(np.float32)


def annotated_rows(obstacles: Sequence[mods.Obstacle]) -> F32:
    """Type and corners [n,5] of what is annotated; regions that are not judged are left out."""
    types = {"ship": 0, "person": 1}
    rows = [
        (types.get(each.type, 2), *each.bbox[:2], each.bbox[0] + each.bbox[2], each.bbox[1] + each.bbox[3])
        for each in obstacles
        if each.type != "negative"
    ]
    return np.array(rows, np.float32).reshape(-1, 5)


def drop_ignored(rows: F32, ignored: Bools) -> F32:
    """Keep the rows of which no more than half lies in the ignored part of the picture."""
    kept_rows = []
    for row in rows:
        x1, y1, x2, y2 = np.round(row[1:]).astype(int)
        patch = ignored[y1:y2, x1:x2]
        if patch.size and patch.mean() <= 0.5:
            kept_rows.append(row)
    return np.array(kept_rows, np.float32).reshape(-1, 5)


def read_calibration(root: Path, sequence: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Left camera's matrix and distortion. Raises UserError naming a file that is missing or holds neither."""
    path = root / "calibration" / f"calibration-{sequence.split('-', maxsplit=1)[0]}.yaml"
    if not path.is_file():
        raise UserError(f"{path}: no such file")
    try:
        file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        camera, distortion = file.getNode("M1").mat(), file.getNode("D1").mat()
    except (cv2.error, SystemError) as error:
        raise UserError(f"{path}: not a camera calibration") from error
    if camera is None or camera.shape != (3, 3) or distortion is None:
        raise UserError(f"{path}: holds no M1 and D1")
    return np.asarray(camera, np.float64), np.asarray(distortion, np.float64).ravel()
