"""The fallback mask by colour thresholds."""

from __future__ import annotations

from paani_services.perception.colour_segmentation import segment_by_colour
from paani_services.perception.corridors import OBSTACLE
from tests.pictures import river, solid


def test_f1_colour_thresholds_separate_sky_water_and_obstacle() -> None:
    """F1: sky above, water below on a plain river; a red wall is neither."""
    mask = segment_by_colour(river())
    assert mask.shape == (64, 80)
    assert (mask[45:] == 0).mean() > 0.8
    assert (mask[:10] == 2).mean() > 0.8
    assert (segment_by_colour(solid(0, 0, 200)) == 1).mean() > 0.5


def test_f1_what_is_dark_is_no_water() -> None:
    assert (segment_by_colour(solid(10, 10, 10)) == OBSTACLE).all()
