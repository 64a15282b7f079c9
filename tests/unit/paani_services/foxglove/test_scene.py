"""The scene: every thing where it is, in its frame, for as long as it is fresh."""

from __future__ import annotations

import math
from typing import Any

import pytest
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.config import CalibrationConfig, CorridorConfig
from paani.logs import protobuf as pb
from paani_services.foxglove import scene
from tests.unit.paani_services.foxglove.seen import CALIBRATION, NOW_US, WAYPOINTS, advisory, decoded, odometry


def entity(one: scene.Entity) -> Any:
    [found] = decoded(pb.SCENE_UPDATE, scene.scene_update([one])).entities
    return found


def places(points: Any) -> list[tuple[float, float]]:
    return [(point.x, point.y) for point in points]


def test_the_way_ahead_obstacles_and_home() -> None:
    moving = m.MovingObstacle(track_id=4, x_m=9.0, y_m=2.0, radius_m=0.75, east_mps=0.0, north_mps=-0.5)
    still = m.MovingObstacle(track_id=5, x_m=1.0, y_m=2.0, radius_m=0.5, east_mps=0.0, north_mps=0.0)
    ahead = m.Prediction(
        source_us=NOW_US, sent_us=NOW_US + 5, path=WAYPOINTS, obstacles=(moving, still), home=(WAYPOINTS[0],)
    )
    plan, obstacles, home = (entity(each) for each in scene.prediction(ahead))
    assert places(plan.lines[0].points) == [(0.0, 0.0), (30.0, 0.0), (30.0, 40.0)]
    first, second = obstacles.cylinders
    assert (first.pose.position.x, first.pose.position.y, first.size.x) == (9.0, 2.0, 1.5)
    assert (second.pose.position.x, second.size.x) == (1.0, 1.0)
    [arrow] = obstacles.arrows
    assert arrow.shaft_length == 0.5
    assert 2.0 * math.atan2(arrow.pose.orientation.z, arrow.pose.orientation.w) == pytest.approx(-math.pi / 2)
    assert [text.text for text in obstacles.texts] == ["#4 0.5 m/s", "#5 0.0 m/s"]
    assert len(home.cylinders) == 1
    for each in (plan, obstacles, home):
        assert each.frame_id == "map"
        assert each.lifetime.ToMicroseconds() == keys.PREDICTION.fresh_s * 1e6
        assert each.timestamp.ToMicroseconds() == NOW_US + 5


def test_a_plan_that_ended_is_taken_away() -> None:
    plan, obstacles, home = (entity(each) for each in scene.prediction(m.Prediction(source_us=NOW_US)))
    assert (len(plan.lines), len(obstacles.cylinders), len(home.cylinders)) == (0, 0, 0)
    assert (plan.id, obstacles.id, home.id) == ("plan", "obstacles", "home")


@pytest.mark.parametrize(("repeat", "kind"), [(True, pb.SCENE_LINE_LOOP), (False, pb.SCENE_LINE_STRIP)])
def test_a_route_is_closed_where_it_repeats(repeat: bool, kind: int) -> None:
    found = entity(scene.route(m.Route(source_us=NOW_US, name="r", waypoints=WAYPOINTS, repeat=repeat)))
    assert found.lines[0].type == kind
    assert len(found.cylinders) == 3


def test_the_fence_tells_in_from_out() -> None:
    areas = tuple(m.FenceArea(keep=keep, corners=WAYPOINTS) for keep in (m.Keep.IN, m.Keep.OUT))
    station = m.MissionLeg(kind=m.LegKind.HOLD_STATION, waypoints=(WAYPOINTS[1],), radius_m=3.0)
    planned = m.Mission(source_us=NOW_US, name="x", legs=(station, m.MissionLeg(kind=m.LegKind.STOP)), fence=areas)
    rally, fence, stations = (entity(each) for each in scene.mission(replace(planned, rally=WAYPOINTS[:2])))
    assert [text.text for text in rally.texts] == ["rally", "rally"]
    inner, outer = fence.lines
    assert inner.type == outer.type == pb.SCENE_LINE_LOOP
    assert inner.color.g > inner.color.r
    assert outer.color.r > outer.color.g
    [circle] = stations.cylinders
    assert (circle.pose.position.x, circle.size.x) == (30.0, 6.0)


def test_the_boat_says_when_it_is_not_sure_where_it_is() -> None:
    sure, unsure = (entity(scene.boat(odometry(healthy=healthy))) for healthy in (True, False))
    assert (sure.frame_id, sure.frame_locked) == ("base_link", True)
    assert [text.text for text in unsure.texts] == ["position not trusted"]
    assert len(sure.texts) == 0
    assert sure.arrows[0].color != unsure.arrows[0].color


def test_corridors_on_the_water_have_the_bearings_of_the_picture() -> None:
    """The picture's edges are half the field of view off the optical axis, and the mount turns both."""
    port, starboard = scene.bearings_rad((0.0, 1.0), CALIBRATION)
    assert (math.degrees(port), math.degrees(starboard)) == pytest.approx((35.0 - 10.0, -35.0 - 10.0))
    found = entity(scene.advice(advisory(), CorridorConfig(), CALIBRATION))
    left, center, _ = found.triangles
    bearings = [math.atan2(p.y, p.x - CALIBRATION.forward_m) for p in left.points[1:]]
    assert bearings == pytest.approx(scene.bearings_rad(CorridorConfig().left, CALIBRATION))
    assert left.color.g > left.color.r
    assert center.color.r > center.color.g
    assert [text.text for text in found.texts] == ["LEFT"]
    assert len(entity(scene.advice(advisory(), CorridorConfig(), CalibrationConfig())).triangles) == 0
