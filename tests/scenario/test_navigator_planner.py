"""The metric planner in the navigator: advice stays the veto, and without a calibration nothing changes (Q1-Q6)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import keys
from paani.config import load_config
from paani.decider import Input
from paani.messages import (
    Advisory,
    Arming,
    Direction,
    Evidence,
    Inhibit,
    LaneRisk,
    NavCommand,
    Odometry,
    Purpose,
    Reason,
    Route,
    SimTime,
    Waypoint,
)
from paani.missions import mission_of_route
from paani_services.navigator.avoidance.rollout import PIVOT_SPEED_FRACTION
from paani_services.navigator.decide import DECIDER
from paani_services.navigator.interlocks import NavigatorInputs
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.mapping.occupancy_grid import UNCALIBRATED_CAMERA
from paani_services.navigator.navigate import NavigatorState, navigate
from paani_sim.eye.camera import BoatPose
from tests.synthetic_water import AT_REST, CAMERA, START_US, Bar, distance_to_bar_m, evidence, odometry, water_edge_of

CONFIG = load_config().navigator
PAPER = load_config(profile="paper").navigator
EAST = Route(source_us=0, name="east", waypoints=(Waypoint(x_m=-5, y_m=0), Waypoint(x_m=60, y_m=0)), repeat=False)
STEP_US = 200_000
YAW_RATE_RADPS = 0.35


class Pool:
    """A boat on flat water that follows its orders, with 5 pictures and orders a second."""

    def __init__(self, *bars: Bar, bank_m: float = 500.0, boat: BoatPose = AT_REST, camera: Camera = CAMERA) -> None:
        self.bars, self.bank_m, self.boat, self.camera = bars, bank_m, boat, camera
        self.state, self.now_us, self.speed_mps = NavigatorState(), START_US, 0.0
        self.direction, self.looks, self.shut_in = Direction.STRAIGHT, True, False
        self.config = CONFIG
        self.order: NavCommand | None = None
        self.newest_evidence: Evidence | None = None

    def run(self, seconds: float) -> Iterator[NavCommand]:
        for _ in range(round(seconds * 5)):
            self.now_us += STEP_US
            self._drift()
            if self.looks:
                self.newest_evidence = evidence(self.now_us, water_edge_of(self.boat, self.bars, self.bank_m))
            side = LaneRisk(blocked=self.shut_in)
            advisory = Advisory(
                source_us=self.now_us, direction=self.direction, reason=Reason.CENTER_CLEAR, left=side, right=side
            )
            heard = self.heard(advisory, odometry(self.now_us, self.boat, self.speed_mps))
            self.state, self.order = navigate(
                self.state, heard, mission_of_route(EAST), self.now_us, 43, self.config, self.camera
            )
            yield self.order

    def heard(self, advisory: Advisory, at: Odometry) -> NavigatorInputs:
        """All of it fresh, the boat armed."""
        return NavigatorInputs(
            advisory=advisory,
            advisory_us=self.now_us,
            odometry=at,
            odometry_us=self.now_us,
            clock=SimTime(source_us=self.now_us, sim_us=self.now_us, stamp_us=1),
            clock_us=self.now_us,
            arming=Arming(source_us=self.now_us, armed=True),
            arming_us=self.now_us,
            evidence=self.newest_evidence,
        )

    def settle(self, seconds: float) -> NavCommand:
        *_, last = self.run(seconds)
        return last

    def _drift(self) -> None:
        """Speed follows the order within 0.3 m/s2, heading by 0.35 rad/s at most: it can turn on the spot."""
        dt = STEP_US * 1e-6
        wanted = self.order.speed_mps if self.order is not None else 0.0
        self.speed_mps += max(-0.3 * dt, min(0.3 * dt, wanted - self.speed_mps))
        turn = 0.0
        if self.order is not None and self.order.enable:
            off = (self.order.heading_rad - self.boat.yaw_rad + math.pi) % (2.0 * math.pi) - math.pi
            turn = max(-YAW_RATE_RADPS, min(YAW_RATE_RADPS, off))
        yaw = self.boat.yaw_rad + turn * dt
        way = self.speed_mps * dt
        self.boat = BoatPose(self.boat.x_m + way * math.cos(yaw), self.boat.y_m + way * math.sin(yaw), yaw)

    def gap_m(self) -> float:
        """From the boat's middle to the nearest bar."""
        return min((distance_to_bar_m(self.boat.x_m, self.boat.y_m, bar) for bar in self.bars), default=math.inf)


def test_open_water_is_sailed_as_without_a_planner() -> None:
    """Course and speed are the same where there is no obstacle."""
    with_planner, without = Pool(), Pool(camera=UNCALIBRATED_CAMERA)
    for one, other in zip(with_planner.run(12.0), without.run(12.0), strict=True):
        if other.enable and with_planner.now_us > START_US + 300_000:
            assert one.enable
            assert one.speed_mps == other.speed_mps
            assert one.heading_rad == pytest.approx(other.heading_rad, abs=math.radians(3.0))
    assert with_planner.boat.x_m > 5.0


@settings(max_examples=25, deadline=None)
@given(
    direction=st.sampled_from([Direction.STOP, Direction.NO_DATA]),
    bars=st.lists(st.tuples(st.floats(2.0, 6.0), st.floats(-2.0, 1.0)), max_size=2),
    bank_m=st.floats(1.5, 500.0),
    yaw=st.floats(-3.1, 3.1),
    warm=st.booleans(),
)
def test_the_planner_never_moves_the_boat_where_the_advice_says_stop(
    direction: Direction, bars: list[tuple[float, float]], bank_m: float, yaw: float, warm: bool
) -> None:
    """The advice is a veto: STOP and NO_DATA stop the boat, with a plan in force or without."""
    pool = Pool(*((x, y, x + 0.5, y + 1.0) for x, y in bars), bank_m=bank_m, boat=BoatPose(0.0, 0.0, yaw))
    if warm:
        pool.settle(0.6)
    pool.direction = direction
    for order in pool.run(0.6):
        assert (order.enable, order.speed_mps) == (False, 0.0)


@pytest.mark.parametrize("turn", [Direction.LEFT, Direction.SLIGHT_LEFT, Direction.RIGHT, Direction.SLIGHT_RIGHT])
def test_turn_advice_halves_the_speed_and_leans_to_its_side(turn: Direction) -> None:
    """In open water the course is the route's, or lies to its advised side; M7 for the speed."""
    side = 1.0 if turn in {Direction.LEFT, Direction.SLIGHT_LEFT} else -1.0
    pool = Pool()
    pool.direction = turn
    for order in pool.run(1.5):
        assert not order.enable or order.speed_mps <= 0.5 * CONFIG.cruise_mps
        assert side * order.heading_rad >= -1e-9


@pytest.mark.parametrize(
    ("changes", "escape_mps"),
    [
        ({"purpose": Purpose.PASS}, CONFIG.escape_factor * CONFIG.cruise_mps),
        ({"purpose": Purpose.PASS, "speed_limit_mps": 0.3}, 0.3),
        ({"purpose": Purpose.LOOK}, 0.0),
    ],
    ids=["nobody near", "somebody near", "looking"],
)
def test_an_escape_may_be_faster_than_the_course_but_not_than_is_allowed_near_people(
    changes: dict[str, Any], escape_mps: float
) -> None:
    """It is not halved as an advised turn is (M7); where the boat is to look from where it is, there is none."""
    pool = Pool()
    pool.settle(0.6)
    turn = Advisory(source_us=pool.now_us, direction=Direction.LEFT, reason=Reason.CENTER_CLEAR, **changes)
    heard = pool.heard(turn, odometry(pool.now_us, pool.boat, pool.speed_mps))
    state, _ = navigate(pool.state, heard, mission_of_route(EAST), pool.now_us, 43, CONFIG, CAMERA)
    basis = state.planner_state.basis
    assert basis is not None
    assert basis.speed_mps == 0.5 * min(CONFIG.cruise_mps, turn.speed_limit_mps or math.inf)
    assert basis.escape_mps == escape_mps


@pytest.mark.parametrize("direction", list(Direction))
def test_without_a_valid_calibration_the_planner_refuses_to_act(direction: Direction) -> None:
    """The orders are those of the heading heuristic, to the byte, whatever the pictures show."""
    blocked, unseen = Pool(bank_m=1.5, camera=UNCALIBRATED_CAMERA), Pool(camera=UNCALIBRATED_CAMERA)
    unseen.looks = False
    blocked.direction = unseen.direction = direction
    for one, other in zip(blocked.run(2.0), unseen.run(2.0), strict=True):
        assert msgspec.json.encode(one) == msgspec.json.encode(other)


def test_the_decider_passes_evidence_and_calibration_to_the_planner() -> None:
    """Evidence is an input of the recorded step, so that a planned order can be replayed."""
    config = load_config()
    seeing = msgspec.structs.replace(config, calibration=CAMERA.calibration)
    inputs = {topic.name: Input() for topic in DECIDER.inputs}
    newest = evidence(START_US, water_edge_of(AT_REST))
    inputs |= {keys.EVIDENCE.name: Input(newest), keys.ODOMETRY.name: Input(odometry(START_US, AT_REST), START_US)}
    observations = [
        DECIDER.decide(NavigatorState(), inputs, START_US, c)[0].planner_state.memory.observations
        for c in (seeing, config)
    ]
    assert [len(each) for each in observations] == [1, 0]


def test_the_paper_profile_has_no_planner() -> None:
    """The paper evaluated none: a calibration alone does not turn it on."""
    assert not PAPER.planner.use


def test_unknown_water_is_not_entered() -> None:
    """Without pictures, or after they end, the reason is NO_FREE_PATH; before a wall the boat comes no nearer."""
    pool = Pool()
    pool.looks = False
    assert pool.settle(1.0).inhibits == (Inhibit.NO_FREE_PATH,)
    walled = Pool((1.6, -40.0, 2.6, 40.0))
    walled.settle(20.0)
    assert walled.boat.x_m < 0.2
    pool.looks = True
    assert pool.settle(2.0).enable
    pool.looks = False
    assert pool.settle(1.2).speed_mps == 0.0
    assert pool.settle(CONFIG.planner.brake_s).inhibits == (Inhibit.NO_FREE_PATH,)


def test_a_bar_on_the_route_is_passed_and_the_route_rejoined() -> None:
    """The advice is STRAIGHT throughout: the planner goes round the bar, and back to the same leg."""
    pool = Pool((6.0, -0.6, 6.8, 0.4))
    nearest = math.inf
    aside = 0.0
    for order in pool.run(60.0):
        nearest = min(nearest, pool.gap_m())
        aside = max(aside, abs(pool.boat.y_m))
        assert not order.enable or order.waypoint_index == 1
    assert nearest > 0.6
    assert 0.8 < aside < 4.0
    assert pool.boat.x_m > 14.0
    assert abs(pool.boat.y_m) < 0.4


def test_a_boat_before_a_wall_turns_along_it() -> None:
    """A quay lies across the route, free at its left end: with STRAIGHT advice the boat passes without contact."""
    pool = Pool((6.0, -30.0, 7.0, 2.5))
    nearest = math.inf
    for _ in pool.run(40.0):
        nearest = min(nearest, pool.gap_m())
    assert nearest > 0.6
    assert pool.boat.x_m > 7.0


def test_a_boat_waits_in_a_dead_end_until_it_opens() -> None:
    """It looks for no way round it here."""
    pool = Pool((4.0, -30.0, 5.0, 30.0))
    pool.config = msgspec.structs.replace(CONFIG, planner=msgspec.structs.replace(CONFIG.planner, barred_s=0.0))
    last = pool.settle(50.0)  # it sails along the bar first, slowly
    assert last.halt_reasons == (Inhibit.NO_FREE_PATH,)
    assert pool.gap_m() > 0.6
    pool.bars = ()
    assert pool.settle(21.5).speed_mps > 0.0


def test_a_boat_under_way_brakes_before_it_gives_up() -> None:
    """Pictures end: the boat is ordered to stop for `brake_s`, and then gets no thrust."""
    pool = Pool()
    moving = pool.settle(6.0)
    assert moving.enable
    assert pool.speed_mps == pytest.approx(0.6)
    pool.looks = False
    orders = [order for order in pool.run(4.0) if order.speed_mps == 0.0]
    braked = [order.enable for order in orders]
    assert braked == sorted(braked, reverse=True)
    assert sum(braked) * STEP_US * 1e-6 == pytest.approx(CONFIG.planner.brake_s, abs=0.2)
    assert orders[-1].inhibits == (Inhibit.NO_FREE_PATH,)


def test_a_boat_at_rest_has_nothing_to_brake() -> None:
    """Without pictures from the start no order is enabled, whatever the boat drifts at."""
    pool = Pool()
    pool.looks, pool.speed_mps = False, 0.09
    assert not any(order.enable for order in pool.run(2.0))


def test_a_boat_that_cannot_brake_gives_up_at_once() -> None:
    fans = load_config(profile="fans").navigator
    assert fans.planner.brake_s == 0.0


def test_a_stuck_detection_does_not_spin_the_boat() -> None:
    """Without the planner the turn ends at 90 degrees; with it the boat keeps to its route, whatever is advised."""
    for camera, high_deg in ((UNCALIBRATED_CAMERA, 97.0), (CAMERA, 45.0)):
        pool = Pool(camera=camera)
        pool.settle(3.0)
        pool.direction = Direction.LEFT
        turned = [math.degrees(pool.boat.yaw_rad) for _ in pool.run(42.0)]
        assert max(map(abs, turned)) < high_deg


@pytest.mark.parametrize("turn", [Direction.LEFT, Direction.RIGHT])
def test_a_turn_to_a_blocked_side_is_a_pivot(turn: Direction) -> None:
    """It is advised when no side has been free for long: the boat looks there without going, nor spinning for ever."""
    pool = Pool((4.0, -2.0, 5.0, 2.0))
    pool.direction, pool.shut_in = turn, True
    ordered = [order.speed_mps for order in pool.run(60.0)]
    assert max(ordered) <= PIVOT_SPEED_FRACTION * CONFIG.cruise_mps
    assert math.hypot(pool.boat.x_m, pool.boat.y_m) < 0.3
    side = 1.0 if turn is Direction.LEFT else -1.0
    assert math.radians(60.0) < side * pool.boat.yaw_rad <= math.radians(CONFIG.planner.span_deg + 1.0)
    assert ordered[-1] == 0.0


def test_a_boat_without_room_does_not_pivot_to_look() -> None:
    """The map overrides the advice: cells that the hull would sweep must be free."""
    pool = Pool(bank_m=0.9)
    pool.direction, pool.shut_in = Direction.LEFT, True
    assert all(order.halt_reasons for order in pool.run(3.0))
    assert pool.boat == AT_REST


def test_with_a_map_an_occupied_side_does_not_delay_the_return() -> None:
    """The map remembers what was passed, so the boat need not go on for `clear_m` before it returns to its route."""
    advisory = Advisory(
        source_us=START_US, direction=Direction.STRAIGHT, reason=Reason.CENTER_CLEAR, right=LaneRisk(occupied=True)
    )
    for camera, steers in ((CAMERA, True), (UNCALIBRATED_CAMERA, False)):
        pool = Pool(boat=BoatPose(0.0, 2.0, 0.0), camera=camera)
        pool.settle(1.0)
        heard = pool.heard(
            msgspec.structs.replace(advisory, source_us=pool.now_us), odometry(pool.now_us, BoatPose(0.0, 2.0, 0.0))
        )
        _, order = navigate(pool.state, heard, mission_of_route(EAST), pool.now_us, 43, CONFIG, camera)
        assert (order.heading_rad < -0.1) is steers


def test_the_state_is_small_and_loses_nothing_as_json() -> None:
    """A recorded state continues as the live one did, and takes less than 12 kB of the recording every 2 s."""
    pool = Pool((10.0, -0.6, 10.8, 0.4))
    pool.settle(9.0)
    data = msgspec.json.encode(pool.state)
    assert len(data) < 12_000
    again = Pool((10.0, -0.6, 10.8, 0.4), boat=pool.boat)
    again.state, again.now_us, again.speed_mps = (
        msgspec.json.decode(data, type=NavigatorState),
        pool.now_us,
        pool.speed_mps,
    )
    again.order, again.newest_evidence = pool.order, pool.newest_evidence
    assert again.state == pool.state
    for one, other in zip(pool.run(3.0), again.run(3.0), strict=True):
        assert msgspec.json.encode(one) == msgspec.json.encode(other)
