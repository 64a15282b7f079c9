"""The worst drives once more, recorded and with the pictures before the worst moment."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np

from paani import keys
from paani import messages as m
from paani.arrays import U8
from paani_sim.trials.cases import Case
from paani_sim.trials.drive_recorder import Recorder
from paani_sim.trials.lockstep_bus import START_US
from paani_sim.trials.one import config_for, run_case
from paani_sim.trials.policies import CAMERA
from paani_sim.trials.result import TrialResult
from paani_sim.trials.track_chart import worst_moment_s

PICTURES, APART_S = 6, 1.0
BOX_BGR, TEXT_BGR = (0, 140, 255), (255, 255, 255)


class Again(msgspec.Struct, frozen=True, kw_only=True):
    """One drive, driven again. `same`: to the byte. `strip`: a PNG, empty where no camera looks."""

    case: Case
    same: bool
    log: str
    strip: bytes = b""


def worst_of(results: Mapping[Case, TrialResult], count: int) -> list[Case]:
    """Those of the camera policies first that touched what could be seen, then touched, then did not arrive."""

    def badness(case: Case) -> tuple[float, ...]:
        r = results[case]
        return (r.collisions_visible, r.collisions, not r.completed, r.near_misses, -r.min_clearance_m)

    own = [case for case in sorted(results) if case.policy.value == "paani"]
    return sorted(own or sorted(results), key=badness, reverse=True)[:count]


def drive_again(
    cases: Sequence[Case], results: Mapping[Case, TrialResult], sets: Sequence[str], folder: Path, jobs: int
) -> list[Again]:
    """Writes one recording each into the folder. Raises UserError where that fails."""
    folder.mkdir(parents=True, exist_ok=True)
    with concurrent.futures.ProcessPoolExecutor(
        min(jobs, max(1, len(cases))), mp_context=multiprocessing.get_context("spawn")
    ) as executor:
        futures = [executor.submit(_again, case, results[case], tuple(sets), folder) for case in cases]
        return [future.result() for future in futures]


class _Watch:
    """Keeps what the pictures show, and hands everything on to the recorder."""

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self.pictures: list[tuple[int, bytes]] = []
        self.evidence: dict[int, m.Evidence] = {}
        self.advice: dict[int, m.Advisory] = {}

    def tap(self, topic: keys.Topic[Any], message: m.Message, now_us: int, data: bytes = b"") -> None:
        self._recorder.tap(topic, message, now_us, data)
        if topic is keys.PICTURE:
            self.pictures.append((message.source_us, data))
        elif isinstance(message, m.Evidence):
            self.evidence[message.source_us] = message
        elif isinstance(message, m.Advisory):
            self.advice.setdefault(message.source_us, message)


def _again(case: Case, before: TrialResult, sets: tuple[str, ...], folder: Path) -> Again:
    cv2.setNumThreads(1)
    log = folder / f"{case.stem}.mcap"
    with Recorder(log, config_for(case, sets)) as recorder:
        watch = _Watch(recorder)
        result, _ = run_case(case, sets, tap=watch.tap)
    strip = strip_of(watch, worst_moment_s(result)) if case.policy in CAMERA else b""
    if strip:
        (folder / f"{case.stem}.png").write_bytes(strip)
    same = msgspec.json.encode(result) == msgspec.json.encode(before)
    return Again(case=case, same=same, log=log.name, strip=strip)


def strip_of(watch: _Watch, at_s: float) -> bytes:
    """The pictures before a moment, one second apart, with boxes and advice, as one PNG."""
    shown = []
    for k in range(PICTURES - 1, -1, -1):
        wanted_us = START_US + round((at_s - k * APART_S) * 1e6)
        before = [picture for picture in watch.pictures if picture[0] <= wanted_us]
        if before:
            stamp_us, data = before[-1]
            bgr = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), np.uint8)
            shown.append(_annotated(bgr, watch.evidence.get(stamp_us), watch.advice.get(stamp_us), -k * APART_S))
    if not shown:
        return b""
    return cv2.imencode(".png", np.hstack(shown))[1].tobytes()


def _annotated(bgr: U8, evidence: m.Evidence | None, advice: m.Advisory | None, at_s: float) -> U8:
    height, width = bgr.shape[:2]
    drawn = bgr.copy()
    for found in evidence.detections if evidence is not None else ():
        x1, y1, x2, y2 = found.box_xyxy
        corners = (round(x1 * width), round(y1 * height)), (round(x2 * width), round(y2 * height))
        cv2.rectangle(drawn, *corners, BOX_BGR, 1, cv2.LINE_AA)
    edge = evidence.water_edge if evidence is not None else ()
    for k, down in enumerate(edge):
        cv2.circle(drawn, (round((k + 0.5) / len(edge) * width), round(down * height)), 1, (255, 255, 0), -1)
    said = [f"{at_s:+.0f} s"]
    if evidence is not None and not evidence.usable:
        said.append(evidence.cause.value)
    if advice is not None:
        said += [advice.direction.value, advice.reason.value]
    for row, text in enumerate(said):
        for colour, thickness in ((0, 0, 0), 3), (TEXT_BGR, 1):
            cv2.putText(drawn, text, (6, 16 + 15 * row), cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, thickness, cv2.LINE_AA)
    return np.asarray(drawn, np.uint8)
