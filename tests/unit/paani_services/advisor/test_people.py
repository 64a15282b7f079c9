"""People and open water: whoever is in the way is never clear, and what shows no water is no way."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import Config, load_config
from paani.messages import BoxXyxy
from paani_services.advisor.frame_facts import is_closed
from paani_services.advisor.people import counts, is_close, nearest_ahead_m, people_in_lane, speed_limit_mps
from paani_services.advisor.risk import Obstacle
from tests.unit.paani_services.advisor.advisor_evidence import CALIBRATED, CLEAR, PAANI, PAPER, box, lane, play, seeing

STILL = (m.Direction.STOP, m.Direction.NO_DATA)
BOLDNESS = {m.Direction.STOP: 0, m.Direction.LEFT: 1, m.Direction.RIGHT: 1, m.Direction.SLIGHT_LEFT: 2,
            m.Direction.SLIGHT_RIGHT: 2, m.Direction.STRAIGHT: 3}  # fmt: skip
MEETS = st.floats(0.32, 0.60)


def boxes(label: m.Label) -> st.SearchStrategy[m.Detection]:
    return st.builds(
        lambda x, y, w, h, c: box(label, (x, y, min(1.0, x + w), min(1.0, y + h)), c),
        st.floats(0.0, 0.9), st.floats(0.2, 0.8), st.floats(0.03, 0.4), st.floats(0.15, 0.5), st.floats(0.41, 1.0),
    )  # fmt: skip


LANES = st.builds(
    lambda n, u, w: m.LaneEvidence(non_water=n, uncertainty=u, clear_width=1.0 - n, open_width=w),
    st.floats(0.0, 1.0), st.floats(0.0, 0.3), st.floats(0.0, 1.0),
)  # fmt: skip
FRAMES = st.builds(
    lambda left, center, right, things: msgspec.structs.replace(
        CLEAR, left=left, center=center, right=right, detections=tuple(things)
    ),
    LANES, LANES, LANES, st.lists(boxes(m.Label.BUOY) | boxes(m.Label.VESSEL), max_size=3),
)  # fmt: skip


@given(FRAMES, MEETS, st.floats(0.05, 0.6), st.floats(0.41, 1.0))
def test_one_picture_of_a_person_ahead_is_enough_to_leave_the_way(
    frame: m.Evidence, x: float, height: float, confidence: float
) -> None:
    person = box(m.Label.PERSON, (x, 0.35, x + 0.08, 0.35 + height), confidence)
    advisory = play([msgspec.structs.replace(frame, detections=(*frame.detections, person))])[1][0]
    assert advisory.direction is not m.Direction.STRAIGHT
    assert "clear," not in advisory.explanation
    assert advisory.people_ahead


@given(FRAMES, boxes(m.Label.PERSON), st.integers(1, 3))
def test_another_person_makes_no_advice_bolder_and_no_boat_faster(
    frame: m.Evidence, person: m.Detection, count: int
) -> None:
    before = play([frame] * count)[1][-1]
    after = play([msgspec.structs.replace(frame, detections=(*frame.detections, person))] * count)[1][-1]
    assert BOLDNESS[after.direction] <= BOLDNESS[before.direction]
    assert before.speed_limit_mps == after.speed_limit_mps == PAANI.advisor.people.uncalibrated_mps


def test_a_person_before_an_obstacle_that_reaches_into_the_way_does_not_open_its_side() -> None:
    """Nobody is passed by a slight turn, and the side that the obstacle comes from stays closed."""
    buoy = box(m.Label.BUOY, (0.28, 0.4, 0.37, 0.6), 0.95)
    swimmer = box(m.Label.PERSON, (0.50, 0.4, 0.56, 0.6))
    bank, removals = lane(0.66), tuple[m.Removal, ...]()
    for right, alone, with_somebody in (
        (CLEAR.right, m.Direction.SLIGHT_RIGHT, m.Direction.RIGHT),
        (bank, m.Direction.STOP, m.Direction.STOP),
    ):
        frame = msgspec.structs.replace(seeing(buoy), center=lane(0.35), right=right)
        advisory = play([frame] * 3)[1][-1]
        assert (advisory.direction, advisory.left.blocked) == (alone, False)
        frame = msgspec.structs.replace(frame, detections=(*frame.detections, swimmer))
        advisory = play([frame] * 3)[1][-1]
        assert advisory.direction is with_somebody
        removals = advisory.counterfactual.removals
    assert m.Removal(direction=m.Direction.RIGHT, water=(m.Lane.RIGHT,)) in removals


@given(FRAMES)
def test_a_lane_without_connected_water_is_never_advised(frame: m.Evidence) -> None:
    advisory = play([frame] * 3)[1][-1]
    if advisory.direction in STILL:
        return
    way = getattr(frame, m.SIDE_OF.get(advisory.direction, "center"))
    assert way.open_width >= PAANI.advisor.policy.open_width
    assert way.non_water + way.uncertainty <= PAANI.advisor.policy.not_water


@given(FRAMES, st.sampled_from(("left", "center", "right")), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_mask_that_shows_less_water_or_is_less_sure_of_it_closes_no_lane_less(
    frame: m.Evidence, which: str, non_water: float, uncertainty: float
) -> None:
    water = getattr(frame, which)
    worse = msgspec.structs.replace(
        water, non_water=max(water.non_water, non_water), uncertainty=max(water.uncertainty, uncertainty)
    )
    assert is_closed(worse, PAANI.advisor.policy) >= is_closed(water, PAANI.advisor.policy)
    assert not is_closed(worse, PAPER.advisor.policy)


@pytest.mark.parametrize(
    ("non_water", "uncertainty", "direction"), [(0.5, 0.2, "STRAIGHT"), (0.5, 0.4, "STOP"), (0.7, 0.2, "STOP")]
)
def test_a_lane_is_no_way_where_too_little_of_it_is_surely_water(
    non_water: float, uncertainty: float, direction: str
) -> None:
    lane_water = m.LaneEvidence(non_water=non_water, uncertainty=uncertainty, clear_width=0.5, open_width=0.5)
    frame = msgspec.structs.replace(CLEAR, left=lane_water, center=lane_water, right=lane_water)
    assert play([frame] * 3)[1][-1].direction == direction


@given(st.floats(0.0, 0.5), st.floats(0.0, 0.2), st.floats(0.5, 1.0))
def test_open_water_with_nothing_ahead_is_straight_on(non_water: float, uncertainty: float, width: float) -> None:
    water = m.LaneEvidence(non_water=non_water, uncertainty=uncertainty, clear_width=width, open_width=width)
    frame = msgspec.structs.replace(CLEAR, left=water, center=water, right=water)
    assert play([frame] * 3)[1][-1].direction is m.Direction.STRAIGHT


def test_a_person_that_blinks_is_not_forgotten_while_the_track_is_held() -> None:
    swimmer = seeing(box(m.Label.PERSON, (0.46, 0.4, 0.54, 0.6)))
    advice = play([swimmer, swimmer, *[CLEAR] * 14])[1]
    assert {advisory.direction for advisory in advice[:15]}.isdisjoint({m.Direction.STRAIGHT})


def test_the_sentence_says_what_was_decided_about_the_person() -> None:
    swimmer = seeing(box(m.Label.PERSON, (0.46, 0.4, 0.54, 0.56)))
    advisory = play([swimmer], CALIBRATED)[1][0]
    assert advisory.explanation.startswith(
        f"Slow: swimmer ahead at about {advisory.person_distance_m:.0f} m, passing on the "
    )
    near = play([seeing(box(m.Label.PERSON, (0.4, 0.3, 0.6, 1.0)))])[1][0]
    assert near.direction is m.Direction.STOP
    assert near.explanation.startswith("Stop: swimmer ahead, waiting. ")


def maybe(kind: m.CandidateKind, x: float, y: float, width: float = 0.05, height: float = 0.06) -> m.Candidate:
    return m.Candidate(kind=kind, confidence=0.3, box_xyxy=(x, y, min(1.0, x + width), min(1.0, y + height)))


KINDS = st.sampled_from(list(m.CandidateKind))


@given(FRAMES, KINDS, st.floats(0.27, 0.68), st.floats(0.30, 0.9))
def test_one_picture_of_what_may_be_a_person_ahead_is_never_clear(
    frame: m.Evidence, kind: m.CandidateKind, x: float, y: float
) -> None:
    before = play([frame])[1][0]
    advisory = play([msgspec.structs.replace(frame, candidates=(maybe(kind, x, y),))])[1][0]
    assert advisory.direction is not m.Direction.STRAIGHT
    assert "clear," not in advisory.explanation
    assert advisory.candidates_ahead == (1,)
    assert advisory.people_ahead == ()
    assert advisory.speed_limit_mps == PAANI.advisor.people.slow_mps
    assert BOLDNESS[advisory.direction] <= BOLDNESS[before.direction]


@given(FRAMES, st.lists(st.builds(maybe, KINDS, st.floats(0.0, 0.9), st.floats(0.0, 0.9)), max_size=3))
def test_candidates_make_no_advice_bolder(frame: m.Evidence, candidates: list[m.Candidate]) -> None:
    without = play([msgspec.structs.replace(frame, candidates=())])[1][0]
    advisory = play([msgspec.structs.replace(frame, candidates=tuple(candidates))])[1][0]
    assert BOLDNESS[advisory.direction] <= BOLDNESS[without.direction]
    assert advisory.center.risk == without.center.risk
    assert advisory.contributing_track_ids == without.contributing_track_ids


def test_the_sentence_and_what_would_change_it_name_what_may_be_a_person() -> None:
    frame = msgspec.structs.replace(CLEAR, candidates=(maybe(m.CandidateKind.LONE_OBSTACLE, 0.47, 0.5),))
    advisory = play([frame])[1][0]
    assert advisory.explanation == (
        "Slow: something that may be a person ahead, passing on the right. "
        "Turn right: something that may be a person is in the way ahead or beside it; "
        "the sides are alike, starboard by rule, left 0.05, right 0.05 (limit 0.58). "
        "Without what may be a person it would go STRAIGHT."
    )
    assert advisory.counterfactual.removals[0] == m.Removal(direction=m.Direction.STRAIGHT, candidates=(1,))
    shore = msgspec.structs.replace(CLEAR, candidates=(maybe(m.CandidateKind.LONE_OBSTACLE, 0.47, 0.2),))
    assert play([shore])[1][0].direction is m.Direction.STRAIGHT


def test_a_calibrated_camera_leaves_a_candidate_to_the_obstacle_that_it_is_and_to_its_size() -> None:
    buoy = box(m.Label.BUOY, (0.46, 0.49, 0.53, 0.57), 0.9)
    lone = maybe(m.CandidateKind.LONE_OBSTACLE, 0.47, 0.5)
    frame = msgspec.structs.replace(seeing(buoy), candidates=(lone,))
    assert play([frame] * 3, CALIBRATED)[1][-1].candidates_ahead is msgspec.UNSET
    assert play([frame] * 3)[1][-1].candidates_ahead == (1,)
    doubtful = msgspec.structs.replace(frame, detections=(box(m.Label.BUOY, buoy.box_xyxy, 0.5),))
    assert play([doubtful] * 3, CALIBRATED)[1][-1].candidates_ahead == (1,)
    assert play([frame], CALIBRATED)[1][-1].candidates_ahead == (1,)  # seen once, the buoy is not confirmed
    raft = maybe(m.CandidateKind.LONE_OBSTACLE, 0.2, 0.4, width=0.6)
    floating = msgspec.structs.replace(CLEAR, candidates=(raft,))
    assert play([floating], CALIBRATED)[1][-1].candidates_ahead is msgspec.UNSET
    assert play([floating])[1][-1].candidates_ahead == (1,)


EDGE = st.lists(st.floats(0.0, 1.0), min_size=80, max_size=80)


@given(EDGE, st.floats(0.35, 0.6), st.floats(0.35, 0.75), st.floats(0.03, 0.3))
def test_whoever_the_water_reaches_is_never_taken_to_be_ashore(
    edge: list[float], x: float, y: float, height: float
) -> None:
    person = box(m.Label.PERSON, (x, y, x + 0.05, min(y + height, 1.0)))
    column = int((x + 0.025) * 80)
    edge[column] = min(edge[column], person.box_xyxy[3])
    frame = msgspec.structs.replace(seeing(person), water_edge=tuple(edge))
    advisory = play([frame])[1][0]
    assert advisory.direction is not m.Direction.STRAIGHT
    assert advisory.people_ahead


def test_somebody_on_a_far_bank_is_not_in_the_way_but_somebody_near_is() -> None:
    """The boat goes on where it stopped before: between it and them lies what is no water, on both sides as well."""
    angler = box(m.Label.PERSON, (0.47, 0.32, 0.52, 0.45))
    bank = msgspec.structs.replace(seeing(angler), water_edge=(0.55,) * 80)
    assert play([bank] * 3)[1][-1].direction is m.Direction.STRAIGHT
    for column in (36, 39, 43):  # beside and below the angler
        inlet = msgspec.structs.replace(bank, water_edge=tuple(0.4 if i == column else 0.55 for i in range(80)))
        assert play([inlet])[1][0].direction is not m.Direction.STRAIGHT
    for first, last in (
        (0, 80),
        (39, 40),
    ):  # no water at the bottom: what is there may be the bow, or a glint before it
        bow = msgspec.structs.replace(bank, water_edge=tuple(1.0 if first <= i < last else 0.55 for i in range(80)))
        assert play([bow])[1][0].people_ahead
    near = box(m.Label.PERSON, (0.45, 0.32, 0.53, 0.53))
    assert play([msgspec.structs.replace(bank, detections=(near,), water_edge=(0.6,) * 80)])[1][0].people_ahead
    unknown = msgspec.structs.replace(bank, water_edge=())
    assert play([unknown])[1][0].people_ahead


def test_without_a_calibration_a_tall_vessel_in_the_middle_is_ahead_however_small_it_looks() -> None:
    sail = box(m.Label.VESSEL, (0.48, 0.30, 0.52, 0.42))
    assert play([seeing(sail)] * 3)[1][-1].direction is not m.Direction.STRAIGHT
    low = box(m.Label.VESSEL, (0.48, 0.35, 0.52, 0.42))
    assert play([seeing(low)] * 3)[1][-1].direction is m.Direction.STRAIGHT
    assert play([seeing(sail)] * 3, CALIBRATED)[1][-1].direction is m.Direction.STRAIGHT


@pytest.mark.parametrize("config", [PAPER])
def test_the_paper_weighs_a_person_as_anything_else(config: Config) -> None:
    as_person, as_buoy = (
        play([seeing(box(label, (0.46, 0.4, 0.54, 0.56)))] * 3, config)[1][-1]
        for label in (m.Label.PERSON, m.Label.BUOY)
    )
    assert (as_person.direction, as_person.center) == (as_buoy.direction, as_buoy.center)
    assert b"speed_limit" not in msgspec.json.encode(as_person)
    lone = msgspec.structs.replace(CLEAR, candidates=(maybe(m.CandidateKind.LONE_OBSTACLE, 0.47, 0.5),))
    assert play([lone], config)[1][-1].direction is m.Direction.STRAIGHT
    closed = msgspec.structs.replace(lane(0.2), open_width=0.0)
    frame = msgspec.structs.replace(CLEAR, left=closed, center=closed, right=closed)
    assert play([frame], config)[1][-1].direction is m.Direction.STRAIGHT


PEOPLE = PAANI.advisor.people
AHEAD, BESIDE, LEFT, RIGHT = (0.45, 0.4, 0.55, 0.6), (0.27, 0.4, 0.30, 0.6), (0.1, 0.4, 0.2, 0.6), (0.8, 0.4, 0.9, 0.6)


def person(box: BoxXyxy = AHEAD, **changes: object) -> Obstacle:
    seen = Obstacle(1, False, box, 0.5, 0.0, 1.0, is_danger=False, is_person=True)
    return msgspec.structs.replace(seen, **changes)


def blocked(obstacle: Obstacle) -> set[str]:
    return {lane for lane in ("left", "center", "right") if people_in_lane(lane, (obstacle,), PAANI)}


@pytest.mark.parametrize(
    ("obstacle", "lanes"),
    [
        (person(), {"center"}),
        (person(LEFT), {"left"}),
        (person(RIGHT), {"right"}),
        (person(BESIDE), {"left", "center"}),  # about to drift into the way
        (person((0.41, 0.4, 0.45, 0.6)), {"center"}),  # nobody drifts into a side
        (person(BESIDE, candidate=1), {"left"}),  # what may be a person is not taken to drift
        (person((0.2, 0.4, 0.26, 0.6)), {"left"}),
        (person((0.70, 0.4, 0.73, 0.6)), {"center", "right"}),
        (person((0.74, 0.4, 0.80, 0.6)), {"right"}),
        (person((0.45, 0.2, 0.55, 0.8)), {"left", "center", "right"}),  # so close that nothing is passed
        (person((0.45, 0.2, 0.55, 0.79)), {"center"}),
        (person(distance_m=PEOPLE.ahead_m), {"center"}),
        (person(distance_m=PEOPLE.ahead_m + 0.01), set()),
        (person(LEFT, distance_m=PEOPLE.slow_m), {"left"}),
        (person(LEFT, distance_m=PEOPLE.slow_m + 0.01), set()),
        (person(RIGHT, distance_m=PEOPLE.slow_m + 0.01), set()),
        (person(distance_m=PEOPLE.stop_m), {"left", "center", "right"}),
        (person(is_ashore=True), set()),
        (person(is_person=False), set()),
        (person(is_person=False, candidate=2), {"center"}),
        (person(is_confirmed=False, presence=0.5), {"center"}),
        (person(is_confirmed=False, presence=0.49), set()),
        (person(is_confirmed=True, presence=0.01), {"center"}),
    ],
)
def test_a_person_blocks_these_corridors(obstacle: Obstacle, lanes: set[str]) -> None:
    assert blocked(obstacle) == lanes
    assert counts(obstacle) is bool(lanes or obstacle.distance_m)


def test_only_those_in_the_lane_are_named_and_the_paper_names_nobody() -> None:
    both = (person(LEFT), person(), person(RIGHT), person())
    assert people_in_lane("center", both, PAANI) == (1, 3)
    assert people_in_lane("center", both, PAPER) == ()
    assert speed_limit_mps(both, PAPER) is None


@pytest.mark.parametrize(
    ("obstacle", "stops"),
    [
        (person(distance_m=PEOPLE.stop_m), True),
        (person(distance_m=PEOPLE.stop_m + 0.01), False),
        (person((0.45, 0.0, 0.55, 1.0), distance_m=5.0), False),  # where the distance is known it decides
        (person((0.45, 0.25, 0.55, 0.85)), True),
        (person((0.45, 0.25, 0.55, 0.84)), False),
        (person(LEFT, distance_m=0.5), False),  # beside the way
        (person((0.45, 0.0, 0.55, 1.0), candidate=1), False),
        (person(distance_m=0.5, candidate=1), False),
    ],
)
def test_the_boat_stops_for_somebody_in_the_way_who_is_near(obstacle: Obstacle, stops: bool) -> None:
    assert is_close(obstacle, PAANI) is stops


@pytest.mark.parametrize(
    ("obstacle", "is_limited"),
    [
        (person(), True),
        (person(LEFT), True),  # anywhere in the picture
        (person(distance_m=PEOPLE.slow_m), True),
        (person(distance_m=PEOPLE.slow_m + 0.01), False),
        (person(is_ashore=True), False),
        (person(candidate=1), True),
        (person(LEFT, candidate=1), False),  # what may be a person counts in the way alone
    ],
)
def test_people_near_limit_the_speed(obstacle: Obstacle, is_limited: bool) -> None:
    limit = PEOPLE.slow_mps if is_limited else None
    assert speed_limit_mps((obstacle,), CALIBRATED) == limit
    assert speed_limit_mps((person(is_ashore=True), obstacle), CALIBRATED) == limit


@pytest.mark.parametrize(("slow_mps", "uncalibrated_mps"), [(0.3, 0.2), (0.2, 0.3)])
def test_an_uncalibrated_camera_is_never_followed_fast(slow_mps: float, uncalibrated_mps: float) -> None:
    """How far off anything is, nobody knows; the lower of both limits holds."""
    sets = [f"advisor.people.slow_mps={slow_mps}", f"advisor.people.uncalibrated_mps={uncalibrated_mps}"]
    config = load_config(sets=sets)
    assert speed_limit_mps((), config) == uncalibrated_mps
    assert speed_limit_mps((person(),), config) == 0.2
    measured = msgspec.structs.replace(config, calibration=CALIBRATED.calibration)
    assert speed_limit_mps((), measured) is None
    assert speed_limit_mps((person(),), measured) == slow_mps
    assert play([CLEAR], config)[1][0].speed_limit_mps == uncalibrated_mps
    assert play([CLEAR], measured)[1][0].speed_limit_mps is msgspec.UNSET


@given(FRAMES, st.booleans(), st.sampled_from(["open", "paper"]))
def test_by_weights_that_are_not_the_full_ones_no_advice_is_followed_fast(
    frame: m.Evidence, is_paper: bool, weights: str
) -> None:
    config = PAPER if is_paper else CALIBRATED
    chosen = msgspec.structs.replace(config, perception=msgspec.structs.replace(config.perception, weights=weights))
    advisory = play([frame], chosen)[1][0]
    assert isinstance(advisory.speed_limit_mps, float)
    assert advisory.speed_limit_mps <= PAANI.advisor.people.uncalibrated_mps
    assert advisory.direction is play([frame], config)[1][0].direction


def test_the_nearest_is_the_least_known_distance() -> None:
    crowd = (person(distance_m=9.0), person(), person(distance_m=4.0), person(distance_m=2.0))
    assert nearest_ahead_m(crowd, (0, 1, 2)) == 4.0
    assert nearest_ahead_m(crowd, (1,)) is None
    assert nearest_ahead_m(crowd, ()) is None
