"""The paper's surface dynamics, term by term (K4-K7)."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani_sim.plant.dynamics import Fans, HullState, attitude, body_velocity, compute_wrench
from paani_sim.vessels import load_vessel
from paani_sim.water.surroundings import Surroundings
from paani_sim.water.waves import GRAVITY_MPS2

PAPER = load_vessel("paper")
AFLOAT = HullState(PAPER.buoyancy.equilibrium_z_m, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
IDLE = Fans(0.0, 0.0)
WEIGHT_N = 12.4 * GRAVITY_MPS2
speeds = st.floats(-5.0, 5.0)


def turned(angle_rad: float, axis: int) -> HullState:
    quaternion = [math.cos(angle_rad / 2.0), 0.0, 0.0, 0.0]
    quaternion[axis + 1] = math.sin(angle_rad / 2.0)
    return AFLOAT._replace(qw=quaternion[0], qx=quaternion[1], qy=quaternion[2], qz=quaternion[3])


def test_k5_drag_of_surge_sway_and_yaw() -> None:
    """K5: F = -c1 v - c2 |v| v with 4/20, 20/80, 4/25."""
    assert compute_wrench(AFLOAT._replace(vx_mps=0.5), IDLE, PAPER)[0] == pytest.approx(-(4 * 0.5 + 20 * 0.25))
    assert compute_wrench(AFLOAT._replace(vy_mps=-0.5), IDLE, PAPER)[1] == pytest.approx(20 * 0.5 + 80 * 0.25)
    spinning = AFLOAT._replace(yaw_rate_radps=0.4)
    assert compute_wrench(spinning, IDLE, PAPER)[5] == pytest.approx(-(4 * 0.4 + 25 * 0.16))


def test_k5_drag_follows_the_body_axes() -> None:
    """Going north while heading north is surge, not sway."""
    north = turned(math.pi / 2.0, axis=2)._replace(vy_mps=0.5)
    force = compute_wrench(north, IDLE, PAPER)
    assert body_velocity(north) == pytest.approx((0.5, 0.0))
    assert force[:2] == pytest.approx((0.0, -(4 * 0.5 + 20 * 0.25)))


@pytest.mark.parametrize(
    ("z_m", "vz_mps", "force_n"),
    [
        (0.177, 0.0, WEIGHT_N),
        (0.157, 0.0, WEIGHT_N + 13.0),
        (0.177, 0.1, WEIGHT_N - 9.0),
        (0.177, 1.0, WEIGHT_N - 90.0),
        (0.177, -1.0, WEIGHT_N + 90.0),
        (0.217, -0.5, WEIGHT_N - 26.0 + 45.0),
        (0.6, 0.0, 0.0),  # out of the water
        (-1.0, 0.0, 3.0 * WEIGHT_N),  # deep under: F_max
    ],
)
def test_k6_heave_force(z_m: float, vz_mps: float, force_n: float) -> None:
    """K6: F_z = clip(m g + 650 (0.177 - z) - 90 z', 0, 3 m g)."""
    assert compute_wrench(AFLOAT._replace(z_m=z_m, vz_mps=vz_mps), IDLE, PAPER)[2] == pytest.approx(force_n)


@pytest.mark.parametrize("axis", [0, 1])
def test_k7_tilt_is_restored_and_damped(axis: int) -> None:
    """K7: 90 N m per rad and 24 N m s per rad, in roll and in pitch."""
    tilted = turned(0.1, axis)
    rate = "roll_rate_radps" if axis == 0 else "pitch_rate_radps"
    assert compute_wrench(tilted, IDLE, PAPER)[3 + axis] == pytest.approx(-9.0)
    moving = AFLOAT._replace(**{rate: 0.5})
    assert compute_wrench(moving, IDLE, PAPER)[3 + axis] == pytest.approx(-12.0)


def test_fans_push_forward_turn_and_lower_the_bow() -> None:
    """1b #17: fans 0.60 m apart; the right fan alone turns to port (counter-clockwise)."""
    force = compute_wrench(AFLOAT, Fans(0.0, 10.0), PAPER)
    assert force == pytest.approx((10.0, 0.0, WEIGHT_N, 0.0, 0.12 * 10.0, 0.3 * 10.0))


@given(speeds, speeds, st.floats(-3.0, 3.0))
def test_drag_takes_energy_whatever_the_motion(vx: float, vy: float, rate: float) -> None:
    state = AFLOAT._replace(vx_mps=vx, vy_mps=vy, yaw_rate_radps=rate)
    fx, fy, _, _, _, moment = compute_wrench(state, IDLE, PAPER)
    assert fx * vx + fy * vy + moment * rate <= 0.0


@given(st.floats(-0.6, 0.6), st.floats(-3.0, 3.0))
def test_attitude_inverts_the_quaternion(pitch: float, yaw: float) -> None:
    cy, sy, cp, sp = (
        math.cos(yaw / 2),
        math.sin(yaw / 2),
        math.cos(pitch / 2),
        math.sin(pitch / 2),
    )
    angles = attitude(cy * cp, -sy * sp, cy * sp, sy * cp)
    assert angles == pytest.approx((0.0, pitch, yaw), abs=1e-9)


def test_k8_wind_and_waves_do_nothing_to_the_papers_hull() -> None:
    moving = AFLOAT._replace(vx_mps=0.3, vy_mps=0.1, yaw_rate_radps=0.2)
    blown = Surroundings(wind_x_mps=6.0, wind_y_mps=-4.0, envelope_x_m2=0.02, envelope_y_m2=0.01)
    assert compute_wrench(moving, Fans(1.0, 2.0), PAPER, blown) == compute_wrench(moving, Fans(1.0, 2.0), PAPER)


@pytest.mark.parametrize("axis", [0, 1], ids=["roll", "pitch"])
@pytest.mark.parametrize("angle_rad", [0.1, -0.3])
def test_k7_the_stiffness_is_the_same_at_every_angle(axis: int, angle_rad: float) -> None:
    assert compute_wrench(turned(angle_rad, axis), IDLE, PAPER)[3 + axis] == pytest.approx(-90.0 * angle_rad)


@pytest.mark.parametrize("speed", [-3.0, -0.5, -0.1, 0.1, 0.5, 3.0])
def test_k5_drag_opposes_motion_to_either_side_at_every_speed(speed: float) -> None:
    surge, sway, yaw = (
        compute_wrench(state, IDLE, PAPER)
        for state in (
            AFLOAT._replace(vx_mps=speed),
            AFLOAT._replace(vy_mps=speed),
            AFLOAT._replace(yaw_rate_radps=speed),
        )
    )
    assert surge[0] == pytest.approx(-(4.0 + 20.0 * abs(speed)) * speed)
    assert sway[1] == pytest.approx(-(20.0 + 80.0 * abs(speed)) * speed)
    assert yaw[5] == pytest.approx(-(4.0 + 25.0 * abs(speed)) * speed)
