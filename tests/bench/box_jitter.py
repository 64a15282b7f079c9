"""How the shipped detector's boxes jitter while the boat nears a rendered thing: `python -m tests.bench.box_jitter N`.

The constants of `paani_sim.studies.encounters` come from the first table. The second lets the advisor judge those
very boxes, so that the simulated detector stands beside the real one. Needs OpenGL; about ten seconds an encounter on
one core.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections import defaultdict
from typing import NamedTuple

import cv2
import numpy as np
from tqdm import tqdm

from paani import keys
from paani import messages as m
from paani.boxes import iou
from paani.clock import stopwatch_ms
from paani.config import Config, load_config
from paani.decider import Input, decider_of
from paani.statistics.figure_table import FigureTable, table_text
from paani_services.perception.pipeline import Perceiver
from paani_sim.eye.camera import BoatPose, Camera
from paani_sim.eye.renderer import Eye
from paani_sim.eye.scatter import random_pose
from paani_sim.studies.motion_table import LATENCY_S, MIN_CLOSING_PER_S, MIN_SIZE_PX, RULE_PERIODS, RULE_S
from paani_sim.worlds import load_world
from paani_sim.worlds.curves import clearance_m
from paani_sim.worlds.world import Kind, Obstacle, Pose2

RATE_HZ, SPEED_MPS, LAST_M = 5.0, 0.6, 2.0
SPARE_FRAC = 0.02
SIZES_PX = (8.0, 12.0, 18.0, 27.0, 40.0, 60.0, 90.0, 140.0)
MISTAKEN = 0.2  # of log size: a reflection or a neighbour taken in
THINGS = (  # kind, look, length, width, height [m], seen from [m]
    (Kind.BUOY, "sphere", 0.8, 0.8, 0.7, 12.0),
    (Kind.VESSEL, "rowboat", 3.9, 1.4, 0.6, 20.0),
    (Kind.BUOY, "can", 0.8, 0.8, 1.3, 12.0),
    (Kind.VESSEL, "cruiser", 7.0, 2.4, 2.2, 20.0),
    (Kind.PERSON, "swimming", 1.1, 0.6, 0.4, 12.0),
    (Kind.BUOY, "pillar", 0.8, 0.8, 2.1, 12.0),
    (Kind.VESSEL, "dinghy", 3.6, 1.6, 0.9, 20.0),
    (Kind.VESSEL, "kayak", 4.3, 0.7, 1.1, 20.0),
)


class Sample(NamedTuple):
    """One frame: time, true range and bearing, the true box in whole pixels, and the detection of it."""

    at_s: float
    range_m: float
    yaw_rad: float
    truth: m.BoxXyxy
    found: m.Detection | None

    @property
    def size_px(self) -> float:
        x1, y1, x2, y2 = self.truth
        return math.sqrt((x2 - x1) * 320 * (y2 - y1) * 240)

    @property
    def whole(self) -> bool:
        return min(self.truth[:2]) > SPARE_FRAC and max(self.truth[2:]) < 1.0 - SPARE_FRAC


def sample_approaches(count: int) -> list[list[Sample]]:
    """Frames of `count` approaches in open water, as perception sees them."""
    rng = np.random.default_rng(5)
    world, perceiver = load_world("lake"), Perceiver(load_config().perception, stopwatch_ms)
    with Eye(world, Camera()) as eye:
        found = [_approach(eye, perceiver, number, rng) for number in tqdm(range(count), unit="approach")]
    perceiver.close()
    return found


def _approach(eye: Eye, perceiver: Perceiver, number: int, rng: np.random.Generator) -> list[Sample]:
    kind, observation, long, wide, tall, from_m = THINGS[number % len(THINGS)]
    while True:
        start = random_pose(eye.world, rng)
        way = np.array([math.cos(start.yaw_rad), math.sin(start.yaw_rad)])
        ahead = np.array([start.x_m, start.y_m]) + np.linspace(0.0, 24.0, 9)[:, None] * way
        if clearance_m(eye.world.shore_m, ahead).min() > 3.0:
            break
    side_m, turned = rng.uniform(-1.5, 1.5), Pose2(0.0, 0.0, float(rng.uniform(-math.pi, math.pi)))
    x_m = start.x_m + from_m * way[0] - side_m * way[1]
    y_m = start.y_m + from_m * way[1] + side_m * way[0]
    target = Obstacle(
        "thing", kind, observation, turned._replace(x_m=x_m, y_m=y_m), long, wide, tall, variant=number % 12
    )
    eye.place_obstacles([target])
    samples = []
    for k in range(int((from_m - LAST_M) / SPEED_MPS * RATE_HZ)):
        at_s = k / RATE_HZ
        pose = BoatPose(
            start.x_m + SPEED_MPS * at_s * way[0],
            start.y_m + SPEED_MPS * at_s * way[1],
            start.yaw_rad + 0.03 * math.sin(0.8 * at_s),
            roll_rad=0.01 * math.sin(2.1 * at_s),
            pitch_rad=0.008 * math.sin(1.7 * at_s),
        )
        picture = eye.render_labelled(pose, 100.0 * number + at_s)
        boxes = [b for b in picture.boxes if b.id == "thing"]
        if not boxes:
            continue
        truth = (boxes[0].x0_px / 320, boxes[0].y0_px / 240, boxes[0].x1_px / 320, boxes[0].y1_px / 240)
        header = m.PictureHeader(source_us=k, frame_seq=k, frame_epoch=number, width_px=320, height_px=240)
        data = cv2.imencode(".jpg", picture.bgr, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()
        evidence, _ = perceiver.perceive(data, header, 0.1)
        best = max(evidence.detections, key=lambda d: iou(d.box_xyxy, truth), default=None)
        found = best if best is not None and iou(best.box_xyxy, truth) > 0.25 else None
        range_m = math.hypot(x_m - pose.x_m, y_m - pose.y_m)
        samples.append(Sample(at_s, range_m, pose.yaw_rad, truth, found))
    return samples


def jitter(found: list[list[Sample]]) -> FigureTable:
    """By size: how often the detector misses, and how far a box edge moves against the truth between two frames."""
    rows = []
    for low, high in itertools.pairwise(SIZES_PX):
        seen = [s for samples in found for s in samples if low <= s.size_px < high and s.whole]
        steps = [
            (b.found.box_xyxy, a.found.box_xyxy, b.truth, a.truth)
            for samples in found
            for a, b in itertools.pairwise(samples)
            if low <= a.size_px < high and a.whole and b.whole and a.found and b.found and b.at_s - a.at_s < 0.3
        ]
        if len(steps) < 8:
            continue
        now, before, truth, truth_before = np.array(steps).transpose(1, 0, 2) * np.array([320, 240, 320, 240])
        moved = (now - before) - (truth - truth_before)
        edge_px = 1.4826 * float(np.median(np.abs(moved))) / math.sqrt(2.0)
        areas = [np.log((b[:, 2] - b[:, 0]) * (b[:, 3] - b[:, 1])) / 2.0 for b in (now, before, truth, truth_before)]
        grown = np.abs((areas[0] - areas[1]) - (areas[2] - areas[3]))
        sure = [s.found.confidence for s in seen if s.found]
        rows.append((
            f"{low:g}-{high:g}", len(seen), round(100.0 * sum(s.found is None for s in seen) / len(seen), 1),
            round(edge_px, 2), round(100.0 * float(np.mean(grown > MISTAKEN)), 1), round(float(np.median(sure)), 2),
        ))  # fmt: skip
    columns = ("size px", "frames", "missed %", "edge px", "mistaken %", "confidence")
    return FigureTable(
        name="box jitter", columns=columns, rows=tuple(rows), note="edge: standard deviation of one box edge."
    )


def motion_row(found: list[list[Sample]], profile: str, every: int) -> tuple[str, str, int, float, int]:
    """The advisor on those boxes, taking one frame in `every`: profile, rate, closing moments, known %, wrong."""
    config, rate_hz = load_config(profile=profile), RATE_HZ / every
    need_s, count = max(RULE_S, RULE_PERIODS / rate_hz), defaultdict[str, int](int)
    for every_sample in found:
        samples = every_sample[::every]
        for number, motion in enumerate(_motions(samples, config)):
            sample = samples[number]
            since = [s for s in samples[: number + 1] if sample.at_s - s.at_s < need_s + 1e-6]
            span_s = sample.at_s - since[0].at_s
            count["wrong"] += motion is m.MotionState.RECEDING
            if (
                sample.at_s - samples[0].at_s > need_s - 1e-6
                and math.log(since[0].range_m / sample.range_m) / span_s >= MIN_CLOSING_PER_S
                and all(s.whole and s.size_px >= MIN_SIZE_PX for s in since)
            ):
                count["closing"] += 1
                count["known"] += motion is not m.MotionState.UNKNOWN
    known = 100.0 * count["known"] / max(1, count["closing"])
    return profile, f"{rate_hz:g}", count["closing"], round(known, 1), count["wrong"]


def _motions(samples: list[Sample], config: Config) -> list[m.MotionState]:
    advisor = decider_of("advisor")
    state, inputs = advisor.state(), {topic.name: Input() for topic in advisor.inputs}
    states = []
    for number, sample in enumerate(samples):
        at_us = 1_000_000_000 + round(sample.at_s * 1e6)
        inputs[keys.EVIDENCE.name] = Input(
            m.Evidence(
                source_us=at_us, frame_seq=number, frame_epoch=1, width_px=320, height_px=240, usable=True,
                detections=() if sample.found is None else (sample.found,),
            ),
            at_us,
        )  # fmt: skip
        inputs[keys.ODOMETRY.name] = Input(
            m.Odometry(source_us=at_us, x_m=0.0, y_m=0.0, yaw_rad=sample.yaw_rad, surge_mps=SPEED_MPS, healthy=True),
            at_us,
        )
        state, outputs = advisor.decide(state, inputs, at_us + round(LATENCY_S * 1e6), config)
        tracks = outputs[keys.TRACKS.name]
        assert isinstance(tracks, m.Tracks)
        seen = [t for t in tracks.tracks if not t.held] if sample.found is not None else tracks.tracks
        track = max(seen, key=lambda t: (t.hits, -t.id), default=None)
        states.append(track.motion if track else m.MotionState.UNKNOWN)
    return states


def main(count: int) -> int:
    """Print both tables."""
    found = sample_approaches(count)
    sys.stdout.write(table_text(jitter(found)))
    rows = tuple(motion_row(found, profile, every) for profile in ("paani", "paper") for every in (1, 2, 5, 10))
    columns = ("constants", "Hz", "closing", "known %", "wrong")
    sys.stdout.write("\n" + table_text(FigureTable(name="rendered approaches", columns=columns, rows=rows)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(int(sys.argv[1])))
