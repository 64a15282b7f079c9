"""Every step of perception, the whole of it, the two bare networks and the paper's shape, timed in turn."""

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from time import sleep

import msgspec
import numpy as np

from paani.arrays import U8
from paani.config import PerceptionConfig
from paani.messages import PictureHeader, UnusableCause
from paani.statistics.order_statistics import median, nearest_rank
from paani_services.perception.box_decoding import decode_boxes
from paani_services.perception.corridors import classify_cells, summarise_corridors
from paani_services.perception.engine import OnnxEngine, load_network, network_path
from paani_services.perception.fitness import load_fitness
from paani_services.perception.image_quality import ImageQualityState, check_image_quality
from paani_services.perception.pipeline import Perceiver
from paani_services.perception.preprocessing import letterbox_picture, lookup_tables_for, stretch_picture
from paani_tools.bench.eyes import paper_shaped

Step = Callable[[U8], object]
WARM_ROUNDS = 5
SPIN_S = 0.08  # idle threads of default sessions stay busy for 40 ms, measured, and would slow whatever comes next
PIPELINE, BARE, PAPER_SHAPED, PAPER_PAIR = "pipeline", "two bare runs", "paper-shaped", "paper-shaped, paper's pair"


class Row(msgspec.Struct, frozen=True):
    """One thing that was timed: least, median and 95th percentile (nearest rank) of `n` runs, [ms]."""

    name: str
    least_ms: float
    median_ms: float
    p95_ms: float
    n: int


class Ratio(msgspec.Struct, frozen=True):
    """One step over another, by their medians and by the least of each, which a busy machine spoils least.

    `bar`: what it should not exceed; None where it is for reading.
    """

    name: str
    medians: float
    least: float
    bar: float | None = None


class Candidate(msgspec.Struct, frozen=True):
    """Other model files to put beside the shipped ones, "" for the shipped one."""

    name: str
    detector: str = ""
    segmenter: str = ""


def usable_pictures(pictures: Sequence[U8], config: PerceptionConfig) -> list[U8]:
    """Those that the image-quality check lets through: the others would cost a pipeline nothing."""
    fitness = load_fitness(config, 1)
    return [
        p
        for p in pictures
        if check_image_quality(ImageQualityState(), p, 0, config.image_quality, fitness)[1] is UnusableCause.NONE
    ]


def measure_steps(
    steps: dict[str, Step], pictures: Sequence[U8], rounds: int, stopwatch_ms: Callable[[], float]
) -> Iterator[tuple[int, dict[str, list[float]]]]:
    """Run all steps in turn on each picture; yields the round and all times so far, [ms]. A few rounds warm up."""
    taken: dict[str, list[float]] = {name: [] for name in steps}
    for turn in range(-WARM_ROUNDS, rounds):
        picture = pictures[turn % len(pictures)]
        for name, step in steps.items():
            start_ms = stopwatch_ms()
            step(picture)
            if turn >= 0:
                taken[name].append(stopwatch_ms() - start_ms)
            if name in (PAPER_SHAPED, PAPER_PAIR):
                sleep(SPIN_S)
        yield turn + 1, taken


def rows(taken: dict[str, list[float]]) -> tuple[Row, ...]:
    """In the order of the steps."""
    return tuple(
        Row(name, round(min(times), 3), round(median(times), 3), round(nearest_rank(times, 95), 3), len(times))
        for name, times in taken.items()
        if times
    )


def ratios(found: Sequence[Row], candidates: Sequence[Candidate]) -> tuple[Ratio, ...]:
    """The pipeline beside what it is compared with, as far as that was measured."""
    at = {row.name: row for row in found}
    ours = f"{PIPELINE}, concurrent"
    wanted: list[tuple[str, str, str, float | None]] = [
        ("pipeline over two bare runs of 2 threads", ours, f"{BARE}, 2 threads", 0.90),
        ("pipeline over two bare runs of 1 thread", ours, f"{BARE}, 1 thread", None),
        ("concurrent over sequential pipeline", ours, f"{PIPELINE}, sequential, 2 threads", None),
        ("pipeline over paper-shaped, same nets", ours, PAPER_SHAPED, None),
        ("pipeline over paper-shaped, paper's pair there", ours, PAPER_PAIR, 0.35),
        ("pipeline over paper-shaped, paper's pair in both", f"{PIPELINE}, paper's pair", PAPER_PAIR, 0.50),
        *((f"{c.name}: pipeline over the shipped one", f"{PIPELINE}, {c.name}", ours, None) for c in candidates),
    ]
    return tuple(
        Ratio(
            name,
            round(at[above].median_ms / at[below].median_ms, 3),
            round(at[above].least_ms / at[below].least_ms, 3),
            bar,
        )
        for name, above, below, bar in wanted
        if above in at and below in at
    )


def steps(
    config: PerceptionConfig,
    candidates: Sequence[Candidate],
    stopwatch_ms: Callable[[], float],
) -> dict[str, Step]:
    """What is timed, by name. Raises UserError for a model that cannot be used."""
    found = _stages(config)
    bare = {threads: _bare(config, threads) for threads in (1, 2)}
    found |= {f"{BARE}, {threads} thread{'s' * (threads > 1)}": both for threads, both in bare.items()}
    found[f"{PIPELINE}, concurrent"] = _pipeline(config, stopwatch_ms, concurrent=True, threads=1)
    for threads in (1, 2):
        found[f"{PIPELINE}, sequential, {threads} thread{'s' * (threads > 1)}"] = _pipeline(
            config, stopwatch_ms, concurrent=False, threads=threads
        )
    for candidate in candidates:
        other = msgspec.structs.replace(config, detector=candidate.detector, segmenter=candidate.segmenter)
        found[f"{PIPELINE}, {candidate.name}"] = _pipeline(other, stopwatch_ms, concurrent=True, threads=1)
    found[PAPER_SHAPED] = _paper_shaped(config)
    pair = msgspec.structs.replace(config, weights="paper", detector="", segmenter="")
    found[PAPER_PAIR] = _paper_shaped(pair)
    found[f"{PIPELINE}, paper's pair"] = _pipeline(pair, stopwatch_ms, concurrent=True, threads=1)
    return found


def _stages(config: PerceptionConfig) -> dict[str, Step]:
    """The pipeline's own steps, one thread each, on the picture at hand; later ones on what a first picture gave."""
    detector = load_network("detector", config, 1)
    segmenter = load_network("segmenter", config, 1)
    table_d, table_s = lookup_tables_for(detector.contract), lookup_tables_for(segmenter.contract)
    (height, width), (rows_s, columns_s) = detector.contract.size_hw, segmenter.contract.size_hw
    grey = detector.contract.preprocessing.pad_grey
    fitness = load_fitness(config, 1)
    blank = np.zeros((240, 320, 3), np.uint8)
    tensor, place = letterbox_picture(blank, height, width, grey, table_d)
    stretched = stretch_picture(blank, rows_s, columns_s, table_s)
    candidates, logits = detector.run(tensor), segmenter.run(stretched)
    mask, confidence = classify_cells(logits, config.temperature)
    return {
        "gate": lambda bgr: check_image_quality(ImageQualityState(), bgr, 0, config.image_quality, fitness),
        "letterbox": lambda bgr: letterbox_picture(bgr, height, width, grey, table_d),
        "stretch": lambda bgr: stretch_picture(bgr, rows_s, columns_s, table_s),
        "detector, 1 thread": lambda _: detector.run(tensor),
        "segmenter, 1 thread": lambda _: segmenter.run(stretched),
        "boxes": lambda _: decode_boxes(candidates, place, config.detections, detector.contract.classes),
        "classes of cells": lambda _: classify_cells(logits, config.temperature),
        "corridors": lambda _: summarise_corridors(mask, confidence, config.corridors),
    }


def _bare(config: PerceptionConfig, threads: int) -> Step:
    detector = load_network("detector", config, threads)
    segmenter = load_network("segmenter", config, threads)
    inputs = [np.zeros(e.contract.input.shape, e.contract.input.dtype) for e in (detector, segmenter)]

    def both(_: U8) -> None:
        detector.run(inputs[0])
        segmenter.run(inputs[1])

    return both


def _pipeline(config: PerceptionConfig, stopwatch_ms: Callable[[], float], *, concurrent: bool, threads: int) -> Step:
    chosen = msgspec.structs.replace(config, concurrent=concurrent, intra_op_threads=threads)
    perceiver = Perceiver(chosen, stopwatch_ms)
    epochs = count()  # each picture is a camera of its own, so that none is called frozen

    def perceive(bgr: U8) -> None:
        header = PictureHeader(source_us=0, frame_seq=0, frame_epoch=next(epochs), width_px=320, height_px=240)
        evidence, _ = perceiver.perceive(bgr, header, 0.0)
        assert evidence.usable

    return perceive


def _paper_shaped(config: PerceptionConfig) -> Step:
    detector = OnnxEngine.load("detector", network_path("detector", config), 2, spinning=True)
    segmenter = OnnxEngine.load("segmenter", network_path("segmenter", config), 2, spinning=True, full_size=True)
    size_hw = detector.contract.size_hw
    return lambda bgr: paper_shaped.perceive(
        bgr, detector.run, segmenter.run, config.detections, config.corridors, size_hw
    )
