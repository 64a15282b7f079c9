"""Repeats the worst drives, recorded and with the pictures before their worst moment."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
from tqdm import tqdm

from paani import keys
from paani import messages as m
from paani.arrays import U8
from paani.whole_file import write_whole
from paani_sim.trials.drive_recorder import DriveRecorder
from paani_sim.trials.lockstep_bus import START_US
from paani_sim.trials.policies import CAMERA_POLICIES
from paani_sim.trials.result import TrialResult
from paani_sim.trials.run_trial import load_case_config, run_trial
from paani_sim.trials.track_chart import find_worst_moment_s
from paani_sim.trials.trial_cases import TrialCase
from paani_sim.trials.worker_processes import open_processes

PICTURE_COUNT, PICTURE_SPACING_S = 6, 1.0
BOX_BGR, TEXT_BGR = (0, 140, 255), (255, 255, 255)


class RepeatedDrive(msgspec.Struct, frozen=True, kw_only=True):
    """A repeated drive. `is_equal`: to the byte. `strip`: a PNG, empty for a policy without camera."""

    case: TrialCase
    is_equal: bool
    log: str
    strip: bytes = b""


def select_worst_drives(results: Mapping[TrialCase, TrialResult], count: int) -> list[TrialCase]:
    """Select the worst drives: by contacts with visible things, contacts, completion, near misses, clearance."""

    def badness(case: TrialCase) -> tuple[float, ...]:
        r = results[case]
        return (r.collisions_visible, r.collisions, not r.completed, r.near_misses, -r.min_clearance_m)

    own = [case for case in sorted(results) if case.policy.value == "paani"]
    return sorted(own or sorted(results), key=badness, reverse=True)[:count]


def repeat_drives(
    cases: Sequence[TrialCase], results: Mapping[TrialCase, TrialResult], sets: Sequence[str], folder: Path, jobs: int
) -> list[RepeatedDrive]:
    """Repeat drives and write one recording each into the folder. Raises UserError where that fails."""
    folder.mkdir(parents=True, exist_ok=True)
    with open_processes(min(jobs, max(1, len(cases)))) as executor:
        futures = [executor.submit(_repeat_drive, case, results[case], tuple(sets), folder) for case in cases]
        return [future.result() for future in tqdm(futures, unit="drive", desc="the worst again")]


class _PictureCollector:
    """Keeps pictures, evidence and advisories, and passes every message on to the recorder."""

    def __init__(self, recorder: DriveRecorder) -> None:
        self._recorder = recorder
        self.pictures: list[tuple[int, bytes]] = []
        self.evidence: dict[int, m.Evidence] = {}
        self.advice: dict[int, m.Advisory] = {}

    def record_message(self, topic: keys.Topic[Any], message: m.Message, now_us: int, data: bytes = b"") -> None:
        self._recorder.record_message(topic, message, now_us, data)
        if topic is keys.PICTURE:
            self.pictures.append((message.source_us, data))
        elif isinstance(message, m.Evidence):
            self.evidence[message.source_us] = message
        elif isinstance(message, m.Advisory):
            self.advice.setdefault(message.source_us, message)


def _repeat_drive(case: TrialCase, before: TrialResult, sets: tuple[str, ...], folder: Path) -> RepeatedDrive:
    cv2.setNumThreads(1)
    log = folder / f"{case.stem}.mcap"
    with DriveRecorder(log, load_case_config(case, sets)) as recorder:
        collector = _PictureCollector(recorder)
        result, _ = run_trial(case, sets, tap=collector.record_message)
    strip = render_picture_strip(collector, find_worst_moment_s(result)) if case.policy in CAMERA_POLICIES else b""
    if strip:
        write_whole(folder / f"{case.stem}.png", strip, "--report")
    is_equal = msgspec.json.encode(result) == msgspec.json.encode(before)
    return RepeatedDrive(case=case, is_equal=is_equal, log=log.name, strip=strip)


def render_picture_strip(collector: _PictureCollector, at_s: float) -> bytes:
    """Render the pictures before a moment, one second apart, with boxes and advisory, as one PNG."""
    pictures = []
    for k in range(PICTURE_COUNT - 1, -1, -1):
        wanted_us = START_US + round((at_s - k * PICTURE_SPACING_S) * 1e6)
        before = [picture for picture in collector.pictures if picture[0] <= wanted_us]
        if before:
            stamp_us, data = before[-1]
            bgr = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), np.uint8)
            pictures.append(
                _annotate_picture(
                    bgr, collector.evidence.get(stamp_us), collector.advice.get(stamp_us), -k * PICTURE_SPACING_S
                )
            )
    if not pictures:
        return b""
    return cv2.imencode(".png", np.hstack(pictures))[1].tobytes()


def _annotate_picture(bgr: U8, evidence: m.Evidence | None, advice: m.Advisory | None, at_s: float) -> U8:
    height, width = bgr.shape[:2]
    annotated = bgr.copy()
    for found in evidence.detections if evidence is not None else ():
        x1, y1, x2, y2 = found.box_xyxy
        corners = (round(x1 * width), round(y1 * height)), (round(x2 * width), round(y2 * height))
        cv2.rectangle(annotated, *corners, BOX_BGR, 1, cv2.LINE_AA)
    edge = evidence.water_edge if evidence is not None else ()
    for k, down in enumerate(edge):
        cv2.circle(annotated, (round((k + 0.5) / len(edge) * width), round(down * height)), 1, (255, 255, 0), -1)
    caption_lines = [f"{at_s:+.0f} s"]
    if evidence is not None and not evidence.usable:
        caption_lines.append(evidence.cause.value)
    if advice is not None:
        caption_lines += [advice.direction.value, advice.reason.value]
    for row, text in enumerate(caption_lines):
        for colour, thickness in ((0, 0, 0), 3), (TEXT_BGR, 1):
            cv2.putText(
                annotated, text, (6, 16 + 15 * row), cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, thickness, cv2.LINE_AA
            )
    return np.asarray(annotated, np.uint8)
