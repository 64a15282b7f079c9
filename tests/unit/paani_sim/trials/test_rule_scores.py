"""Encounter classes and the scores of rules 8 and 13 to 17, against values by hand."""

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.encounters import classify_encounter
from paani.messages import EncounterClass
from paani_sim.trials.hull_clearance import HullPath
from paani_sim.trials.imazu_summary import SightGroup, format_imazu, sight_group, summarise_imazu
from paani_sim.trials.policies import Policy
from paani_sim.trials.rule_encounters import clear_m_of, is_in_domain, measure_rule_encounters
from paani_sim.trials.rule_scores import (
    Manoeuvre,
    course_unchanged,
    delay,
    not_apparent,
    rule_8,
    rule_13,
    rule_14,
    rule_15,
    rule_16,
    rule_17,
    safety,
    score_by_rule,
    speed_unchanged,
)
from paani_sim.trials.trial_cases import TrialCase
from paani_sim.vessels import load_vessel
from paani_sim.worlds import actor_distance_along_m
from paani_sim.worlds.encounter_paths import NOMINAL_BOAT_MPS
from paani_sim.worlds.imazu import CODES, DEPARTURE_S, build_imazu_scenario, relative_start, speed_ratio
from tests.unit.paani_sim.trials.trial_results import RESULT

# Seen at 20 m, acted at 15 m, passed at 5 m, port to port, with 15 degrees to starboard at an unchanged speed.
GIVEN = Manoeuvre(
    clearance_m=1.0, detected_m=20.0, acted_m=15.0, closest_m=5.0, bearing_deg=-90.0, aspect_deg=-90.0, turn_deg=15.0,
    starboard_turn_deg=15.0, start_mps=0.6, least_mps=0.6, most_mps=0.6,
)  # fmt: skip


def changed(**values: object) -> Manoeuvre:
    return msgspec.structs.replace(GIVEN, **values)


@pytest.mark.parametrize(
    ("name", "code", "expected"),
    [("imazu-01", "H", "head_on"), ("imazu-01", "F", "crossing_starboard"), ("imazu-01", "A", "crossing_starboard"),
     ("imazu-01", "a", "crossing_port"), ("imazu-01", "S", "overtaking"), ("imazu-01", "s", "crossing_port"),
     ("imazu-01", "B", "crossing_starboard"), ("imazu-01", "b", "crossing_port"),
     ("imazu-01", "E", "crossing_starboard"),
     ("imazu-01", "e", "crossing_port"), ("imazu-fair-01", "A", "crossing_starboard"),
     ("imazu-fair-01", "C", "overtaking"),
     ("imazu-fair-01", "D", "overtaking"), ("imazu-fair-01", "E", "overtaking")],
)  # fmt: skip
def test_classes_of_the_imazu_vessels(name: str, code: str, expected: str) -> None:
    bearing_deg = relative_start(name, code).bearing_deg
    aspect_deg = (bearing_deg + 180.0 - CODES[code].course_deg + 180.0) % 360.0 - 180.0
    assert classify_encounter(bearing_deg, aspect_deg, 0.6, 0.6 * speed_ratio(name, code)).value == expected


def test_classes_that_no_imazu_vessel_has() -> None:
    assert classify_encounter(170.0, 10.0, 0.6, 1.2) is EncounterClass.OVERTAKEN
    assert classify_encounter(170.0, 10.0, 0.6, 0.5) is EncounterClass.NONE
    assert classify_encounter(10.0, 170.0, 0.6, 0.7) is EncounterClass.NONE
    assert classify_encounter(120.0, -60.0, 0.6, 0.6) is EncounterClass.NONE
    assert classify_encounter(12.9, -12.9, 0.6, 0.6) is EncounterClass.HEAD_ON
    assert classify_encounter(13.1, -13.1, 0.6, 0.6) is EncounterClass.CROSSING_STARBOARD


@pytest.mark.parametrize(
    ("clearance_m", "expected"), [(2.0, 1.0), (1.5, 1.0), (1.0, 0.8), (0.5, 0.6), (0.25, 0.3), (0.0, 0.0)]
)
def test_safety_by_hand(clearance_m: float, expected: float) -> None:
    assert safety(clearance_m) == pytest.approx(expected)


def test_safety_of_who_asks_for_more() -> None:
    assert safety(1.25, clear_m=2.0) == pytest.approx(0.8)
    small, large = (build_imazu_scenario("imazu-01").world.actors[0] for _ in range(2))
    assert clear_m_of(small) == 1.5
    assert clear_m_of(type(large)(**{**large.__dict__, "length_m": 7.1})) == 5.0


def test_scores_by_hand() -> None:
    """Delay 5 m of 15 m; half of a 30 degree turn leaves 0.375 of course, 0.5 of speed: 0.1875 not apparent."""
    assert delay(GIVEN) == pytest.approx(1.0 / 3.0)
    assert course_unchanged(15.0) == pytest.approx(0.375)
    assert speed_unchanged(GIVEN) == pytest.approx(0.5)
    assert speed_unchanged(changed(least_mps=0.45)) == pytest.approx(0.25)
    assert not_apparent(GIVEN) == pytest.approx(0.1875)
    assert not_apparent(changed(turn_deg=20.0)) == 0.0
    assert not_apparent(changed(least_mps=0.4)) == 0.0
    assert rule_8(GIVEN) == pytest.approx(2.0 / 3.0 * 0.8125)
    assert rule_16(GIVEN) == pytest.approx(0.8 * 2.0 / 3.0 * 0.8125)
    assert rule_15(GIVEN) == pytest.approx(rule_16(GIVEN))
    assert rule_15(changed(aspect_deg=45.0)) == 0.0  # 0.433 - 0.5
    assert rule_13(GIVEN) == pytest.approx(rule_16(GIVEN))
    assert rule_13(changed(aspect_deg=44.0)) == pytest.approx(rule_16(GIVEN) - 0.3)
    # 0.6 (1 - 0.75^4) and 0.2 / 3 off, times 1 - 0.375
    assert rule_14(GIVEN) == pytest.approx((1.0 - 0.6 * 0.68359375 - 0.2 / 3.0) * 0.625)
    assert rule_14(changed(bearing_deg=90.0, aspect_deg=90.0)) == 0.0
    assert rule_17(GIVEN) == pytest.approx(0.8 - 0.5 * 13.0 / 28.0)
    assert rule_17(changed(turn_deg=2.0, most_mps=0.75, least_mps=0.3)) == pytest.approx(0.8 * 0.64 - 0.25)


@pytest.mark.parametrize("course_deg", [70.0, 90.0, 120.0])
@pytest.mark.parametrize("speed_mps", [0.26, 0.6, 1.5])
def test_who_passes_ahead_of_a_vessel_from_starboard_loses_half_and_who_passes_astern_nothing(
    course_deg: float, speed_mps: float
) -> None:
    """Ours is north, its course is so much to port of that. Both are held, and one comes to the crossing first."""
    course_rad, time_s = math.radians(course_deg), np.linspace(-60.0, 60.0, 2401)
    ahead = np.array([-math.sin(course_rad), math.cos(course_rad)])
    for late_s, lost in ((4.0, 0.5), (-4.0, 0.0)):
        offset_m = np.outer(time_s * 0.6, [0.0, 1.0]) - np.outer((time_s - late_s) * speed_mps, ahead)
        east_m, north_m = offset_m[np.hypot(*offset_m.T).argmin()]
        clockwise_deg = math.degrees(math.atan2(east_m, north_m) - math.atan2(*ahead))
        aspect_deg = (clockwise_deg + 180.0) % 360.0 - 180.0
        clear = changed(clearance_m=3.0, acted_m=20.0, turn_deg=30.0, aspect_deg=aspect_deg)
        assert rule_16(clear) - rule_15(clear) == pytest.approx(lost)


def test_never_seen_or_never_acted_is_the_longest_delay() -> None:
    assert delay(changed(detected_m=None)) == delay(changed(acted_m=None)) == 1.0
    assert rule_16(changed(acted_m=None)) == 0.0
    assert delay(changed(acted_m=25.0)) == 0.0
    assert delay(changed(acted_m=1.0)) == 1.0
    assert delay(changed(detected_m=5.0)) == 0.0


MANOEUVRES = st.builds(
    Manoeuvre,
    clearance_m=st.floats(0.0, 3.0), detected_m=st.floats(5.0, 40.0), acted_m=st.floats(0.0, 40.0),
    closest_m=st.floats(0.0, 5.0), bearing_deg=st.floats(-180.0, 180.0), aspect_deg=st.floats(-180.0, 180.0),
    turn_deg=st.floats(0.0, 90.0), starboard_turn_deg=st.floats(0.0, 90.0), start_mps=st.just(0.6),
    least_mps=st.floats(0.0, 0.6), most_mps=st.floats(0.6, 1.0),
)  # fmt: skip


@settings(deadline=None)
@given(MANOEUVRES, st.floats(0.0, 2.0), st.floats(0.0, 20.0), st.floats(0.0, 40.0))
def test_scores_are_bounded_and_monotonic(each: Manoeuvre, nearer_m: float, later_m: float, more_deg: float) -> None:
    """Nearer, later and less apparent never scores more; a stand-on boat that turns more never does."""
    nearer = msgspec.structs.replace(each, clearance_m=max(0.0, each.clearance_m - nearer_m))
    later = msgspec.structs.replace(each, acted_m=max(0.0, (each.acted_m or 0.0) - later_m))
    turned = msgspec.structs.replace(each, turn_deg=each.turn_deg + more_deg)
    for score in (rule_13, rule_15, rule_16, rule_17):
        assert 0.0 <= score(each) <= 1.0
        assert score(nearer) <= score(each)
    for own in (rule_8, rule_14):
        assert 0.0 <= own(later) <= own(each) <= 1.0
    for score in (rule_13, rule_15, rule_16):
        assert score(later) <= score(each)
    assert course_unchanged(turned.turn_deg) <= course_unchanged(each.turn_deg)
    assert rule_17(turned) <= rule_17(each)
    assert not_apparent(turned) <= not_apparent(each)


def test_each_class_is_scored_by_its_own_rule_first() -> None:
    rules = {kind: list(score_by_rule(kind, GIVEN)) for kind in EncounterClass}
    assert rules == {
        EncounterClass.OVERTAKEN: ["17"],
        EncounterClass.OVERTAKING: ["13", "16", "8"],
        EncounterClass.HEAD_ON: ["14", "8"],
        EncounterClass.CROSSING_STARBOARD: ["15", "16", "8"],
        EncounterClass.CROSSING_PORT: ["17"],
        EncounterClass.NONE: [],
    }


def test_the_ship_domain_reaches_farther_ahead_and_to_starboard() -> None:
    ahead_m = np.array([3.2, 3.4, -2.1, -2.3, 0.0, 0.0, 0.0, 0.0])
    starboard_m = np.array([0.0, 0.0, 0.0, 0.0, 3.3, 3.5, -1.8, -2.0])
    assert is_in_domain(ahead_m, starboard_m).tolist() == [True, False] * 4


def straight_drive(name: str, offset_m: float = 0.0, turn_s: float = np.inf) -> tuple[HullPath, np.ndarray]:
    """A boat at cruising speed along the route, or beside it, that turns 40 degrees to starboard at a time."""
    times_s = np.arange(0.0, 90.0, 0.1)
    yaw_rad = np.where(times_s >= turn_s, -np.radians(40.0), 0.0)
    step_m = 0.1 * NOMINAL_BOAT_MPS
    x_m = np.concatenate([[0.0], np.cumsum(step_m * np.cos(yaw_rad))[:-1]])
    y_m = offset_m + np.concatenate([[0.0], np.cumsum(step_m * np.sin(yaw_rad))[:-1]])
    actors = build_imazu_scenario(name).world.actors
    along_m = np.array([[actor_distance_along_m(actor, t_s + DEPARTURE_S) for actor in actors] for t_s in times_s])
    return HullPath(load_vessel("paper").hull, x_m, y_m, yaw_rad, along_m), np.full(len(times_s), NOMINAL_BOAT_MPS)


@pytest.mark.parametrize("name", ["imazu-05", "imazu-14", "imazu-fair-22"])
def test_who_does_nothing_is_hit_by_everyone_and_scores_nothing(name: str) -> None:
    path, surge_mps = straight_drive(name)
    found = measure_rule_encounters(build_imazu_scenario(name).world, path, surge_mps, NOMINAL_BOAT_MPS, 70.0)
    for each in found:
        assert each.clearance_m == 0.0
        assert each.is_domain_entered
        assert each.manoeuvre.acted_m is None
        assert each.manoeuvre.turn_deg == 0.0
        assert next(iter(each.scores.values())) <= 0.2


def test_a_turn_in_time_is_measured() -> None:
    """Head on from 48 m: after 10 s the vessel is 36 m off; 40 degrees to starboard pass it to port, well clear."""
    path, surge_mps = straight_drive("imazu-01", turn_s=10.0)
    [each] = measure_rule_encounters(build_imazu_scenario("imazu-01").world, path, surge_mps, NOMINAL_BOAT_MPS, 70.0)
    assert each.encounter_class is EncounterClass.HEAD_ON
    assert each.is_seen
    assert not each.is_domain_entered
    assert each.manoeuvre.detected_m == pytest.approx(48.0, abs=0.1)
    assert each.manoeuvre.acted_m == pytest.approx(36.0, abs=0.2)
    assert each.manoeuvre.starboard_turn_deg == each.manoeuvre.turn_deg == pytest.approx(40.0)
    assert each.manoeuvre.bearing_deg < 0.0
    assert each.scores["14"] > 0.5


def test_a_boat_that_gathers_way_has_not_acted() -> None:
    path, surge_mps = straight_drive("imazu-01")
    surge_mps[:30] = np.linspace(0.0, NOMINAL_BOAT_MPS, 30)
    [each] = measure_rule_encounters(build_imazu_scenario("imazu-01").world, path, surge_mps, NOMINAL_BOAT_MPS, 70.0)
    assert each.manoeuvre.acted_m is None
    assert each.manoeuvre.least_mps >= 0.9 * NOMINAL_BOAT_MPS


@pytest.mark.parametrize(("offset_m", "is_entered"), [(3.6, True), (-3.6, False)])
def test_the_ship_domain_is_entered_from_starboard_at_a_distance_that_is_clear_to_port(
    offset_m: float, is_entered: bool
) -> None:
    path, surge_mps = straight_drive("imazu-01", offset_m)
    [each] = measure_rule_encounters(build_imazu_scenario("imazu-01").world, path, surge_mps, NOMINAL_BOAT_MPS, 70.0)
    assert each.is_domain_entered is is_entered
    assert each.manoeuvre.bearing_deg * offset_m > 0.0


def test_what_is_abeam_is_not_seen_by_a_lens() -> None:
    path, surge_mps = straight_drive("imazu-06")
    world = build_imazu_scenario("imazu-06").world
    before, speeds_mps = path.slice_moments(slice(0, 380)), surge_mps[:380]  # the bearings are constant until they meet
    for hfov_deg, is_seen in ((102.0, False), (175.0, True)):
        met = measure_rule_encounters(world, before, speeds_mps, NOMINAL_BOAT_MPS, hfov_deg)
        assert {each.is_seen for each in met} == {is_seen}
        assert {each.manoeuvre.detected_m is not None for each in met} == {is_seen}
    assert sight_group("imazu-06", 102.0) is SightGroup.ALL_ROUND
    assert sight_group("imazu-06", 180.0) is SightGroup.ALL_SEEN
    assert sight_group("imazu-07", 70.0) is SightGroup.PARTLY


def test_cases_are_summed_by_form_and_group_and_never_over_them() -> None:
    path, surge_mps = straight_drive("imazu-05")
    world = build_imazu_scenario("imazu-05").world
    met = measure_rule_encounters(world, path, surge_mps, NOMINAL_BOAT_MPS, 70.0)
    hit = msgspec.structs.replace(RESULT, collisions=2, rule_encounters=met)
    results = {
        TrialCase(name, 1, Policy.PAANI): hit if name == "imazu-05" else RESULT
        for name in ("imazu-01", "imazu-03", "imazu-05", "imazu-04", "imazu-fair-04", "lake")
    }
    found = summarise_imazu(results)["paani"]
    assert {form: {group: f.drives for group, f in groups.items()} for form, groups in found.items()} == {
        "plain": {"all seen": 2, "partly seen": 1, "needs all-round vision": 1},
        "camera-fair": {"all seen": 1},
    }
    partly = found["plain"]["partly seen"]
    assert (partly.contacts, partly.untouched_share.share, partly.near, partly.domain_entered) == (2, 0.0, 0, 1)
    assert partly.scores["head_on"].encounters == partly.scores["crossing_starboard"].encounters == 1
    assert partly.time_lost_s == pytest.approx(100.0 - 40.0 / 0.6, abs=0.01)
    halted = {TrialCase("imazu-05", 1, Policy.PAANI): msgspec.structs.replace(hit, completed=False)}
    assert summarise_imazu(halted)["paani"]["plain"]["partly seen"].time_lost_s is None
    assert len(format_imazu({"paani": found})) == 2 + 4
    assert summarise_imazu({TrialCase("lake", 1, Policy.PAANI): RESULT}) == {}
