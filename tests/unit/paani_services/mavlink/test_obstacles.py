"""OBSTACLE_DISTANCE: where moving obstacles are, and that the rest is not called free. COLLISION: the one to mind."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from pymavlink.dialects.v20 import common

from paani import messages as m
from paani_services.mavlink.codec import Codec
from paani_services.mavlink.obstacles import FIRST_ID, MAX_DISTANCE_M, SECTORS, collision, obstacle_distance, sectors_of
from tests.mavlink_peer import NOW_US, in_order, odometry

UNKNOWN = 0xFFFF


def obstacle(x_m: float, y_m: float, radius_m: float = 0.5) -> m.MovingObstacle:
    return m.MovingObstacle(track_id=3, x_m=x_m, y_m=y_m, radius_m=radius_m, east_mps=0.0, north_mps=0.0)


def sent(*obstacles: m.MovingObstacle, **pose: Any) -> Any:
    """The message as a station reads it, of a boat at (10, 20) that heads east unless it is said otherwise."""
    snapshot = in_order(
        odometry=odometry(**{"yaw_rad": 0.0, **pose}), prediction=m.Prediction(source_us=NOW_US, obstacles=obstacles)
    )
    (message,) = common.MAVLink(None).parse_buffer(Codec(0, None).encode(obstacle_distance(snapshot), NOW_US))
    return message


@pytest.mark.parametrize(
    ("x_m", "y_m", "sector"),
    [
        (30.0, 20.0, 0),  # ahead
        (10.0, 0.0, 18),  # to starboard, a quarter clockwise
        (-10.0, 20.0, 36),  # astern
        (10.0, 40.0, 54),  # to port
    ],
)
def test_sectors_go_clockwise_from_the_bow(x_m: float, y_m: float, sector: int) -> None:
    message = sent(obstacle(x_m, y_m))
    assert message.distances[sector] == 1950
    assert message.distances[(sector + 2) % SECTORS] == UNKNOWN
    assert (message.increment, message.frame, message.max_distance) == (5, common.MAV_FRAME_BODY_FRD, 10_000)


def test_sectors_turn_with_the_boat() -> None:
    assert sent(obstacle(30.0, 20.0), yaw_rad=math.pi / 2).distances[18] == 1950  # east is to starboard of north


def test_without_obstacles_nothing_is_called_free() -> None:
    assert set(sent().distances) == {UNKNOWN}
    assert set(sent(obstacle(10.0 + MAX_DISTANCE_M + 1.0, 20.0)).distances) == {UNKNOWN}


def test_of_two_in_a_line_the_nearer_counts() -> None:
    assert sent(obstacle(50.0, 20.0), obstacle(30.0, 20.0), obstacle(60.0, 20.0)).distances[0] == 1950


def test_a_boat_inside_an_obstacle_has_it_everywhere() -> None:
    assert set(sent(obstacle(10.2, 20.0)).distances) == {0}


@pytest.mark.parametrize("unknown", [{"odometry": None}, {"odometry": odometry(healthy=False)}, {"prediction": None}])
def test_what_is_not_known_is_not_sent(unknown: dict[str, Any]) -> None:
    assert obstacle_distance(in_order(**{"prediction": m.Prediction(source_us=NOW_US), **unknown})) is None


def approaching(track_id: int, **fields: Any) -> m.MovingObstacle:
    return replace(obstacle(0.0, 0.0), track_id=track_id, **fields)


def sent_collision(*obstacles: m.MovingObstacle) -> Any:
    """COLLISION as a station reads it; None where there is none."""
    message = collision(in_order(prediction=m.Prediction(source_us=NOW_US, obstacles=obstacles)))
    return None if message is None else common.MAVLink(None).parse_buffer(Codec(0, None).encode(message, NOW_US))[0]


def test_of_those_that_come_nearer_the_one_that_comes_nearest_is_told() -> None:
    past, near = approaching(1, cpa_m=0.5, tcpa_s=0.0), approaching(2, cpa_m=4.0, tcpa_s=9.0)
    far = approaching(3, cpa_m=20.0, tcpa_s=1.0)
    message = sent_collision(past, far, near, approaching(4))
    assert (message.id, message.horizontal_minimum_delta, message.time_to_minimum_delta) == (FIRST_ID + 2, 4.0, 9.0)
    assert message.action == common.MAV_COLLISION_ACTION_REPORT
    assert message.threat_level == common.MAV_COLLISION_THREAT_LEVEL_LOW


def test_the_threat_is_high_while_the_navigator_finds_it_too_near() -> None:
    message = sent_collision(approaching(2, cpa_m=1.0, tcpa_s=5.0, encounter=m.EncounterClass.HEAD_ON))
    assert message.threat_level == common.MAV_COLLISION_THREAT_LEVEL_HIGH


def test_without_anything_that_comes_nearer_nothing_is_told() -> None:
    assert sent_collision() is None
    assert sent_collision(approaching(1, cpa_m=0.5, tcpa_s=0.0), approaching(2)) is None
    assert collision(in_order(prediction=None)) is None


@given(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0), st.floats(0.0, 8.0), st.floats(-7.0, 7.0))
@pytest.mark.slow
def test_the_obstacles_middle_and_edges_lie_in_its_sectors(x_m: float, y_m: float, radius_m: float, yaw: float) -> None:
    pose = odometry(yaw_rad=yaw)
    distance_m, sectors = sectors_of(obstacle(x_m, y_m, radius_m), pose)
    east_m, north_m = x_m - pose.x_m, y_m - pose.y_m
    assert distance_m == pytest.approx(max(0.0, math.hypot(east_m, north_m) - radius_m))
    assert len(sectors) == len(set(sectors)) <= SECTORS
    clockwise_deg = math.degrees(yaw - math.atan2(north_m, east_m)) % 360.0
    offset_deg = min(abs((clockwise_deg - 5.0 * sector + 180.0) % 360.0 - 180.0) for sector in sectors)
    assert offset_deg <= 2.5 + 1e-6
