"""The paper's surface dynamics: drag, buoyancy, restoring moments and two fans. Pure scalar maths.

Body frame: x forward, y left, z up. Scalars rather than arrays: one call per simulation step.
"""

import math
from typing import NamedTuple

from paani.config import DynamicsConfig
from paani.geometry import clip

GRAVITY_MPS2 = 9.81


class HullState(NamedTuple):
    """Height, attitude quaternion, velocity in the map frame, angular velocity in the body frame."""

    z_m: float
    qw: float
    qx: float
    qy: float
    qz: float
    vx_mps: float
    vy_mps: float
    vz_mps: float
    roll_rate_radps: float
    pitch_rate_radps: float
    yaw_rate_radps: float


class Fans(NamedTuple):
    """Forward force of each fan [N]."""

    left_n: float
    right_n: float


class Attitude(NamedTuple):
    """Intrinsic z-y-x angles; positive pitch lowers the bow (y points left)."""

    roll_rad: float
    pitch_rad: float
    yaw_rad: float


Wrench = tuple[float, float, float, float, float, float]


def wrench(state: HullState, fans: Fans, config: DynamicsConfig) -> Wrench:
    """Force in the map frame [N] and moment in the body frame [N m], without gravity.

    Drag opposes surge, sway and yaw with F = -c1 v - c2 |v| v (K5). Heave is
    clip(m g + k (z_e - z) - d z', 0, F_max) (K6). Roll and pitch are restored and damped (K7).
    """
    forward_x, forward_y, forward_z, left_x, left_y, left_z = _body_axes(state)
    surge_mps = forward_x * state.vx_mps + forward_y * state.vy_mps + forward_z * state.vz_mps
    sway_mps = left_x * state.vx_mps + left_y * state.vy_mps + left_z * state.vz_mps
    yaw_rate = state.yaw_rate_radps

    thrust_n = fans.left_n + fans.right_n
    ahead_n = thrust_n - _drag(surge_mps, config.surge_linear, config.surge_quadratic)
    sideways_n = -_drag(sway_mps, config.sway_linear, config.sway_quadratic)

    weight_n = config.mass_kg * GRAVITY_MPS2
    up_n = clip(
        weight_n
        + config.heave_stiffness_n_per_m * (config.equilibrium_z_m - state.z_m)
        - config.heave_damping * state.vz_mps,
        0.0,
        config.max_buoyancy_weights * weight_n,
    )

    angles = attitude(state.qw, state.qx, state.qy, state.qz)
    stiffness, damping = config.tilt_stiffness_nm_per_rad, config.tilt_damping
    return (
        forward_x * ahead_n + left_x * sideways_n,
        forward_y * ahead_n + left_y * sideways_n,
        forward_z * ahead_n + left_z * sideways_n + up_n,
        -stiffness * angles.roll_rad - damping * state.roll_rate_radps,
        -stiffness * angles.pitch_rad - damping * state.pitch_rate_radps + config.fan_height_m * thrust_n,
        0.5 * config.fan_spacing_m * (fans.right_n - fans.left_n)
        - _drag(yaw_rate, config.yaw_linear, config.yaw_quadratic),
    )


def attitude(qw: float, qx: float, qy: float, qz: float) -> Attitude:
    """Roll, pitch and yaw of a unit quaternion."""
    return Attitude(
        math.atan2(2.0 * (qw * qx + qy * qz), 1.0 - 2.0 * (qx * qx + qy * qy)),
        math.asin(clip(2.0 * (qw * qy - qz * qx), -1.0, 1.0)),
        math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz)),
    )


def body_velocity(state: HullState) -> tuple[float, float]:
    """Surge and sway [m/s]: velocity along the body's forward and left axes."""
    forward_x, forward_y, forward_z, left_x, left_y, left_z = _body_axes(state)
    vx, vy, vz = state.vx_mps, state.vy_mps, state.vz_mps
    return forward_x * vx + forward_y * vy + forward_z * vz, left_x * vx + left_y * vy + left_z * vz


def _body_axes(state: HullState) -> tuple[float, float, float, float, float, float]:
    qw, qx, qy, qz = state.qw, state.qx, state.qy, state.qz
    return (
        1.0 - 2.0 * (qy * qy + qz * qz),
        2.0 * (qx * qy + qw * qz),
        2.0 * (qx * qz - qw * qy),
        2.0 * (qx * qy - qw * qz),
        1.0 - 2.0 * (qx * qx + qz * qz),
        2.0 * (qy * qz + qw * qx),
    )


def _drag(speed: float, linear: float, quadratic: float) -> float:
    return linear * speed + quadratic * abs(speed) * speed
