"""Perception pipeline: one picture through the image-quality check, detector and segmenter to evidence."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any, NamedTuple

import msgspec
import numpy as np

from paani.arrays import F32, U8
from paani.config import PerceptionConfig
from paani.messages import (
    Candidate,
    Detection,
    Evidence,
    InferenceTiming,
    Label,
    LaneEvidence,
    PictureHeader,
    SegmentationSource,
    UnusableCause,
)
from paani_services.perception.box_decoding import decode_boxes, decode_people
from paani_services.perception.candidates import find_candidates, is_reflection, people_as_candidates
from paani_services.perception.colour_segmentation import FALLBACK_CONFIDENCE, segment_by_colour
from paani_services.perception.corridors import (
    MASK_HW,
    CorridorEvidence,
    classify_cells,
    find_water_edge,
    summarise_corridors,
)
from paani_services.perception.ego_hull import compute_visible_fractions, is_own_hull
from paani_services.perception.engine import Engine, load_network, network_path
from paani_services.perception.fitness import load_fitness
from paani_services.perception.image_quality import ImageQualityState, check_image_quality
from paani_services.perception.picture_decoding import decode_picture
from paani_services.perception.preprocessing import letterbox_picture, lookup_tables_for, stretch_picture
from paani_services.perception.roll_compensation import level_mask, limit_roll_rad
from paani_services.perception.view import is_filled, judge_view

NO_SEGMENTER = "none"  # value of `perception.segmenter` for colour segmentation alone
MIN_SLOWER_RATIO = 1.2  # of two run times; networks that take about as long keep their order, whatever one run says
SEGMENTER_CLASSES = ("water", "obstacle", "sky")  # D6


class Found(NamedTuple):
    """Detections, boxes that may be people by a lower threshold, and the time both took [ms].

    is_finite: whether any candidate of the network is made of numbers; where none is, nothing was looked for.
    """

    detections: tuple[Detection, ...]
    people: tuple[Detection, ...]
    duration_ms: float
    is_finite: bool = True


class Segmentation(NamedTuple):
    """Class mask uint8 [64, 80] (0 water, 1 obstacle, 2 sky), its confidence [64, 80], what follows from it, its
    source, and the time spent.

    `run_ms`: the part of `duration_ms` that the network itself took; 0 where there is none.
    """

    mask: U8
    confidence: F32
    water_edge: tuple[float, ...]
    corridors: CorridorEvidence
    source: SegmentationSource
    duration_ms: float
    run_ms: float


class Perceiver:
    """Both models, and what the image-quality check remembers of the pictures before. Not for two threads at once."""

    def __init__(self, config: PerceptionConfig, stopwatch_ms: Callable[[], float]) -> None:
        """Raises UserError for a model that cannot be used."""
        self._config, self._stopwatch_ms = config, stopwatch_ms
        self._detector = load_network("detector", config, config.intra_op_threads)
        self._segmenter = (
            None if config.segmenter == NO_SEGMENTER else load_network("segmenter", config, config.intra_op_threads)
        )
        self._is_full_set = not any(network_path(role, config) for role in ("detector", "segmenter"))
        engines = [engine for engine in (self._detector, self._segmenter) if engine]
        self._models = ", ".join(engine.info() for engine in engines)
        self._tables = [lookup_tables_for(engine.contract) for engine in engines]
        self._second_thread = ThreadPoolExecutor(1, "first-network") if config.concurrent else None
        self._detector_first = config.concurrent and self._is_slower(self._detector, self._segmenter)
        self._quality = ImageQualityState()
        self._fitness = load_fitness(config, config.intra_op_threads)
        self._filled_epoch: int | None = None  # of the last picture, where an obstacle filled it
        self._pending: list[Future[Any]] = []
        self._visible_frac: dict[tuple[int, ...], F32] = {}

    @property
    def sees_people(self) -> bool:
        """Whether the detector has a class person."""
        return Label.PERSON in self._detector.contract.classes

    def perceive(
        self, data: bytes | U8, header: PictureHeader, age_s: float, roll_rad: float = 0.0
    ) -> tuple[Evidence, U8 | None]:
        """Evidence of one distinct frame, and its class mask uint8 [64, 80], None where the picture is unusable.

        data: an encoded picture, or BGR uint8 [H, W, 3]. age_s: the picture's age now, when its inference starts.
        roll_rad: roll of the boat when it was taken, starboard down positive; 0 where unknown.
        Never raises for a bad picture: its evidence has `usable` false and a cause.
        """
        start_ms = self._stopwatch_ms()
        bgr = decode_picture(data)
        decoded_ms = self._stopwatch_ms()
        roll_rad = limit_roll_rad(roll_rad, self._config.max_roll_rad) if self._config.follow_roll else 0.0
        # The slower network starts while the picture is still checked; for a refused picture its result is dropped.
        detecting: Future[Found] | None = None
        segmenting: Future[Segmentation] | None = None
        if self._second_thread and bgr is not None and age_s <= self._config.max_frame_age_s:
            wait(self._pending)  # so that runs never pile up, however fast pictures are refused
            if self._detector_first:
                detecting = self._second_thread.submit(self._detect, bgr)
                self._pending = [detecting]
            else:
                segmenting = self._second_thread.submit(self._segment, bgr, roll_rad)
                self._pending = [segmenting]
        cause = self._check_usable(bgr, header, age_s)
        checked_ms = self._stopwatch_ms()
        timing = InferenceTiming(
            frame_age_ms=max(0.0, age_s) * 1e3, decode_ms=decoded_ms - start_ms, gate_ms=checked_ms - decoded_ms
        )
        if bgr is None or not self._may_be_usable(cause):
            self._filled_epoch = None
            return self._build_evidence(header, bgr, cause, (), None, timing, start_ms), None
        if detecting:
            segmentation = self._segment(bgr, roll_rad)
            found = detecting.result()
        else:
            found = self._detect(bgr)
            segmentation = segmenting.result() if segmenting else self._segment(bgr, roll_rad)  # B4: in turn
        if not found.is_finite:
            segmentation = segmentation._replace(source=SegmentationSource.FALLBACK)  # nobody moves by half the eyes
        found = self._without_reflections(found, segmentation)
        cause = self._judge_view(cause, found, segmentation, header.frame_epoch)
        timing = msgspec.structs.replace(
            timing,
            detector_ms=found.duration_ms,
            segmenter_ms=segmentation.duration_ms,
            segmenter_run_ms=segmentation.run_ms,
            inference_ms=self._stopwatch_ms() - checked_ms,
        )
        candidates = self._find_candidates(found, segmentation)
        if cause is not UnusableCause.NONE:
            evidence = self._build_evidence(header, bgr, cause, (), None, timing, start_ms)
            if candidates is not msgspec.UNSET:
                candidates = (*people_as_candidates(found.detections), *candidates)
            return msgspec.structs.replace(evidence, candidates=candidates), None
        evidence = self._build_evidence(header, bgr, cause, found.detections, segmentation, timing, start_ms)
        return msgspec.structs.replace(evidence, roll_rad=roll_rad, candidates=candidates), segmentation.mask

    def close(self) -> None:
        """Ends the second thread."""
        if self._second_thread is not None:
            self._second_thread.shutdown()

    def _is_slower(self, one: Engine, other: Engine | None) -> bool:
        """Whether one network is clearly slower than the other on this machine. No result depends on it."""
        if other is None:
            return False
        duration_ms = []
        for engine in (one, other, one, other):  # the first run of each reserves its memory
            shape, dtype = engine.contract.input.shape, engine.contract.input.dtype
            start_ms = self._stopwatch_ms()
            engine.run(np.zeros(shape, dtype))
            duration_ms.append(self._stopwatch_ms() - start_ms)
        return duration_ms[2] > MIN_SLOWER_RATIO * duration_ms[3]

    def _check_usable(self, bgr: U8 | None, header: PictureHeader, age_s: float) -> UnusableCause:
        if bgr is None:
            return UnusableCause.UNDECODABLE
        self._quality, cause = check_image_quality(
            self._quality, bgr, header.frame_epoch, self._config.image_quality, self._fitness
        )
        return UnusableCause.STALE if age_s > self._config.max_frame_age_s else cause

    def _may_be_usable(self, cause: UnusableCause) -> bool:
        """Whether the networks are asked: the picture is sound, or only the fitness network doubts it."""
        is_doubted = cause is UnusableCause.UNFIT and self._config.image_quality.swimmer_height > 0.0
        return cause is UnusableCause.NONE or is_doubted

    def _judge_view(self, cause: UnusableCause, found: Found, segmentation: Segmentation, epoch: int) -> UnusableCause:
        """The cause after the mask was seen; notes whether an obstacle fills the picture, unless it is unfit."""
        filled_epoch, self._filled_epoch = self._filled_epoch, None
        if not self._config.image_quality.enabled or segmentation.source is not SegmentationSource.LEARNED:
            return cause
        mask, confidence, config = segmentation.mask, segmentation.confidence, self._config
        visible_frac, was_filled = self._visible_fractions_of(mask.shape), filled_epoch == epoch
        cause = judge_view(
            cause,
            mask,
            confidence,
            visible_frac,
            found.detections,
            config.corridors,
            config.image_quality,
            was_filled=was_filled,
        )
        if cause is not UnusableCause.UNFIT and is_filled(mask, config.image_quality):
            self._filled_epoch = epoch
        return cause

    def _detect(self, bgr: U8) -> Found:
        start_ms = self._stopwatch_ms()
        contract = self._detector.contract
        height, width = contract.size_hw
        tensor, transform = letterbox_picture(bgr, height, width, contract.preprocessing.pad_grey, self._tables[0])
        output, config = self._detector.run(tensor), self._config
        detections = decode_boxes(output, transform, config.detections, contract.classes)
        people: tuple[Detection, ...] = ()
        if config.candidates.use:
            above = min(config.candidates.person_confidence, config.detections.threshold(Label.PERSON))
            people = decode_people(output, transform, config.detections, above, contract.classes)
        if config.ego_polygon:
            visible_frac = self._visible_fractions_of(MASK_HW)
            detections = tuple(d for d in detections if not is_own_hull(d.box_xyxy, visible_frac))
            people = tuple(d for d in people if not is_own_hull(d.box_xyxy, visible_frac))
        is_finite = bool(np.isfinite(output[0]).all(axis=0).any())
        return Found(detections, people, self._stopwatch_ms() - start_ms, is_finite)

    def _without_reflections(self, found: Found, segmentation: Segmentation) -> Found:
        """What was found without people who are water by the mask, where the full set's networks say both."""
        config, mask = self._config.candidates, segmentation.mask
        if not config.use or not self._is_full_set or segmentation.source is not SegmentationSource.LEARNED:
            return found
        detections, people = (
            tuple(each for each in boxes if not is_reflection(mask, each, config))
            for boxes in (found.detections, found.people)
        )
        return found._replace(detections=detections, people=people)

    def _find_candidates(self, found: Found, segmentation: Segmentation) -> tuple[Candidate, ...] | msgspec.UnsetType:
        """What may be a person; nothing by a mask that was drawn by rule, unset where it is not asked."""
        if not self._config.candidates.use:
            return msgspec.UNSET
        if segmentation.source is not SegmentationSource.LEARNED:
            return ()
        mask, confidence = segmentation.mask, segmentation.confidence
        visible_frac = self._visible_fractions_of(mask.shape)
        config = self._config.candidates
        return find_candidates(mask, confidence, visible_frac, found.people, found.detections, config)

    def _visible_fractions_of(self, shape: tuple[int, ...]) -> F32:
        """Fraction of each cell of a grid that lies outside the own hull, computed once for each shape."""
        if shape not in self._visible_frac:
            self._visible_frac[shape] = compute_visible_fractions(self._config.ego_polygon, *shape)
        return self._visible_frac[shape]

    def _segment(self, bgr: U8, roll_rad: float) -> Segmentation:
        """The segmenter's mask; a mask by colour where there is no segmenter or its scores are not finite."""
        start_ms = self._stopwatch_ms()
        source, (mask, confidence, run_ms) = SegmentationSource.LEARNED, self._segment_by_network(bgr)
        if not np.isfinite(confidence).all():
            source, mask = SegmentationSource.FALLBACK, segment_by_colour(bgr)
            confidence = np.full(mask.shape, FALLBACK_CONFIDENCE, np.float32)
        aspect = bgr.shape[1] / bgr.shape[0]
        visible_frac = self._visible_fractions_of(mask.shape)
        levelled = level_mask(mask, confidence, visible_frac, roll_rad, aspect)
        corridors = summarise_corridors(
            levelled.mask, levelled.confidence, self._config.corridors, levelled.visible_frac
        )
        return Segmentation(
            mask,
            confidence,
            find_water_edge(mask, visible_frac),
            corridors,
            source,
            self._stopwatch_ms() - start_ms,
            run_ms,
        )

    def _segment_by_network(self, bgr: U8) -> tuple[U8, F32, float]:
        """Mask, confidence, and how long the network ran [ms]; a confidence that is not finite without a segmenter."""
        if self._segmenter is None:
            return np.empty((0, 0), np.uint8), np.full(1, np.nan, np.float32), 0.0
        height, width = self._segmenter.contract.size_hw
        tensor = stretch_picture(bgr, height, width, self._tables[1])
        start_ms = self._stopwatch_ms()
        logits = self._segmenter.run(tensor)
        run_ms = self._stopwatch_ms() - start_ms
        rows = self._segmenter.contract.class_rows(SEGMENTER_CLASSES)
        return *classify_cells(logits if rows is None else logits[:, rows], self._config.temperature), run_ms

    def _build_evidence(
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
        corridors = (
            segmentation.corridors if segmentation else CorridorEvidence(LaneEvidence(), LaneEvidence(), LaneEvidence())
        )
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
            left=corridors.left,
            center=corridors.center,
            right=corridors.right,
            segmentation=source,
            navigation_eligible=source is SegmentationSource.LEARNED,
            confidence_threshold=self._config.detections.confidence,
            timing=msgspec.structs.replace(timing, total_ms=self._stopwatch_ms() - start_ms),
            models=self._models,
            water_edge=segmentation.water_edge if segmentation else (),
        )
