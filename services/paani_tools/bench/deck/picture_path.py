"""The way of one picture from the simulated camera to the screen, stage by stage. Pure.

rendering     true pose stamped -> picture drawn by the simulated camera, pose and scene together
jpeg          drawn -> encoded: what the encoder takes on this machine
camera        encoded -> published by the camera's process
to_perception published -> perception has begun with it
inference     begun -> decoded, checked, through both networks, summed up
evidence      inferred -> mask encoded, evidence published
bus           published -> heard by another process of this machine
websocket     heard -> evidence in the page
mask          evidence in the page -> mask in the page; zero where the mask was first
decoding      both in the page -> picture and mask decoded
drawing       decoded -> drawn on the page's canvas, with the wait for the browser's frame
compositor    drawn -> the browser begins its next frame
"""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from paani_tools.up.run_summary import Percentiles, percentiles

RENDERING = "rendering"
STAGES = (
    RENDERING, "jpeg", "camera", "to_perception", "inference", "evidence", "bus", "websocket", "mask", "decoding",
    "drawing", "compositor",
)  # fmt: skip


class PageMoments(msgspec.Struct, frozen=True):
    """When the page had each part of a frame, decoded it, drew it and began the frame after [Unix us]."""

    frame_seq: int
    evidence_us: float
    mask_us: float
    decoded_us: float
    drawn_us: float
    shown_us: float


class BoatMoments(msgspec.Struct, frozen=True):
    """What the boat's processes stamped of the same frame [Unix us]."""

    captured_us: float
    encoded_us: float
    published_us: float
    begun_us: float
    inferred_us: float
    evidence_us: float
    heard_us: float


def stage_durations_ms(boat: BoatMoments, page: PageMoments, jpeg_ms: float) -> dict[str, float]:
    """By stage; their sum is the time from the stamp to the screen."""
    both_us = max(page.evidence_us, page.mask_us)
    decoded_us = max(page.decoded_us, both_us)
    moments_us = (
        boat.captured_us, boat.encoded_us - jpeg_ms * 1e3, boat.encoded_us, boat.published_us, boat.begun_us,
        boat.inferred_us, boat.evidence_us, boat.heard_us, page.evidence_us, both_us, decoded_us, page.drawn_us,
        page.shown_us,
    )  # fmt: skip
    return {
        name: (after - before) * 1e-3 for name, before, after in zip(STAGES, moments_us, moments_us[1:], strict=False)
    }


def spread_of_stages(frames: Iterable[dict[str, float]]) -> dict[str, Percentiles]:
    """Of each stage over all frames."""
    found = list(frames)
    return {name: percentiles([each[name] for each in found]) for name in STAGES}
