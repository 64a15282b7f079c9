"""Surface dynamics: drag, buoyancy, restoring moments, added mass, wind and two fans. Pure scalar maths.

Body frame: x forward, y left, z up. Scalars rather than arrays: one call per simulation step.
"""

import math
from typing import NamedTuple

from paani.geometry import clip
from paani_sim.vessels import Vessel
from paani_sim.vessels.vessel import Buoyancy
from paani_sim.water.surroundings import CALM, Surroundings
from paani_sim.water.waves import GRAVITY_MPS2
from paani_sim.water.wind import wind_force

WATER_DENSITY_KGPM3 = 1000.0
DRAG_LINEAR_ABOVE = (
    10.0  # m/s or rad/s: beyond it drag grows linearly, because explicit steps would diverge after a hard collision
)


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
BodyAxes = tuple[float, float, float, float, float, float]  # forward x, y, z, left x, y, z in the map frame


def compute_wrench(state: HullState, fans: Fans, vessel: Vessel, surroundings: Surroundings = CALM) -> Wrench:
    """Force in the map frame [N] and moment in the body frame [N m], without gravity.

    Drag opposes surge, sway and yaw through the water with F = -c1 v - c2 |v| v (K5). Heave is
    clip(m g + k (z_e - z) - d z', 0, F_max) (K6), roll and pitch are restored and damped (K7), all three against
    the water's surface. Its slope pulls the hull downhill (Froude-Krylov); its envelope pushes it along (Maruo 1960;
    varying slowly as in Newman 1974). Added mass in surge and sway, with its Coriolis force in the plane, makes the
    force what the bare mass needs for the acceleration of both; that of the other axes is the model's armature.
    """
    axes = _body_axes(state)
    forward_x, forward_y, forward_z, left_x, left_y, left_z = axes
    ahead_n, sideways_n, port_nm = _planar_forces(state, axes, fans, vessel, surroundings)
    roll_nm, pitch_nm = _righting_moments(state, vessel.buoyancy, surroundings)
    return (
        forward_x * ahead_n + left_x * sideways_n,
        forward_y * ahead_n + left_y * sideways_n,
        forward_z * ahead_n + left_z * sideways_n + _heave_force(state, vessel, surroundings),
        roll_nm,
        pitch_nm + vessel.fans.height_m * (fans.left_n + fans.right_n),
        port_nm,
    )


def _planar_forces(
    state: HullState, axes: BodyAxes, fans: Fans, vessel: Vessel, surroundings: Surroundings
) -> tuple[float, float, float]:
    """Force ahead and to port [N], and moment to port [N m]."""
    forward_x, forward_y, forward_z, left_x, left_y, left_z = axes
    drag, mass_kg, length_m = vessel.drag, vessel.hull.mass_kg, vessel.hull.length_m
    vx_mps, vy_mps = state.vx_mps - surroundings.current_x_mps, state.vy_mps - surroundings.current_y_mps
    surge_mps = forward_x * vx_mps + forward_y * vy_mps + forward_z * state.vz_mps
    sway_mps = left_x * vx_mps + left_y * vy_mps + left_z * state.vz_mps
    yaw_rate = state.yaw_rate_radps

    weight_n = mass_kg * GRAVITY_MPS2
    thrust_n = fans.left_n + fans.right_n
    ahead_n = thrust_n - _drag(surge_mps, drag.surge_linear, drag.surge_quadratic) - weight_n * surroundings.slope_ahead
    sideways_n = -_drag(sway_mps, drag.sway_linear, drag.sway_quadratic) - weight_n * surroundings.slope_left
    port_nm = 0.5 * vessel.fans.spacing_m * (fans.right_n - fans.left_n)
    port_nm -= _drag(yaw_rate, drag.yaw_linear, drag.yaw_quadratic)

    if vessel.wave_reflection_frac:
        drift_npm2 = 0.5 * WATER_DENSITY_KGPM3 * GRAVITY_MPS2 * length_m * vessel.wave_reflection_frac**2
        ahead_n += drift_npm2 * (forward_x * surroundings.envelope_x_m2 + forward_y * surroundings.envelope_y_m2)
        sideways_n += drift_npm2 * (left_x * surroundings.envelope_x_m2 + left_y * surroundings.envelope_y_m2)

    if vessel.windage.lateral_area_m2 or vessel.windage.frontal_area_m2:
        air_x_mps, air_y_mps = surroundings.wind_x_mps - state.vx_mps, surroundings.wind_y_mps - state.vy_mps
        wind = wind_force(
            forward_x * air_x_mps + forward_y * air_y_mps,
            left_x * air_x_mps + left_y * air_y_mps,
            vessel.windage,
            length_m,
        )
        ahead_n += wind[0]
        sideways_n += wind[1]
        port_nm += wind[2]

    added = vessel.added_mass
    if added.surge_ratio or added.sway_ratio:
        coriolis = (added.sway_ratio - added.surge_ratio) * mass_kg * yaw_rate
        ahead_n = (ahead_n + coriolis * sway_mps) / (1.0 + added.surge_ratio)
        sideways_n = (sideways_n + coriolis * surge_mps) / (1.0 + added.sway_ratio)
    return ahead_n, sideways_n, port_nm


def _heave_force(state: HullState, vessel: Vessel, surroundings: Surroundings) -> float:
    """Force upward [N] (K6)."""
    buoyancy, weight_n = vessel.buoyancy, vessel.hull.mass_kg * GRAVITY_MPS2
    return clip(
        weight_n
        + buoyancy.heave_stiffness * (buoyancy.equilibrium_z_m + surroundings.elevation_m - state.z_m)
        - buoyancy.heave_damping * (state.vz_mps - surroundings.elevation_rate_mps),
        0.0,
        buoyancy.max_weights * weight_n,
    )


def _righting_moments(state: HullState, buoyancy: Buoyancy, surroundings: Surroundings) -> tuple[float, float]:
    """Moments about the forward and the left axis [N m], which turn the hull to the water's slope (K7)."""
    angles = attitude(state.qw, state.qx, state.qy, state.qz)
    return (
        buoyancy.roll_stiffness * (surroundings.slope_left - angles.roll_rad)
        - buoyancy.roll_damping * (state.roll_rate_radps - surroundings.slope_left_rate_ps),
        -buoyancy.pitch_stiffness * (surroundings.slope_ahead + angles.pitch_rad)
        - buoyancy.pitch_damping * (state.pitch_rate_radps + surroundings.slope_ahead_rate_ps),
    )


def apply_fan_lag(fans: Fans, order: Fans, lag_s: float, step_s: float) -> Fans:
    """The fans' forces one step later: a first-order approach to what is ordered."""
    if lag_s == 0.0:
        return order
    part = 1.0 - math.exp(-step_s / lag_s)
    return Fans(fans.left_n + part * (order.left_n - fans.left_n), fans.right_n + part * (order.right_n - fans.right_n))


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


def _body_axes(state: HullState) -> BodyAxes:
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
    return linear * speed + quadratic * min(abs(speed), DRAG_LINEAR_ABOVE) * speed
