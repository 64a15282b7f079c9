"""Whether a picture is a view from a boat, by its mask; a swimmer's close-up always is. Pure."""

import numpy as np

from paani.arrays import F32, U8
from paani.config import CorridorConfig, ImageQualityConfig
from paani.messages import Detection, Label, UnusableCause
from paani_services.perception.candidates import stands_in_water
from paani_services.perception.corridors import MIN_VISIBLE_FRAC, OBSTACLE, WATER

CLOSE_UP_WATER_SHARE = 0.80  # of the mask beside and below the swimmer


def judge_view(
    cause: UnusableCause,
    mask: U8,
    confidence: F32,
    visible_frac: F32,
    detections: tuple[Detection, ...],
    corridors: CorridorConfig,
    config: ImageQualityConfig,
    *,
    was_filled: bool = False,
) -> UnusableCause:
    """The cause after the mask was seen: what the image-quality check said, or that no boat has such a view.

    cause: NONE or UNFIT. mask, confidence: of the picture as it is. A swimmer near in the centre, around whom the
    mask is sure of water, makes the picture usable: refusing it would leave out whom it shows, and with somebody in the
    centre the advice is never straight on. An unfit picture that an obstacle fills, as it did the one before, is no
    evidence either, and yet no broken camera, which breaks from one picture to the next.
    """
    if shows_swimmer_close_up(mask, confidence, detections, corridors, config):
        return UnusableCause.NONE
    if cause is not UnusableCause.NONE:
        is_hull = cause is UnusableCause.UNFIT and was_filled and is_filled(mask, config)
        return UnusableCause.FILLED if is_hull else cause
    is_water = (mask == WATER) & (visible_frac >= MIN_VISIBLE_FRAC)
    if float(is_water.mean()) < config.min_water:
        return UnusableCause.NO_WATER
    if float((mask == WATER).all(axis=0).mean()) > config.max_endless:
        return UnusableCause.NO_HORIZON
    return UnusableCause.NONE


def is_filled(mask: U8, config: ImageQualityConfig) -> bool:
    """Whether an obstacle reaches the picture's top in `min_filled` of its columns, as the side of a vessel does."""
    return float((mask[0] == OBSTACLE).mean()) >= config.min_filled


def shows_swimmer_close_up(
    mask: U8, confidence: F32, detections: tuple[Detection, ...], corridors: CorridorConfig, config: ImageQualityConfig
) -> bool:
    """Whether somebody of `swimmer_height` and more is detected in the centre, in water that the mask is sure of."""
    if config.swimmer_height == 0.0:
        return False
    water = mask == WATER
    if not water.any() or float(np.mean(confidence[water])) < config.swimmer_water_confidence:
        return False
    start, end = corridors.center
    return any(
        d.label is Label.PERSON
        and d.box_xyxy[3] - d.box_xyxy[1] >= config.swimmer_height
        and start < (d.box_xyxy[0] + d.box_xyxy[2]) / 2.0 < end
        and d.box_xyxy[3] > corridors.top
        and stands_in_water(mask, d.box_xyxy, CLOSE_UP_WATER_SHARE)
        for d in detections
    )
