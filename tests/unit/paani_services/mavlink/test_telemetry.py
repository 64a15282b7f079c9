"""Telemetry read back by pymavlink's parser: units, frames, and nothing of what is not known."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from paani import messages as m
from paani.geometry import geodetic_from_enu
from paani.map_origin import map_origin_deg
from paani_services.mavlink.codec import Codec
from paani_services.mavlink.fields import degrees_e7
from paani_services.mavlink.snapshot import Snapshot
from paani_services.mavlink.telemetry import BUILDERS
from tests.mavlink_peer import NOW_US, ORIGIN_DEG, armed, in_order, odometry

ALL = [*BUILDERS]
UNKNOWN = Snapshot(now_us=NOW_US)
WIDE = st.floats(-1e9, 1e9)


def sent(snapshot: Snapshot) -> dict[str, Any]:
    """All messages of a snapshot by name, as a ground station has them."""
    codec, parser = Codec(0, None), common.MAVLink(None)
    found = {}
    for build in BUILDERS.values():
        message = build(snapshot)
        if message is not None:
            (decoded,) = parser.parse_buffer(codec.encode(message, snapshot.now_us))
            found[decoded.get_type()] = decoded
    return found


def test_a_pose_in_the_frames_of_the_protocol() -> None:
    """30 degrees north of east is a compass heading of 60; the map's east and north are y and x."""
    found = sent(in_order(odometry=odometry(sway_mps=0.5, yaw_rate_radps=0.2, roll_rad=0.1, pitch_rad=0.05)))
    local, attitude, position = found["LOCAL_POSITION_NED"], found["ATTITUDE"], found["GLOBAL_POSITION_INT"]
    assert (local.x, local.y, local.z) == (20.0, 10.0, 0.0)
    east_mps = math.cos(math.radians(30.0)) - 0.5 * math.sin(math.radians(30.0))
    north_mps = math.sin(math.radians(30.0)) + 0.5 * math.cos(math.radians(30.0))
    assert (local.vx, local.vy) == pytest.approx((north_mps, east_mps), abs=1e-6)
    assert (position.vx, position.vy, position.hdg) == (round(north_mps * 100), round(east_mps * 100), 6000)
    assert attitude.yaw == pytest.approx(math.radians(60.0), abs=1e-6)
    assert (attitude.roll, attitude.pitch, attitude.yawspeed) == pytest.approx((0.1, -0.05, -0.2), abs=1e-6)
    assert math.isnan(attitude.rollspeed)
    assert position.time_boot_ms == 5000
    hud = found["VFR_HUD"]
    assert (hud.heading, hud.groundspeed) == (60, pytest.approx(math.hypot(1.0, 0.5)))
    assert math.isnan(hud.airspeed)


@given(st.floats(-3.1, 3.1), st.floats(-0.7, 0.7), st.floats(-0.7, 0.7))
@pytest.mark.slow
def test_quaternion_and_angles_agree(yaw_rad: float, pitch_rad: float, roll_rad: float) -> None:
    """By the rotation matrix: where the bow and the mast point."""
    found = sent(in_order(odometry=odometry(yaw_rad=yaw_rad, pitch_rad=pitch_rad, roll_rad=roll_rad)))
    q, euler = found["ATTITUDE_QUATERNION"], found["ATTITUDE"]
    w, x, y, z = q.q1, q.q2, q.q3, q.q4
    bow_north, bow_east, bow_down = w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)
    assert math.atan2(bow_east, bow_north) == pytest.approx(euler.yaw, abs=1e-5)
    assert -math.asin(max(-1.0, min(1.0, bow_down))) == pytest.approx(euler.pitch, abs=1e-5)
    assert math.atan2(2 * (y * z + w * x), w * w - x * x - y * y + z * z) == pytest.approx(euler.roll, abs=1e-5)


@given(st.floats(-90.0, 90.0), st.floats(-180.0, 180.0))
@pytest.mark.slow
def test_every_place_is_read_back_to_a_centimetre(latitude_deg: float, longitude_deg: float) -> None:
    found = sent(in_order(odometry=odometry(latitude_deg=latitude_deg, longitude_deg=longitude_deg)))
    position = found["GLOBAL_POSITION_INT"]
    assert position.lat * 1e-7 == pytest.approx(latitude_deg, abs=6e-8)
    assert math.remainder(position.lon * 1e-7 - longitude_deg, 360.0) == pytest.approx(0.0, abs=6e-8)


@pytest.mark.parametrize(
    ("angle_deg", "number"),
    [(180.5, -1_795_000_000), (-180.5, 1_795_000_000), (180.0, 1_800_000_000), (-90.0, -900_000_000)],
)
def test_a_place_beyond_the_antimeridian_is_turned_back(angle_deg: float, number: int) -> None:
    """As the map gives it to one that lies on the other side of its origin."""
    assert degrees_e7(angle_deg) == number


def test_a_fix_in_the_units_of_the_protocol() -> None:
    fix = sent(in_order())["GPS_RAW_INT"]
    assert (fix.fix_type, fix.lat, fix.lon) == (common.GPS_FIX_TYPE_2D_FIX, 505_000_000, -82_500_000)
    assert (fix.vel, fix.cog, fix.h_acc, fix.time_usec) == (150, 9000, 800, NOW_US)
    assert (fix.eph, fix.epv, fix.satellites_visible) == (0xFFFF, 0xFFFF, 255)


@pytest.mark.parametrize("fix", [None, m.GpsFix(
    source_us=1, latitude_deg=50.0, longitude_deg=8.0, sog_mps=1.0, cog_rad=1.0, position_std_m=1.0, fix=False
)])  # fmt: skip
def test_a_receiver_without_a_fix_gives_no_position(fix: m.GpsFix | None) -> None:
    message = sent(in_order(fix=fix))["GPS_RAW_INT"]
    assert message.fix_type == (common.GPS_FIX_TYPE_NO_GPS if fix is None else common.GPS_FIX_TYPE_NO_FIX)
    assert (message.lat, message.lon, message.vel, message.cog) == (0, 0, 0xFFFF, 0xFFFF)


@pytest.mark.parametrize("estimate", [None, odometry(healthy=False)])
def test_without_a_healthy_estimate_no_pose_is_sent(estimate: m.Odometry | None) -> None:
    poses = {"GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "ATTITUDE", "ATTITUDE_QUATERNION", "VFR_HUD", "HOME_POSITION"}
    home = m.Prediction(source_us=NOW_US, home=(m.Waypoint(x_m=1.0, y_m=2.0),))
    assert poses <= set(sent(in_order(prediction=home)))
    assert not poses & set(sent(in_order(odometry=estimate, prediction=home)))


def test_the_heartbeat_says_armed_only_where_the_operator_does() -> None:
    def heartbeat(snapshot: Snapshot) -> tuple[int, int, int]:
        message = sent(snapshot)["HEARTBEAT"]
        assert (message.type, message.autopilot) == (common.MAV_TYPE_SURFACE_BOAT, common.MAV_AUTOPILOT_ARDUPILOTMEGA)
        return message.base_mode, message.custom_mode, message.system_status

    assert heartbeat(armed()) == (129, 10, common.MAV_STATE_ACTIVE)
    assert heartbeat(in_order()) == (1, 10, common.MAV_STATE_STANDBY)
    stopped = m.OperatorState(source_us=NOW_US, armed=True, stopped=True)
    assert heartbeat(armed(operator=stopped))[0] == 1
    assert heartbeat(armed(operator=None)) == (1, 4, common.MAV_STATE_UNINIT)


@pytest.mark.parametrize(
    ("mode", "number"),
    [
        (m.DriveMode.ROUTE, 10),
        (m.DriveMode.HOLD, 5),  # LOITER keeps the station
        (m.DriveMode.RETURN, 11),
        (m.DriveMode.MANUAL, 0),
        (m.DriveMode.IDLE, 4),  # in ArduRover's HOLD a boat has no thrust
    ],
)
def test_each_mode_of_the_operator_has_the_number_of_a_rover(mode: m.DriveMode, number: int) -> None:
    operator = m.OperatorState(source_us=NOW_US, armed=True, stopped=False, mode=mode)
    assert sent(armed(operator=operator))["HEARTBEAT"].custom_mode == number


def test_home_lies_where_the_map_says() -> None:
    home = m.Waypoint(x_m=-30.0, y_m=40.0)
    found = sent(in_order(prediction=m.Prediction(source_us=NOW_US, home=(home,))))["HOME_POSITION"]
    expected = geodetic_from_enu(-30.0, 40.0, *map_origin_deg(odometry()))
    assert (found.latitude * 1e-7, found.longitude * 1e-7) == pytest.approx(expected, abs=1e-7)
    assert (found.x, found.y) == (40.0, -30.0)


@given(st.floats(-80.0, 80.0), st.floats(-180.0, 180.0), st.floats(-5e3, 5e3), st.floats(-5e3, 5e3))
def test_the_origin_is_found_from_any_pose(latitude_deg: float, longitude_deg: float, x_m: float, y_m: float) -> None:
    here = geodetic_from_enu(x_m, y_m, latitude_deg, longitude_deg)
    pose = odometry(x_m=x_m, y_m=y_m, latitude_deg=here[0], longitude_deg=here[1])
    found = map_origin_deg(pose)
    assert found[0] == pytest.approx(latitude_deg, abs=1e-8)
    assert math.remainder(found[1] - longitude_deg, 360.0) == pytest.approx(0.0, abs=1e-8)


def test_the_map_origin_of_a_known_place() -> None:
    assert map_origin_deg(odometry()) == pytest.approx(ORIGIN_DEG, abs=1e-5)


@given(st.lists(WIDE, min_size=8, max_size=8), st.floats(-1.0, 1.0), st.floats(0.0, 1e9))
@pytest.mark.slow
def test_no_value_that_a_message_may_have_breaks_a_frame(values: list[float], thrust: float, volts: float) -> None:
    x_m, y_m, yaw_rad, surge_mps, sway_mps, latitude_deg, longitude_deg, roll_rad = values
    pose = odometry(
        x_m=x_m, y_m=y_m, yaw_rad=yaw_rad, surge_mps=surge_mps, sway_mps=sway_mps, latitude_deg=latitude_deg,
        longitude_deg=longitude_deg, roll_rad=roll_rad, pitch_rad=roll_rad, yaw_rate_radps=roll_rad,
    )  # fmt: skip
    applied = m.ThrustApplied(
        source_us=0, left=thrust, right=thrust, left_n=x_m, right_n=y_m, zero_cause=m.ZeroCause.NONE
    )
    hull = m.ThrustersState(source_us=0, line="", connected=True, zero_cause=m.ZeroCause.NONE, battery_v=volts,
                            current_a=x_m)  # fmt: skip
    home = m.Prediction(source_us=0, home=(m.Waypoint(x_m=y_m, y_m=x_m),))
    found = sent(in_order(odometry=pose, applied=applied, thrusters=hull, prediction=home))
    assert {"GLOBAL_POSITION_INT", "HOME_POSITION", "SYS_STATUS"} <= set(found)


def test_a_boat_of_which_nothing_is_known_still_says_what_it_is() -> None:
    assert set(sent(UNKNOWN)) == {
        "HEARTBEAT", "SYS_STATUS", "SYSTEM_TIME", "EXTENDED_SYS_STATE", "GPS_RAW_INT", "AUTOPILOT_VERSION",
    }  # fmt: skip


def test_a_battery_is_told_where_one_is_measured() -> None:
    hull = m.ThrustersState(
        source_us=0, line="", connected=True, zero_cause=m.ZeroCause.NONE, battery_v=14.8, current_a=-2.5
    )
    found = sent(in_order(thrusters=hull))
    battery, status = found["BATTERY_STATUS"], found["SYS_STATUS"]
    assert (battery.voltages[0], battery.voltages[1], battery.current_battery) == (14_800, 0xFFFF, -250)
    assert (battery.battery_remaining, battery.temperature) == (-1, 0x7FFF)
    assert (status.voltage_battery, status.current_battery, status.battery_remaining) == (14_800, -250, -1)
    unmeasured = sent(in_order())
    assert "BATTERY_STATUS" not in unmeasured
    assert unmeasured["SYS_STATUS"].voltage_battery == 0xFFFF


def test_the_ordered_heading_is_told_while_the_boat_is_ordered_to_move() -> None:
    order = sent(armed())["NAV_CONTROLLER_OUTPUT"]
    assert order.nav_bearing == round(90.0 - math.degrees(0.5))
    assert order.wp_dist == 0xFFFF
    assert "NAV_CONTROLLER_OUTPUT" not in sent(in_order())


@pytest.mark.parametrize(
    ("leg", "waypoint", "distance_m"), [(1, 1, 50), (1, 2, 0xFFFE), (0, 0, 0xFFFF), (2, 0, 0xFFFF)]
)
def test_how_far_the_waypoint_is_that_is_steered_for(leg: int, waypoint: int, distance_m: int) -> None:
    here = odometry()
    places = [(0.0, 0.0), (here.x_m + 30.0, here.y_m - 40.0), (here.x_m, here.y_m + 90_000.0)]
    points = tuple(m.Waypoint(x_m=x_m, y_m=y_m) for x_m, y_m in places)
    legs = (m.MissionLeg(kind=m.LegKind.RETURN_HOME), m.MissionLeg(kind=m.LegKind.FOLLOW_ROUTE, waypoints=points))
    order = m.NavCommand(
        source_us=NOW_US, enable=True, heading_rad=0.5, speed_mps=0.6, leg_index=leg, waypoint_index=waypoint
    )
    mission = m.Mission(source_us=NOW_US, name="a", legs=legs)
    assert sent(armed(command=order, mission=mission))["NAV_CONTROLLER_OUTPUT"].wp_dist == distance_m
