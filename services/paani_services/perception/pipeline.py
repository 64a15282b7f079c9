"""One picture through the gate and both models to evidence."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any, NamedTuple

import msgspec
import numpy as np

from paani.arrays import F32, U8
from paani.config import PerceptionConfig
from paani.messages import (
    Detection,
    Evidence,
    InferenceTiming,
    LaneEvidence,
    PictureHeader,
    SegmentationSource,
    UnusableCause,
)
from paani_services.perception.box_decoding import decode
from paani_services.perception.corridors import Lanes, classify, summarise, water_edge
from paani_services.perception.engine import Engine, engine_named
from paani_services.perception.fallback import CONFIDENCE, colour_mask
from paani_services.perception.fitness import load_fitness
from paani_services.perception.image_quality import ImageQualityState, check_image_quality
from paani_services.perception.picture_decoding import decoded
from paani_services.perception.preprocess import letterbox, stretch, tables_for
from paani_services.perception.sight import counted, followed_roll_rad, is_own_hull, level

Detected = tuple[tuple[Detection, ...], float]  # what was found, and the time it took [ms]
NO_SEGMENTER = "none"
CLEARLY_SLOWER = 1.2  # nets that take about as long stay in their order, whatever one run of each says
SEGMENTER_CLASSES = ("water", "obstacle", "sky")  # D6


class Segmentation(NamedTuple):
    """Mask uint8 [64, 80] (0 water, 1 obstacle, 2 sky), its water's edge and corridors, who drew it, time taken."""

    mask: U8
    edge: tuple[float, ...]
    lanes: Lanes
    source: SegmentationSource
    took_ms: float


class Perceiver:
    """Both models, and the gate's memory of the pictures before. Not for two threads at once."""

    def __init__(self, config: PerceptionConfig, stopwatch_ms: Callable[[], float]) -> None:
        """Raises UserError for a model that cannot be used."""
        self._config, self._stopwatch_ms = config, stopwatch_ms
        engine = engine_named(config.engine)
        self._detector = engine.load("detector", config.detector, config.intra_op_threads)
        self._segmenter = (
            None
            if config.segmenter == NO_SEGMENTER
            else engine.load("segmenter", config.segmenter, config.intra_op_threads)
        )
        engines = [engine for engine in (self._detector, self._segmenter) if engine]
        self._models = ", ".join(engine.info() for engine in engines)
        self._tables = [tables_for(engine.contract) for engine in engines]
        self._beside = ThreadPoolExecutor(1, "beside the gate") if config.concurrent else None
        self._detector_begins = config.concurrent and self._takes_longer(self._detector, self._segmenter)
        self._quality = ImageQualityState()
        self._fitness = load_fitness(config.image_quality, config.intra_op_threads)
        self._begun: list[Future[Any]] = []
        self._counts: dict[tuple[int, ...], F32] = {}

    def perceive(
        self, data: bytes | U8, header: PictureHeader, age_s: float, roll_rad: float = 0.0
    ) -> tuple[Evidence, U8 | None]:
        """Evidence of one distinct frame, and its class mask uint8 [64, 80], None where the picture is unusable.

        data: an encoded picture, or BGR uint8 [H, W, 3]. age_s: the picture's age now, at the start (resolution 1).
        roll_rad: of the boat when it was taken, starboard down positive; 0 where unknown.
        Never raises for a bad picture: it is evidence with `usable` false and its cause.
        """
        start_ms = self._stopwatch_ms()
        bgr = decoded(data)
        decoded_ms = self._stopwatch_ms()
        roll_rad = followed_roll_rad(roll_rad, self._config.max_roll_rad) if self._config.follow_roll else 0.0
        # The slower net begins beside the gate; its answer to a refused picture is dropped.
        detecting: Future[Detected] | None = None
        segmenting: Future[Segmentation] | None = None
        if self._beside and bgr is not None and age_s <= self._config.max_frame_age_s:
            wait(self._begun)  # so that work never piles up, however fast pictures are refused
            if self._detector_begins:
                detecting = self._beside.submit(self._detect, bgr)
                self._begun = [detecting]
            else:
                segmenting = self._beside.submit(self._segment, bgr, roll_rad)
                self._begun = [segmenting]
        cause = self._judge(bgr, header, age_s)
        gated_ms = self._stopwatch_ms()
        timing = InferenceTiming(
            frame_age_ms=max(0.0, age_s) * 1e3, decode_ms=decoded_ms - start_ms, gate_ms=gated_ms - decoded_ms
        )
        if bgr is None or cause is not UnusableCause.NONE:
            return self._evidence(header, bgr, cause, (), None, timing, start_ms), None
        if detecting:
            segmentation = self._segment(bgr, roll_rad)
            detections, detector_ms = detecting.result()
        else:
            detections, detector_ms = self._detect(bgr)
            segmentation = segmenting.result() if segmenting else self._segment(bgr, roll_rad)  # B4: in turn
        timing = msgspec.structs.replace(
            timing,
            detector_ms=detector_ms,
            segmenter_ms=segmentation.took_ms,
            inference_ms=self._stopwatch_ms() - gated_ms,
        )
        evidence = self._evidence(header, bgr, cause, detections, segmentation, timing, start_ms)
        return msgspec.structs.replace(evidence, roll_rad=roll_rad), segmentation.mask

    def close(self) -> None:
        """Ends the second thread."""
        if self._beside is not None:
            self._beside.shutdown()

    def _takes_longer(self, one: Engine, other: Engine | None) -> bool:
        """Whether one net is clearly slower than the other on this machine. What either says does not depend on it."""
        if other is None:
            return False
        took_ms = []
        for engine in (one, other, one, other):  # the first run of each reserves its memory
            shape, dtype = engine.contract.input.shape, engine.contract.input.dtype
            start_ms = self._stopwatch_ms()
            engine.run(np.zeros(shape, dtype))
            took_ms.append(self._stopwatch_ms() - start_ms)
        return took_ms[2] > CLEARLY_SLOWER * took_ms[3]

    def _judge(self, bgr: U8 | None, header: PictureHeader, age_s: float) -> UnusableCause:
        if bgr is None:
            return UnusableCause.UNDECODABLE
        self._quality, cause = check_image_quality(
            self._quality, bgr, header.frame_epoch, self._config.image_quality, self._fitness
        )
        return UnusableCause.STALE if age_s > self._config.max_frame_age_s else cause

    def _detect(self, bgr: U8) -> Detected:
        start_ms = self._stopwatch_ms()
        contract = self._detector.contract
        height, width = contract.size_hw
        tensor, place = letterbox(bgr, height, width, contract.preprocessing.pad_grey, self._tables[0])
        detections = decode(self._detector.run(tensor), place, self._config.detections, contract.classes)
        if self._config.ego_polygon:
            counts = self._counted((64, 80))
            detections = tuple(d for d in detections if not is_own_hull(d.box_xyxy, counts))
        return detections, self._stopwatch_ms() - start_ms

    def _counted(self, shape: tuple[int, ...]) -> F32:
        """How much of each cell of a grid lies outside the own hull."""
        if shape not in self._counts:
            self._counts[shape] = counted(self._config.ego_polygon, *shape)
        return self._counts[shape]

    def _segment(self, bgr: U8, roll_rad: float) -> Segmentation:
        """The learned mask; the colour mask where there is no segmenter or its scores are not finite."""
        start_ms = self._stopwatch_ms()
        source, (mask, confidence) = SegmentationSource.LEARNED, self._learned_mask(bgr)
        if not np.isfinite(confidence).all():
            source, mask = SegmentationSource.FALLBACK, colour_mask(bgr)
            confidence = np.full(mask.shape, CONFIDENCE, np.float32)
        aspect = bgr.shape[1] / bgr.shape[0]
        counts = self._counted(mask.shape)
        flat = level(mask, confidence, counts, roll_rad, aspect)
        lanes = summarise(flat.mask, flat.confidence, self._config.corridors, flat.counts)
        return Segmentation(mask, water_edge(mask, counts), lanes, source, self._stopwatch_ms() - start_ms)

    def _learned_mask(self, bgr: U8) -> tuple[U8, F32]:
        """Mask and confidence; a confidence that is not finite where there is no segmenter."""
        if self._segmenter is None:
            return np.empty((0, 0), np.uint8), np.full(1, np.nan, np.float32)
        height, width = self._segmenter.contract.size_hw
        logits = self._segmenter.run(stretch(bgr, height, width, self._tables[1]))
        rows = self._segmenter.contract.rows_of(SEGMENTER_CLASSES)
        return classify(logits if rows is None else logits[:, rows], self._config.temperature)

    def _evidence(
        self,
        header: PictureHeader,
        bgr: U8 | None,
        cause: UnusableCause,
        detections: tuple[Detection, ...],
        segmentation: Segmentation | None,
        timing: InferenceTiming,
        start_ms: float,
    ) -> Evidence:
        height, width = bgr.shape[:2] if bgr is not None else (header.height_px, header.width_px)
        lanes = segmentation.lanes if segmentation else Lanes(LaneEvidence(), LaneEvidence(), LaneEvidence())
        source = segmentation.source if segmentation else SegmentationSource.NONE
        return Evidence(
            source_us=header.source_us,
            frame_seq=header.frame_seq,
            frame_epoch=header.frame_epoch,
            width_px=width,
            height_px=height,
            usable=cause is UnusableCause.NONE,
            cause=cause,
            time_base=header.time_base,
            media_us=header.media_us,
            detections=detections,
            left=lanes.left,
            center=lanes.center,
            right=lanes.right,
            segmentation=source,
            navigation_eligible=source is SegmentationSource.LEARNED,
            confidence_threshold=self._config.detections.confidence,
            timing=msgspec.structs.replace(timing, total_ms=self._stopwatch_ms() - start_ms),
            models=self._models,
            water_edge=segmentation.edge if segmentation else (),
        )
