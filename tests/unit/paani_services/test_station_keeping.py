"""A boat that the advice stops, or that has no path, is held where it stopped: when thrust may do so, and how."""

from __future__ import annotations

import math

import msgspec
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import Config, ControllerConfig, load_config
from paani.geometry import wrap_rad
from paani.messages import Direction, Inhibit
from paani_services.advisor.advise import advise
from paani_services.advisor.people import may_keep_station, nobody_near_s
from paani_services.advisor.risk import Obstacle
from paani_services.controller.control import ControllerInputs, ControllerState, compute_thrust
from paani_services.navigator.avoidance.rollout import BoatState, GuidanceSetpoint
from paani_services.navigator.guidance.station_keeping import (
    AT_STATION_M,
    LEAD_S,
    LOST_M,
    RESUME_S,
    RETURN_PER_S,
    Station,
    hold_station,
    take_station,
)
from paani_services.navigator.mapping.water_map import map_water
from paani_services.navigator.navigate import navigate
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import (
    CAMERA,
    PLANNER,
    detection_of,
    evidence,
    observe_then_look_astern,
    request_on,
    water_edge_of,
)
from tests.unit.paani_services.advisor.advisor_evidence import CALIBRATED, CLEAR, PAPER, play
from tests.unit.paani_services.advisor.test_people import AHEAD, FRAMES, LEFT, person
from tests.unit.paani_services.navigator.test_interlocks import MISSION, halt, planned
from tests.unit.paani_services.navigator.test_navigate import NOW_US, RUNNING, advice, inputs, pose

CONTROLLER, NAVIGATOR = load_config().controller, load_config().navigator
PEOPLE = CALIBRATED.advisor.people
STOP_M = PEOPLE.stop_m
LAND = m.LaneEvidence(non_water=1.0, uncertainty=0.8, clear_width=0.0)
LAND_ALL_ROUND = msgspec.structs.replace(CLEAR, left=LAND, center=LAND, right=LAND)
DOUBTED = (m.UnusableCause.FILLED, m.UnusableCause.NO_WATER, m.UnusableCause.NO_HORIZON)
BROKEN = tuple(cause for cause in m.UnusableCause if cause not in (*DOUBTED, m.UnusableCause.NONE))
AFTER_S = 1.0  # between two pictures
STOPPED = msgspec.structs.replace(advice(Direction.STOP), reason=m.Reason.NO_SAFE_SIDE, may_keep_station=True)


@given(FRAMES, st.booleans())
def test_only_a_stop_for_what_lies_on_the_water_allows_it(frame: m.Evidence, is_calibrated: bool) -> None:
    advisory = play([frame], CALIBRATED if is_calibrated else load_config())[1][0]
    is_for_water = advisory.reason in {m.Reason.NO_SAFE_SIDE, m.Reason.NO_SIDE_UNOCCUPIED}
    assert (advisory.may_keep_station is True) == (is_calibrated and is_for_water)
    assert not is_for_water or advisory.direction is Direction.STOP


def test_land_all_round_allows_it_until_the_picture_is_old_or_unfit_and_the_paper_never_does() -> None:
    state, (seen,), _ = play([LAND_ALL_ROUND], CALIBRATED)
    assert seen.may_keep_station is True
    _, old, _ = advise(state, None, seen.source_us + 60_000_000, CALIBRATED)
    assert (old.direction, old.reason, old.may_keep_station) == (Direction.STOP, m.Reason.STALE_EVIDENCE, msgspec.UNSET)
    black = msgspec.structs.replace(LAND_ALL_ROUND, usable=False, cause=m.UnusableCause.BLACK)
    assert play([LAND_ALL_ROUND, black], CALIBRATED)[1][-1].may_keep_station is msgspec.UNSET
    paper = msgspec.structs.replace(PAPER, calibration=CALIBRATED.calibration)
    stopped = play([LAND_ALL_ROUND], paper)[1][0]
    assert stopped.reason is m.Reason.NO_SAFE_SIDE
    assert b"may_keep_station" not in msgspec.json.encode(stopped)


@pytest.mark.parametrize(
    ("somebody", "may"),
    [
        (person(distance_m=STOP_M), False),
        (person(distance_m=STOP_M + 0.01), True),
        (person(LEFT, distance_m=STOP_M), False),  # anywhere in the picture
        (person(AHEAD), False),  # at no known distance
        (person(AHEAD, candidate=1), False),  # what may be a person counts as one
        (person(AHEAD, is_person=False, distance_m=0.5), True),
        (person(AHEAD, is_ashore=True, distance_m=0.5), True),
    ],
)
def test_nobody_may_be_near(somebody: Obstacle, may: bool) -> None:
    far_off = person(distance_m=12.0)
    assert may_keep_station(m.Reason.NO_SAFE_SIDE, (far_off, somebody), CALIBRATED) is may
    assert not may_keep_station(m.Reason.UNUSABLE_IMAGE, (far_off,), CALIBRATED)
    assert not may_keep_station(m.Reason.NO_SAFE_SIDE, (far_off,), load_config())


def unusable(cause: m.UnusableCause, *people: m.BoxXyxy) -> m.Evidence:
    """A picture that was looked at for people, though its evidence counts for nothing."""
    candidates = tuple(m.Candidate(kind=m.CandidateKind.UNSURE_BOX, confidence=0.5, box_xyxy=box) for box in people)
    return msgspec.structs.replace(
        CLEAR, usable=False, cause=cause, left=LAND, center=LAND, right=LAND, candidates=candidates
    )


def keeps(*frames: m.Evidence, config: Config = CALIBRATED) -> list[bool]:
    """Whether the station may be kept, for pictures that come a second apart."""
    return [each.may_keep_station is True for each in play(list(frames), config, AFTER_S)[1]]


@given(FRAMES, st.sampled_from(DOUBTED))
def test_a_doubted_view_keeps_the_station_until_somebody_unseen_may_have_come(
    frame: m.Evidence, cause: m.UnusableCause
) -> None:
    """Whatever the last fit picture advised, as nobody was in it; the unseen swim from where sight ends."""
    lasts_s = (PEOPLE.ahead_m - STOP_M) / PEOPLE.swim_mps
    count = math.ceil(lasts_s / AFTER_S) + 2
    _, advice, _ = play([frame] + [unusable(cause)] * count, CALIBRATED, AFTER_S)
    for number, advisory in enumerate(advice[1:], 1):
        assert (advisory.direction, advisory.reason) == (Direction.STOP, m.Reason.UNUSABLE_IMAGE)
        assert (advisory.may_keep_station is True) == (number * AFTER_S < lasts_s)


@given(st.floats(STOP_M, PEOPLE.ahead_m))
def test_the_nearer_somebody_was_the_shorter_it_lasts(distance_m: float) -> None:
    lasts_s = nobody_near_s((person(distance_m=PEOPLE.ahead_m), person(distance_m=distance_m)), CALIBRATED)
    assert lasts_s == pytest.approx((distance_m - STOP_M) / PEOPLE.swim_mps)
    assert lasts_s <= nobody_near_s((), CALIBRATED)


@pytest.mark.parametrize("broken", BROKEN)
def test_a_camera_that_is_broken_ends_it_and_no_doubted_view_begins_it_anew(broken: m.UnusableCause) -> None:
    doubted = unusable(m.UnusableCause.FILLED)
    assert keeps(CLEAR, doubted, unusable(broken), doubted) == [False, True, False, False]
    assert keeps(doubted, doubted) == [False, False], "nothing was seen before"


def test_a_doubted_view_keeps_no_station_where_anything_else_is_unknown() -> None:
    doubted = unusable(m.UnusableCause.FILLED)
    restarted = msgspec.structs.replace(doubted, frame_epoch=2)
    unasked = msgspec.structs.replace(doubted, candidates=msgspec.UNSET)
    malformed = msgspec.structs.replace(doubted, left=msgspec.structs.replace(LAND, non_water=math.nan))
    for other in (restarted, unasked, malformed):
        assert keeps(CLEAR, other, doubted)[1:] == [False, False]
    assert keeps(CLEAR, doubted, config=load_config()) == [False, False], "without a calibration"
    paper = msgspec.structs.replace(PAPER, calibration=CALIBRATED.calibration)
    assert keeps(CLEAR, doubted, config=paper) == [False, False]
    state, _, _ = play([CLEAR, doubted], CALIBRATED)
    assert state.evidence is not None
    _, old, _ = advise(state, None, state.evidence.source_us + 60_000_000, CALIBRATED)
    assert (old.reason, old.may_keep_station) == (m.Reason.STALE_EVIDENCE, msgspec.UNSET)


def test_whoever_may_be_in_a_doubted_picture_or_was_near_before_it_ends_it() -> None:
    near, far = (0.45, 0.60, 0.55, 1.0), (0.48, 0.44, 0.52, 0.52)
    assert keeps(CLEAR, unusable(m.UnusableCause.FILLED, near)) == [False, False]
    assert keeps(CLEAR, unusable(m.UnusableCause.FILLED, far)) == [False, True]
    swimmer = msgspec.structs.replace(
        CLEAR, detections=(m.Detection(label=m.Label.PERSON, confidence=0.9, box_xyxy=near),)
    )
    assert keeps(swimmer, unusable(m.UnusableCause.FILLED)) == [False, False]


@pytest.mark.parametrize("reason", [m.Reason.NO_SAFE_SIDE, m.Reason.UNUSABLE_IMAGE])
def test_an_order_that_keeps_the_station_asks_for_no_speed_and_names_its_veto(reason: m.Reason) -> None:
    advisory = msgspec.structs.replace(STOPPED, reason=reason)
    given_inputs = inputs(advisory=advisory, odometry=pose(3.0, 0.0, 0.4))
    _, order = navigate(RUNNING, given_inputs, MISSION, NOW_US, 43, NAVIGATOR, CAMERA)
    assert (order.enable, order.keeps_station, order.inhibits) == (True, True, ())
    assert (order.speed_mps, order.astern_mps) == (0.0, 0.0)
    assert order.heading_rad == pytest.approx(0.4)
    assert (order.vetoes, order.direction) == ((Inhibit.ADVISED_STOP,), Direction.STOP)


METRES, SPEED, ANGLE = st.floats(-LOST_M, LOST_M), st.floats(-0.6, 0.6), st.floats(-math.pi, math.pi)


@given(METRES, METRES, ANGLE, SPEED, SPEED)
def test_a_boat_goes_back_astern_alone_and_only_nearer_to_its_station(
    x_m: float, y_m: float, yaw_rad: float, surge_mps: float, sway_mps: float
) -> None:
    """Wherever it was carried: what it makes in a tenth of a second brings it nearer, or is nothing."""
    at = msgspec.structs.replace(pose(0.0, 0.0, yaw_rad), surge_mps=surge_mps, sway_mps=sway_mps)
    order = hold_station(Station(0, 0, 0.0, 0.0), (x_m, y_m), at)
    assert 0.0 <= order.astern_mps <= m.STATION_ASTERN_MPS
    way_m = 0.1 * order.astern_mps
    after_m = math.hypot(x_m - way_m * math.cos(yaw_rad), y_m - way_m * math.sin(yaw_rad))
    assert after_m <= math.hypot(x_m, y_m) + 1e-9
    off_the_stern_rad = wrap_rad(math.atan2(-y_m, -x_m) - yaw_rad - math.pi)
    assert order.astern_mps == 0.0 or abs(off_the_stern_rad) < math.radians(45.001), "over water that it has not come"


@given(METRES, METRES, ANGLE, SPEED, SPEED)
def test_the_bow_is_turned_to_where_the_boat_is_carried_and_a_boat_at_rest_is_not_turned(
    x_m: float, y_m: float, yaw_rad: float, surge_mps: float, sway_mps: float
) -> None:
    adrift = msgspec.structs.replace(pose(0.0, 0.0, yaw_rad), surge_mps=surge_mps, sway_mps=sway_mps)
    there = Station(0, 0, 0.0, 0.0)
    turned, resting = (hold_station(there, (x_m, y_m), each).heading_rad
                       for each in (adrift, msgspec.structs.replace(adrift, stopped=True)))  # fmt: skip
    assert resting == yaw_rad
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    soon_m = (x_m + LEAD_S * (surge_mps * cos - sway_mps * sin), y_m + LEAD_S * (surge_mps * sin + sway_mps * cos))
    off_m = math.hypot(*soon_m)
    wanted_rad = math.atan2(soon_m[1], soon_m[0]) if off_m > AT_STATION_M + 1e-9 else yaw_rad
    assume(abs(off_m - AT_STATION_M) > 1e-6)
    assert math.cos(turned - wanted_rad) == pytest.approx(1.0)


BRAKE_US = round(NAVIGATOR.planner.brake_s * 1e6)


def test_the_station_is_where_the_boat_has_braked_until_it_is_lost() -> None:
    station = take_station(None, (0.0, 0.0), NOW_US, NAVIGATOR)
    braking = take_station(station, (0.5, 0.0), NOW_US + BRAKE_US - 1, NAVIGATOR)
    assert braking == Station(NOW_US, NOW_US + BRAKE_US - 1, 0.5, 0.0)
    kept = take_station(braking, (0.5, LOST_M), NOW_US + BRAKE_US, NAVIGATOR)
    assert kept == Station(NOW_US, NOW_US + BRAKE_US, 0.5, 0.0)
    after_us = NOW_US + BRAKE_US + 1
    assert take_station(kept, (0.5, LOST_M + 0.01), after_us, NAVIGATOR) == Station(
        after_us, after_us, 0.5, LOST_M + 0.01
    )


def test_a_boat_that_stops_again_soon_goes_back_and_later_has_another_place() -> None:
    station, resume_us = Station(NOW_US - 9_000_000, NOW_US, 0.5, 0.0), round(RESUME_S * 1e6)
    again = take_station(station, (0.9, 0.0), NOW_US + resume_us - 1, NAVIGATOR)
    assert again == msgspec.structs.replace(station, stopped_us=NOW_US + resume_us - 1)
    for other_us in (NOW_US + resume_us, NOW_US - 1):  # later, and before by a clock that was set back
        assert take_station(station, (0.9, 0.0), other_us, NAVIGATOR) == Station(other_us, other_us, 0.9, 0.0)


def test_a_boat_that_is_carried_on_is_ordered_back() -> None:
    """At 0.2 m/s ahead for 4 s: 0.5 m beyond where it should have braked."""
    state, order = RUNNING, KEEPING
    for now_us in range(NOW_US, NOW_US + 4_000_001, 100_000):
        carried = msgspec.structs.replace(pose(3.0, 0.0, source_us=now_us), surge_mps=0.2)
        advisory = msgspec.structs.replace(STOPPED, source_us=now_us)
        given_inputs = inputs(now_us, advisory=advisory, odometry=carried)
        state, order = navigate(state, given_inputs, MISSION, now_us, 43, NAVIGATOR, CAMERA)
    way_m = 0.2 * (4.0 - NAVIGATOR.planner.brake_s)
    assert order.astern_mps == pytest.approx(RETURN_PER_S * way_m, abs=0.2 * RETURN_PER_S * 0.1 + 1e-9)
    assert order.heading_rad == pytest.approx(0.0)


LATER_US = NOW_US + 100_000


@pytest.mark.parametrize(
    ("changes", "stopped_us"),
    [
        ({}, LATER_US),
        ({"advisory": advice(Direction.STRAIGHT, LATER_US)}, NOW_US),
        ({"arming": m.Arming(source_us=LATER_US, armed=False)}, None),
        ({"odometry": pose(3.0, 0.0, source_us=LATER_US - 60_000_000)}, None),
        ({"odometry": msgspec.structs.replace(pose(3.0, 0.0, source_us=LATER_US), healthy=False)}, None),
        ({"odometry": None}, None),
    ],
)
def test_a_boat_goes_back_to_no_place_of_before_anything_else_stopped_it(
    changes: dict[str, object], stopped_us: int | None
) -> None:
    """A place lies by dead reckoning, which has begun anew where the odometry was missing."""
    state, _ = navigate(RUNNING, inputs(advisory=STOPPED), MISSION, NOW_US, 43, NAVIGATOR, CAMERA)
    given_inputs = inputs(LATER_US, **({"advisory": msgspec.structs.replace(STOPPED, source_us=LATER_US)} | changes))
    after, _ = navigate(state, given_inputs, MISSION, LATER_US, 43, NAVIGATOR, CAMERA)
    assert (after.station.stopped_us if after.station is not None else None) == stopped_us


@pytest.mark.parametrize(
    "changes",
    [
        {"advisory": advice(Direction.STOP)},
        {"advisory": msgspec.structs.replace(STOPPED, may_keep_station=False)},
        {"advisory": msgspec.structs.replace(STOPPED, direction=Direction.NO_DATA)},
        {"advisory": msgspec.structs.replace(STOPPED, source_us=NOW_US - 60_000_000)},
        {"arming": m.Arming(source_us=NOW_US, armed=False)},
        {"arming": m.Arming(source_us=NOW_US, armed=True, stopped=True)},
        {"odometry": msgspec.structs.replace(pose(3.0, 0.0), healthy=False)},
        {"clock": None},
    ],
)
def test_whatever_else_forbids_motion_forbids_this_too(changes: dict[str, object]) -> None:
    given_inputs = inputs(**({"advisory": STOPPED} | changes))
    _, order = navigate(RUNNING, given_inputs, MISSION, NOW_US, 43, NAVIGATOR, CAMERA)
    assert (order.enable, order.keeps_station) == (False, False)
    assert order.inhibits


@pytest.mark.parametrize("off", ["navigator.keep_station=false", "navigator.planner.use=false"])
def test_it_can_be_switched_off_and_needs_the_planner(off: str) -> None:
    config = load_config(sets=[off]).navigator
    _, order = navigate(RUNNING, inputs(advisory=STOPPED), MISSION, NOW_US, 43, config, CAMERA)
    assert order.inhibits == (Inhibit.ADVISED_STOP,)
    _, order = navigate(RUNNING, inputs(advisory=STOPPED), MISSION, NOW_US, 43, NAVIGATOR)
    assert order.inhibits == (Inhibit.ADVISED_STOP,), "without a calibration"


KEEPING = m.NavCommand(
    source_us=NOW_US, enable=True, heading_rad=0.0, speed_mps=0.0, direction=Direction.STOP,
    vetoes=(Inhibit.ADVISED_STOP,), keeps_station=True,
)  # fmt: skip


def thrust_for(
    order: m.NavCommand, start: ControllerState, config: ControllerConfig = CONTROLLER, **motion: float
) -> m.Thrust:
    still = m.Odometry(source_us=NOW_US, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.0, healthy=True)
    at = msgspec.structs.replace(still, **motion)
    return compute_thrust(start, ControllerInputs(order, NOW_US, at, NOW_US), NOW_US, 43, config)[1]


ONLY_PUSHING = load_config(profile="fans").controller
FAN, PART = st.floats(-CONTROLLER.astern, 1.0), st.floats(-CONTROLLER.max_integral, CONTROLLER.max_integral)


@pytest.mark.parametrize("config", [CONTROLLER, ONLY_PUSHING])
@example(0.0, 0.0, 0.0, -0.15625, 0.0, 0.0, 0.125)  # too fast by less than the drag at the speed that is ordered
@given(
    FAN, FAN, PART, st.floats(-1.5, 1.5), st.floats(-math.pi, math.pi), st.floats(-2.0, 2.0),
    st.just(0.0) | st.floats(0.0, m.STATION_ASTERN_MPS),
)  # fmt: skip
def test_both_fans_together_never_push_the_boat_ahead_nor_beyond_the_speed_back_to_its_station(
    config: ControllerConfig,
    left: float,
    right: float,
    integral: float,
    surge_mps: float,
    heading_rad: float,
    rate_radps: float,
    astern_mps: float,
) -> None:
    """Whatever the fans did before, whatever turn is damped: at once, without waiting for the slew limit."""
    start = ControllerState(integral, max(left, -config.astern), max(right, -config.astern), NOW_US - 100_000)
    order = msgspec.structs.replace(KEEPING, heading_rad=heading_rad, astern_mps=astern_mps)
    thrust = thrust_for(order, start, config, surge_mps=surge_mps, yaw_rate_radps=rate_radps)
    assert thrust.enabled
    assert (thrust.left + thrust.right) * (surge_mps + astern_mps) <= 1e-9
    assert all(-config.astern <= fan <= 1.0 for fan in (thrust.left, thrust.right))


@pytest.mark.parametrize("surge_mps", [0.2, -0.2])
def test_a_boat_that_drifts_is_pushed_back(surge_mps: float) -> None:
    thrust = thrust_for(KEEPING, ControllerState(last_us=NOW_US - 100_000), surge_mps=surge_mps)
    assert thrust.left == pytest.approx(thrust.right)
    assert thrust.left * surge_mps < -1e-3


@pytest.mark.parametrize("changes", [{"speed_mps": 0.01}, {"astern_mps": 0.201}, {"vetoes": ()}])
def test_an_order_that_keeps_the_station_and_asks_for_more_is_invalid(changes: dict[str, object]) -> None:
    thrust = thrust_for(msgspec.structs.replace(KEEPING, **changes), ControllerState())
    assert (thrust.enabled, thrust.inhibits) == (False, (Inhibit.COMMAND_INVALID,))


def swimmer_at(distance_m: float) -> m.Detection:
    return detection_of((distance_m - 0.3, -0.3, distance_m + 0.3, 0.3), 0.4)


@pytest.mark.parametrize(
    ("changes", "keeps"),
    [
        ({}, True),
        ({"detections": (swimmer_at(STOP_M + 1.0),)}, True),
        ({"detections": (swimmer_at(STOP_M),)}, False),
        ({"usable": False}, False),
    ],
    ids=["open water", "somebody far off", "somebody near", "no fit picture"],
)
def test_without_a_path_a_picture_of_the_water_with_nobody_near_allows_it(
    changes: dict[str, object], *, keeps: bool
) -> None:
    picture = evidence(NOW_US, water_edge_of(BoatPose(3.0, 0.0, 0.0)), **changes)
    _, order = planned(halt, evidence=picture)
    assert (order.enable, order.keeps_station, order.halt_reasons) == (keeps, keeps, (Inhibit.NO_FREE_PATH,))
    assert order.speed_mps == 0.0


def test_without_a_path_and_without_the_setting_there_is_no_thrust() -> None:
    picture = evidence(NOW_US, water_edge_of(BoatPose(3.0, 0.0, 0.0)))
    at = msgspec.structs.replace(pose(3.0, 0.0), surge_mps=0.0)
    off = msgspec.structs.replace(NAVIGATOR, keep_station=False)
    _, order = navigate(RUNNING, inputs(odometry=at, evidence=picture), MISSION, NOW_US, 43, off, CAMERA, halt)
    assert (order.enable, order.inhibits) == (False, (Inhibit.NO_FREE_PATH,))


def test_whoever_was_seen_may_have_swum_nearer_out_of_sight() -> None:
    """4.7 m off and then astern of the picture: at 0.4 m/s nobody knows after 8 s that they are not within 1.5 m."""
    distances_m = []
    for seconds in (3.2, 8.0):
        memory, now_us = observe_then_look_astern(seconds, swimmer_at(5.0))
        grid, obstacles = map_water(memory.observations, (0.0, 0.0), now_us, CAMERA, PLANNER)
        request = request_on(grid, BoatState(0.0, 0.0, 0.0), GuidanceSetpoint(0.0, 0.6), obstacles=obstacles)
        distances_m.append(request.nearest_person_m())
    assert distances_m == pytest.approx([4.7 - 1.28, 4.7 - 3.2], abs=0.4)
