"""Encounters: their class, their closest point of approach, and the words for them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from paani.messages import EncounterClass, Label, NavCommand
from paani_services.navigator.avoidance.clearance import APPROACH_S, WANTED_CPA_M
from paani_services.navigator.avoidance.courtesy import (
    Encounter,
    assess_encounter,
    describe_encounter,
)
from paani_services.navigator.avoidance.rollout import BoatState
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.velocity_fit import Velocity

NORTHWARD = BoatState(0.0, 0.0, math.pi / 2.0, 0.6)
MIRRORED = {
    EncounterClass.CROSSING_PORT: EncounterClass.CROSSING_STARBOARD,
    EncounterClass.CROSSING_STARBOARD: EncounterClass.CROSSING_PORT,
}
Motion = tuple[float, float, float, float]  # east and north of the boat [m]; eastwards and northwards [m/s]
# Hypothesis refuses a test of which no example is left.
HALF_ARE_PAST = settings(suppress_health_check=[HealthCheck.filter_too_much])
PLACES, SPEEDS, ANGLES = st.floats(-15.0, 15.0), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1)


def kayak(
    x_m: float,
    y_m: float,
    east_mps: float,
    north_mps: float,
    *,
    std_mps: float = 0.0,
    age_s: float = 0.0,
    half_m: float = 0.3,
) -> DynamicObstacle:
    """half_m: of its outline; a point has no two ends that come as near one after the other."""
    velocity = Velocity(east_mps, north_mps, std_mps)
    outline = np.array([x_m - half_m, x_m, x_m + half_m]), np.array([y_m, y_m, y_m])
    return DynamicObstacle(*outline, 0.2, velocity, age_s, frozenset(), 7, Label.VESSEL)


def order(heading_rad: float, speed_mps: float, *, enable: bool = True) -> NavCommand:
    return NavCommand(source_us=1, enable=enable, heading_rad=heading_rad, speed_mps=speed_mps)


def rotated(obstacle: DynamicObstacle, angle_rad: float) -> DynamicObstacle:
    """The obstacle turned about the origin."""
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    east, north, velocity = obstacle.east_m, obstacle.north_m, obstacle.velocity
    return obstacle._replace(
        east_m=cos * east - sin * north,
        north_m=sin * east + cos * north,
        velocity=Velocity(
            cos * velocity.east_mps - sin * velocity.north_mps,
            sin * velocity.east_mps + cos * velocity.north_mps,
            velocity.deviation_mps,
        ),
    )


def is_same(one: Encounter, other: Encounter) -> bool:
    return one.approach == pytest.approx(other.approach, abs=1e-6) and one.cpa_std_m == pytest.approx(other.cpa_std_m)


def place(bearing_deg: float, range_m: float, aspect_deg: float, speed_mps: float) -> Motion:
    """Where it is and how it moves, from its bearing off the northward bow and the boat's bearing off its own bow."""
    towards_rad = NORTHWARD.yaw_rad + math.radians(bearing_deg)
    course_rad = towards_rad + math.pi - math.radians(aspect_deg)
    return (
        range_m * math.cos(towards_rad),
        range_m * math.sin(towards_rad),
        speed_mps * math.cos(course_rad),
        speed_mps * math.sin(course_rad),
    )


CLASS_BOUNDS_DEG = (0.0, 10.0, 13.0, 45.0, 112.5, 180.0, 247.5, 315.0, 347.0, 350.0, 360.0)
WITHIN_CLASSES_DEG = st.one_of(
    [st.floats(low + 0.01, high - 0.01) for low, high in itertools.pairwise(CLASS_BOUNDS_DEG)]
)  # not within rounding of a bound between two classes
OTHER_SPEEDS = st.floats(0.06, 0.59) | st.floats(0.61, 1.5)  # than the boat's
MOTIONS = st.builds(place, WITHIN_CLASSES_DEG, st.floats(0.1, 20.0), WITHIN_CLASSES_DEG, OTHER_SPEEDS)


@HALF_ARE_PAST
@given(MOTIONS)
def test_the_mirrored_encounter_has_the_mirrored_class(motion: Motion) -> None:
    x, y, east, north = motion
    seen = assess_encounter(kayak(x, y, east, north, half_m=0.0), NORTHWARD)
    mirrored = assess_encounter(kayak(-x, y, -east, north, half_m=0.0), NORTHWARD)
    assert is_same(seen, mirrored)
    assume(seen.approach.tcpa_s > 1e-6)
    assert mirrored.kind is MIRRORED.get(seen.kind, seen.kind)


@HALF_ARE_PAST
@given(MOTIONS, ANGLES)
def test_encounters_do_not_depend_on_where_north_is(motion: Motion, turn: float) -> None:
    x, y, east, north = motion
    near, std = kayak(x, y, east, north, std_mps=0.1, age_s=2.0, half_m=0.0), WANTED_CPA_M
    seen = assess_encounter(near, NORTHWARD)
    turned = assess_encounter(rotated(near, turn), NORTHWARD._replace(yaw_rad=NORTHWARD.yaw_rad + turn))
    assert is_same(seen, turned)
    assume(abs(seen.approach.cpa_m - seen.cpa_std_m - std) > 1e-6 and seen.approach.tcpa_s > 1e-6)
    assert turned.kind is seen.kind


@HALF_ARE_PAST
@given(PLACES, PLACES, SPEEDS, SPEEDS, st.floats(0.0, 1.0))
@pytest.mark.slow
def test_the_closest_point_stays_where_it_is_while_it_comes_nearer(
    x: float, y: float, east: float, north: float, part: float
) -> None:
    """Time shift: after a part of the time to it, what is left of that time remains."""
    one = DynamicObstacle(np.array([x]), np.array([y]), 0.2, Velocity(east, north, 0.0), 0.0, frozenset())
    now = assess_encounter(one, NORTHWARD).approach
    assume(0.0 < now.tcpa_s < APPROACH_S and math.hypot(east, north - 0.6) > 0.01)
    lead_s = part * now.tcpa_s
    later = one._replace(east_m=one.east_m + lead_s * east, north_m=one.north_m + lead_s * north)
    then = assess_encounter(later, NORTHWARD._replace(y_m=0.6 * lead_s)).approach
    assert then.cpa_m == pytest.approx(now.cpa_m, abs=1e-6)
    assert then.tcpa_s == pytest.approx(now.tcpa_s - lead_s, abs=1e-6)


@pytest.mark.parametrize(
    ("given", "kind"),
    [
        (kayak(0.0, 10.0, 0.0, -1.0), EncounterClass.HEAD_ON),
        (kayak(8.0, 5.0, -1.0, 0.0), EncounterClass.CROSSING_STARBOARD),
        (kayak(-8.0, 5.0, 1.0, 0.0), EncounterClass.CROSSING_PORT),
        (kayak(0.5, 5.0, 0.0, 0.2), EncounterClass.OVERTAKING),
        (kayak(0.5, -8.0, 0.0, 1.5), EncounterClass.OVERTAKEN),
        (kayak(8.0, 5.0, 1.0, 0.0), EncounterClass.NONE),  # it goes away
        (kayak(8.0, 5.0, 0.0, -0.6), EncounterClass.NONE),  # it passes 7.7 m off
        (kayak(0.0, 5.0, 0.0, 0.0), EncounterClass.NONE),  # it lies still
    ],
)
def test_the_class_is_that_of_the_angles(given: DynamicObstacle, kind: EncounterClass) -> None:
    assert assess_encounter(given, NORTHWARD).kind is kind


def test_the_class_is_kept_until_they_are_past_each_other() -> None:
    """A kayak that came from starboard is still the one from starboard once the boat has turned behind it."""
    port = kayak(-2.0, 4.0, -1.0, 0.0)
    assert (
        assess_encounter(port, NORTHWARD, EncounterClass.CROSSING_STARBOARD).kind is EncounterClass.CROSSING_STARBOARD
    )
    past = kayak(-2.0, -1.0, -1.0, 0.0)
    assert assess_encounter(past, NORTHWARD, EncounterClass.CROSSING_STARBOARD).kind is EncounterClass.NONE


def test_what_is_uncertain_is_met_further_off() -> None:
    """The standard deviation grows by that of the velocity until the closest point, and while it is out of sight."""
    certain = assess_encounter(kayak(9.0, 4.0, -0.5, 0.0), NORTHWARD)
    assert (certain.kind, certain.cpa_std_m) == (EncounterClass.NONE, 0.0)
    unsure = assess_encounter(kayak(9.0, 4.0, -0.5, 0.0, std_mps=0.1), NORTHWARD)
    assert unsure.approach == certain.approach
    assert unsure.cpa_std_m == pytest.approx(0.1 * unsure.approach.tcpa_s)
    assert unsure.kind is EncounterClass.CROSSING_STARBOARD
    unseen = assess_encounter(kayak(9.0, 4.0, -0.5, 0.0, std_mps=0.1, age_s=2.0), NORTHWARD)
    assert unseen.cpa_std_m == pytest.approx(unsure.cpa_std_m + 0.1 * 2.0 + 0.1 * 2.0)


ASTERN, AHEAD = math.radians(60.0), math.radians(150.0)  # headings behind and before a kayak from starboard


@pytest.mark.parametrize(
    ("given", "ordered", "words"),
    [
        (kayak(8.0, 5.0, -1.0, 0.0), order(ASTERN, 0.6), "vessel #7 crossing from starboard, passing astern of it"),
        (kayak(8.0, 5.0, -0.7, 0.0), order(AHEAD, 0.6), "vessel #7 crossing from starboard, passing ahead of it"),
        (kayak(-8.0, 5.0, 1.0, 0.0), order(0.0, 0.0), "vessel #7 crossing from port, waiting until it is past"),
        (kayak(-8.0, 5.0, 1.0, 0.0), order(math.pi, 0.6), "vessel #7 crossing from port, passing astern of it"),
        (kayak(0.0, 10.0, 0.0, -1.0), order(ASTERN, 0.6), "vessel #7 head on, passing it on our port side"),
        (kayak(0.0, 10.0, 0.0, -1.0), order(2.0, 0.6), "vessel #7 head on, passing it on our starboard side"),
        (kayak(0.0, 10.0, 0.0, -1.0), order(0.0, 0.0, enable=False), "vessel #7 head on, lying without thrust"),
        (kayak(0.5, -8.0, 0.0, 1.5), order(math.pi / 2, 0.6), "vessel #7 overtaking us, keeping the course"),
        (kayak(0.5, -8.0, 0.0, 1.5), order(2.5, 0.6), "vessel #7 overtaking us, moving aside"),
        (kayak(0.0, 5.0, 0.0, 0.3), order(-math.pi / 2, 0.6), "vessel #7 ahead and slower, turning away from it"),
    ],
)  # fmt: skip
def test_the_words_say_how_they_meet_and_what_the_order_does(
    given: DynamicObstacle, ordered: NavCommand, words: str
) -> None:
    encounter = assess_encounter(given, NORTHWARD)
    assert describe_encounter(encounter, NORTHWARD, ordered) == f"Give way: {words}"


def test_without_an_encounter_there_are_no_words() -> None:
    encounter = assess_encounter(kayak(8.0, 5.0, 1.0, 0.0), NORTHWARD)
    assert describe_encounter(encounter, NORTHWARD, order(0.0, 0.6)) == ""
