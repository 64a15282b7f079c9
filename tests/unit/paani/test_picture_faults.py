"""Spoilt pictures: same shape, same bytes for the same seed, worse with severity, masks that move along."""

from __future__ import annotations

import numpy as np
import pytest

from paani.picture_faults import FAULTS, GEOMETRIC_FAULTS, IGNORE, SEVERITIES, apply_fault, crop_above_water
from tests.pictures import river

RIVER = river()
MASK = np.zeros(RIVER.shape[:2], np.uint8)
MASK[:90], MASK[90:130], MASK[130:200, :10] = 2, 1, 1


def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.mark.parametrize("name", [*FAULTS, *GEOMETRIC_FAULTS])
@pytest.mark.slow
def test_a_fault_is_a_picture_and_repeats(name: str) -> None:
    for severity in SEVERITIES:
        picture, mask = apply_fault(name, RIVER, MASK, severity, rng())
        again, _ = apply_fault(name, RIVER, MASK, severity, rng())
        assert picture.dtype == mask.dtype == np.uint8
        assert (picture.shape, mask.shape) == (RIVER.shape, MASK.shape)
        assert (picture == again).all()
        assert set(np.unique(mask)) <= {0, 1, 2, IGNORE}
        assert (mask == MASK).all() == (name in FAULTS)


@pytest.mark.parametrize("name", ["underexposed", "overexposed", "blur", "noise", "cover", "drops", "drop_out", "fog"])
@pytest.mark.slow
def test_a_higher_severity_departs_further(name: str) -> None:
    def departure(severity: int) -> float:
        picture, _ = apply_fault(name, RIVER, MASK, severity, rng())
        return float(np.abs(picture.astype(float) - RIVER).mean())

    departures = [departure(severity) for severity in SEVERITIES]
    assert departures == sorted(departures)
    assert departures[0] > 0.0


def test_upside_down_puts_the_water_on_top() -> None:
    picture, mask = apply_fault("tilted", RIVER, MASK, 5, rng())
    assert (mask[5:90] == 0).mean() > 0.95
    assert (mask[-60:-5] == 2).mean() > 0.95
    assert np.abs(picture[2:-2, 2:-2].astype(int) - RIVER[::-1, ::-1][2:-2, 2:-2]).mean() < 3.0


def test_a_shuffled_mask_keeps_its_shares() -> None:
    _, mask = apply_fault("shuffled", RIVER, MASK, 5, rng())
    assert np.bincount(mask.ravel()).tolist() == np.bincount(MASK.ravel()).tolist()


def test_a_view_without_water_comes_from_above_it() -> None:
    view = crop_above_water(RIVER, MASK)
    assert view is not None
    assert view.shape == RIVER.shape
    flooded = MASK.copy()
    flooded[30:] = 0
    assert crop_above_water(RIVER, flooded) is None
