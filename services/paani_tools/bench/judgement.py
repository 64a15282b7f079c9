"""What a decision costs: one step of the advisor, with and without its counterfactual, and its messages as JSON."""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterator
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.clock import stopwatch_ms
from paani.config import Config, with_settings
from paani.decider import Decider, Input, decider_of
from paani.statistics.figure_table import FigureTable
from paani.statistics.order_statistics import median, nearest_rank

BOXES = 24  # C9
START_US, PERIOD_US, AGE_US = 1_000_000_000, 200_000, 100_000
STEADY_FRAMES = 5  # how long the water stays as it is: lanes become occupied, turns are kept
DRIFT = 0.004  # how far a box moves between frames
REPLACED = 2  # boxes that go, and others that come, with each change of the water
WARM_FRAMES = 50
REPEATS = 5
FRAME, EXPLAINED, REPUBLISHED = "frame", "frame, counterfactual", "republish"


class Figures(msgspec.Struct):
    """Of one way to run a step: time of each frame [ms], and how many sets of evidence its counterfactual judged."""

    ms: list[float] = []
    judged: list[int] = []


def step(config: Config, frames: int) -> FigureTable:
    """The advisor's whole step on the same crowded pictures, three ways, one after another in each frame."""
    decider = decider_of("advisor")
    settings = {
        FRAME: with_settings(config, ("advisor.counterfactual_size=0",)),
        EXPLAINED: config,
        REPUBLISHED: config,
    }
    found = {name: Figures() for name in settings}
    states = {name: decider.state() for name in settings}
    for number, evidence in enumerate(crowded_evidence(WARM_FRAMES + frames)):
        for name in (FRAME, EXPLAINED, REPUBLISHED):
            if name == REPUBLISHED:
                states[name] = states[EXPLAINED]
            states[name], outputs_before, best_ms = _timed(decider, states[name], evidence, settings[name])
            if number >= WARM_FRAMES:
                found[name].ms.append(best_ms)
                found[name].judged.append(0 if name == REPUBLISHED else outputs_before.counterfactual.judged)
    base_ms = median(found[FRAME].ms)
    return FigureTable(
        name=f"advisor step, {BOXES} boxes, {frames} frames",
        columns=("step", "p50 ms", "p95 ms", "p99 ms", "ratio of p50", "sets p50", "sets max"),
        rows=tuple(
            (
                name,
                *(nearest_rank(figures.ms, percent) for percent in (50, 95, 99)),
                median(figures.ms) / base_ms,
                nearest_rank(figures.judged, 50),
                max(figures.judged),
            )
            for name, figures in found.items()
        ),
        note=f"a step is pure: it is taken {REPEATS} times and the quickest counts. sets: of evidence, judged.",
    )


def contract(config: Config, rounds: int) -> FigureTable:
    """Typed JSON beside the paper's shape, JSON text inside a JSON string, for the same messages."""
    rows = []
    for message in _messages(config):
        kind = type(message)
        shapes = {"typed": _typed(kind), "string": _in_string(kind), "string, json library": _in_string_stdlib()}
        data = {name: encode(message) for name, (encode, _) in shapes.items()}
        taken: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name in shapes}
        for _ in range(rounds):
            for name, (encode, decode) in shapes.items():
                begin = stopwatch_ms()
                encode(message)
                middle = stopwatch_ms()
                decode(data[name])
                taken[name][0].append((middle - begin) * 1e3)
                taken[name][1].append((stopwatch_ms() - middle) * 1e3)
        both = {name: median(encoding) + median(decoding) for name, (encoding, decoding) in taken.items()}
        rows += [
            (
                kind.__name__,
                name,
                len(data[name]),
                median(taken[name][0]),
                median(taken[name][1]),
                len(data[name]) / len(data["typed"]),
                both[name] / both["typed"],
            )
            for name in shapes
        ]
    return FigureTable(
        name=f"message as JSON, {BOXES} boxes, medians of {rounds}",
        columns=("message", "shape", "bytes", "encode us", "decode us", "bytes ratio", "time ratio"),
        rows=tuple(rows),
        note="string: the message's JSON as the text of another JSON object, as in the paper; "
        "the json library leaves it unchecked.",
    )


def crowded_evidence(frames: int, seed: int = 1) -> Iterator[m.Evidence]:
    """Evidence with 24 boxes that drift, a few of which come and go, in water of every kind."""
    rng = random.Random(seed)
    boxes = [_box(rng) for _ in range(BOXES)]
    lanes: tuple[m.LaneEvidence, ...] = ()
    for number in range(frames):
        if number % STEADY_FRAMES == 0:
            boxes = [*boxes[REPLACED:], *(_box(rng) for _ in range(REPLACED))]
            lanes = tuple(m.LaneEvidence(non_water=rng.random() ** 2, uncertainty=0.2 * rng.random()) for _ in range(3))
        boxes = [_drifted_evidence(box, rng) for box in boxes]
        yield m.Evidence(
            source_us=START_US + number * PERIOD_US,
            frame_seq=number,
            frame_epoch=1,
            width_px=320,
            height_px=240,
            usable=True,
            detections=tuple(boxes),
            left=lanes[0],
            center=lanes[1],
            right=lanes[2],
            segmentation=m.SegmentationSource.LEARNED,
            navigation_eligible=True,
        )


def _drifted_evidence(box: m.Detection, rng: random.Random) -> m.Detection:
    x1, y1, x2, y2 = box.box_xyxy
    dx, dy = rng.uniform(-DRIFT, DRIFT), rng.uniform(-DRIFT, DRIFT)
    dx, dy = min(max(dx, -x1), 1.0 - x2), min(max(dy, -y1), 1.0 - y2)
    moved = (max(0.0, x1 + dx), max(0.0, y1 + dy), min(1.0, x2 + dx), min(1.0, y2 + dy))
    return msgspec.structs.replace(box, box_xyxy=moved)


def _box(rng: random.Random) -> m.Detection:
    """As in a harbour: most are far and small."""
    size, bottom = 0.02 + 0.2 * rng.random() ** 4, 0.32 + 0.4 * rng.random() ** 4
    x1 = rng.uniform(0.0, 1.0 - size)
    return m.Detection(
        label=rng.choice(tuple(m.Label)),
        confidence=rng.uniform(0.4, 1.0),
        box_xyxy=(x1, bottom - size, x1 + size, bottom),
    )


def _timed(decider: Decider[Any], state: Any, evidence: m.Evidence, config: Config) -> tuple[Any, m.Advisory, float]:
    now_us, taken_ms = evidence.source_us + AGE_US, []
    inputs = {topic.name: Input() for topic in decider.inputs} | {keys.EVIDENCE.name: Input(evidence, now_us)}
    after, outputs = decider.decide(state, inputs, now_us, config)
    for _ in range(REPEATS):
        begin_ms = stopwatch_ms()
        decider.decide(state, inputs, now_us, config)
        taken_ms.append(stopwatch_ms() - begin_ms)
    advisory = outputs[keys.ADVISORY.name]
    assert isinstance(advisory, m.Advisory)
    return after, advisory, min(taken_ms)


def _messages(config: Config) -> tuple[m.Message, ...]:
    decider = decider_of("advisor")
    state: Any = decider.state()
    outputs_before: tuple[m.Message, ...] = ()
    for evidence in crowded_evidence(STEADY_FRAMES):
        inputs = {topic.name: Input() for topic in decider.inputs} | {keys.EVIDENCE.name: Input(evidence)}
        state, outputs = decider.decide(state, inputs, evidence.source_us + AGE_US, config)
        outputs_before = (evidence, outputs[keys.TRACKS.name], outputs[keys.ADVISORY.name])
    return outputs_before


class _String(msgspec.Struct):
    data: str


Codec = tuple[Callable[[Any], bytes], Callable[[bytes], Any]]


def _typed(kind: type[m.Message]) -> Codec:
    return msgspec.json.Encoder().encode, msgspec.json.Decoder(kind).decode


def _in_string(kind: type[m.Message]) -> Codec:
    encoder, outer, inner = msgspec.json.Encoder(), msgspec.json.Decoder(_String), msgspec.json.Decoder(kind)
    return (
        lambda message: encoder.encode(_String(encoder.encode(message).decode())),
        lambda data: inner.decode(outer.decode(data).data),
    )


def _in_string_stdlib() -> Codec:
    return (
        lambda message: json.dumps({"data": json.dumps(msgspec.to_builtins(message))}).encode(),
        lambda data: json.loads(json.loads(data)["data"]),
    )
