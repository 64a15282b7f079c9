"""The paper's single pictures at the policy: evidence that has their printed risks, and what is advised on it. Pure."""

from __future__ import annotations

from msgspec.structs import replace

from paani import messages as m
from paani.config import Config
from paani_services.advisor.advise import AdvisorState, advise
from paani_tools.paper_report.published import PublishedStill

FRAMES, PERIOD_US = 8, 100_000  # U8: eight presentations at 10 Hz
START_US = 1_000_000_000
NON_WATER_WEIGHT, UNCERTAINTY_WEIGHT = 0.55, 0.15  # J4


def lane_of(risk: float) -> m.LaneEvidence:
    """Water evidence that alone has this risk by J4, at most 0.70: not water first, then uncertainty."""
    non_water = min(1.0, risk / NON_WATER_WEIGHT)
    uncertainty = min(1.0, max(0.0, risk - NON_WATER_WEIGHT * non_water) / UNCERTAINTY_WEIGHT)
    return m.LaneEvidence(non_water=non_water, uncertainty=uncertainty, clear_width=1.0 - non_water)


def evidence_of(still: PublishedStill, paper: Config) -> m.Evidence:
    """Evidence whose three risks are those printed, in the paper's profile."""
    clear = lane_of(0.0)
    detections = () if still.detection is None else (still.detection,)
    boxes = m.Evidence(
        source_us=START_US, frame_seq=0, frame_epoch=1, width_px=320, height_px=240, usable=True, detections=detections,
        left=clear, center=clear, right=clear, segmentation=m.SegmentationSource.LEARNED, navigation_eligible=True,
    )  # fmt: skip
    _, of_boxes = last_advice(boxes, paper)
    parts = (of_boxes.left.risk, of_boxes.center.risk, of_boxes.right.risk)
    left, center, right = (lane_of(max(0.0, risk - part)) for risk, part in zip(still.risks, parts, strict=True))
    return replace(boxes, left=left, center=center, right=right)


def last_advice(evidence: m.Evidence, config: Config) -> tuple[AdvisorState, m.Advisory]:
    """The advice on the last of eight presentations, and the state after it."""
    state, advice = AdvisorState(), None
    for seq in range(FRAMES):
        source_us = START_US + seq * PERIOD_US
        frame = replace(evidence, source_us=source_us, frame_seq=seq)
        state, advice, _ = advise(state, frame, source_us + PERIOD_US, config)
    assert advice is not None
    return state, advice


def advice_when_stale(evidence: m.Evidence, age_s: float, config: Config) -> m.Advisory:
    """The advice once nothing has followed this evidence for so long."""
    state, advice = last_advice(evidence, config)
    _, stale, _ = advise(state, None, advice.source_us + round(age_s * 1e6), config)
    return stale
