"""Evidence for the advisor's tests."""

from __future__ import annotations

import msgspec

from paani import messages as m
from paani.config import Config, calibration_of, load_config
from paani_services.advisor.advise import AdvisorState, advise

T0_US = 1_000_000_000
PAANI, PAPER = load_config(), load_config(profile="paper")
CALIBRATED = msgspec.structs.replace(PAANI, calibration=calibration_of(PAANI.eye))
BUOY_AHEAD = m.Detection(label=m.Label.BUOY, confidence=0.8, box_xyxy=(0.45, 0.40, 0.55, 0.60))


def lane(risk: float) -> m.LaneEvidence:
    """Water evidence that alone gives `risk` (at most 0.70) by J4: non-water first, then uncertainty."""
    non_water = min(1.0, risk / 0.55)
    uncertainty = max(0.0, risk - 0.55 * non_water) / 0.15
    return m.LaneEvidence(non_water=non_water, uncertainty=uncertainty, clear_width=1.0 - non_water)


def murky(risk: float) -> m.LaneEvidence:
    """As `lane`, for 0.495 to 0.645, but with some water left in it: no dry lane."""
    return m.LaneEvidence(non_water=0.9, uncertainty=(risk - 0.495) / 0.15, clear_width=0.1)


CLEAR = m.Evidence(
    source_us=T0_US, frame_seq=0, frame_epoch=1, width_px=320, height_px=240, usable=True,
    left=lane(0.05), center=lane(0.05), right=lane(0.05),
    segmentation=m.SegmentationSource.LEARNED, navigation_eligible=True,
)  # fmt: skip


def water(left: float, center: float, right: float) -> m.Evidence:
    """Evidence without detections whose lanes have these risks."""
    return msgspec.structs.replace(CLEAR, left=lane(left), center=lane(center), right=lane(right))


def play(
    frames: list[m.Evidence],
    config: Config = PAANI,
    period_s: float = 0.2,
    state: AdvisorState | None = None,
    first_seq: int = 0,
) -> tuple[AdvisorState, list[m.Advisory], list[m.Tracks]]:
    """Advise on frames that come `period_s` apart, each 0.1 s after its capture."""
    state = state or AdvisorState()
    advice: list[m.Advisory] = []
    tracks: list[m.Tracks] = []
    for seq, frame in enumerate(frames, first_seq):
        source_us = T0_US + round(seq * period_s * 1e6)
        stamped = msgspec.structs.replace(frame, source_us=source_us, frame_seq=seq)
        state, given, seen = advise(state, stamped, source_us + 100_000, config)
        advice.append(given)
        tracks.append(seen)
    return state, advice, tracks


def seeing(*detections: m.Detection) -> m.Evidence:
    """Clear water with these boxes."""
    return msgspec.structs.replace(CLEAR, detections=detections)


def box(label: m.Label, xyxy: tuple[float, float, float, float], confidence: float = 0.8) -> m.Detection:
    return m.Detection(label=label, confidence=confidence, box_xyxy=xyxy)
