"""The planner alone among vessels that do not give way: what the rules of the road ask for, in the Imazu cases."""

from __future__ import annotations

import math

import pytest

from tests.kinematic_imazu import drive

# Met and scored: head on, from starboard, both at once; in the plain form, and in the one in which all are slow.
CASES = ("imazu-01", "imazu-05", "imazu-fair-02", "imazu-fair-05")


@pytest.mark.rotating(cpu_s=10)
@pytest.mark.parametrize("name", CASES)
def test_the_boat_gives_way_early_and_to_the_side_that_the_rules_ask_for(name: str) -> None:
    """Each vessel is met by its class's own rule with 0.8 of 1 at least, and none comes nearer than 1 m."""
    driven = drive(name)
    assert math.isfinite(driven.seconds)
    for met in driven.encounters:
        assert next(iter(met.scores.values())) >= 0.8, met
        assert met.clearance_m >= 1.0
