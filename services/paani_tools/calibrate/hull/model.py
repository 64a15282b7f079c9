"""The vessel's model in surge, sway and yaw, simulated for many sets of parameters at once. Pure.

T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed. 2021, chapter 6, as the plant has it:
M nu' + C(nu) nu + d1 nu + d2 |nu| nu = tau, with nu the velocity through a steady current, without a Munk moment.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec
import numpy as np

from paani.arrays import F64
from paani_sim.vessels import Vessel
from paani_sim.water.wind import AIR_DENSITY_KGPM3
from paani_tools.calibrate.hull.drive import STEP_S, Drive

FORCE_PARAMETERS = (
    "thrust_linear", "thrust_quadratic", "astern_ratio",
    "surge_linear", "surge_quadratic", "sway_linear", "sway_quadratic", "yaw_linear", "yaw_quadratic", "yaw_inertia",
)  # fmt: skip
NUISANCE_PARAMETERS = ("current_east", "current_north", "gyro_bias", "heading_offset")
PARAMETERS = (*FORCE_PARAMETERS, *NUISANCE_PARAMETERS)
INDEX = {name: number for number, name in enumerate(PARAMETERS)}
MAX_SPEED = 30.0  # m/s or rad/s: a set of parameters that drives the boat faster is wrong, and must not overflow


class Prediction(NamedTuple):
    """Of each set of parameters: velocity of the fixes, east and north [k, 2, sets]; gyro [j, sets]; and surge, sway
    and yaw rate through the water at the start of each step [n + 1, 3, sets]."""

    velocity_mps: F64
    yaw_rate_radps: F64
    motion: F64


def initial_parameters(vessel: Vessel, force_per_unit_n: float) -> F64:
    """Where the search begins: the coefficients of a vessel, thrust in proportion, still water, perfect sensors."""
    start = {
        "thrust_linear": force_per_unit_n,
        "astern_ratio": 1.0,
        "yaw_inertia": vessel.hull.yaw_inertia_kgm2,
        **msgspec.structs.asdict(vessel.drag),
    }
    return np.array([start.get(name, 0.0) for name in PARAMETERS])


def fan_force_n(parameters: F64, thrust: F64) -> F64:
    """Force of a fan at each normalised thrust [n, sets]: k1 x + k2 |x| x, times the astern ratio below zero."""
    linear, quadratic, astern = (parameters[:, INDEX[name]] for name in FORCE_PARAMETERS[:3])
    x = thrust[:, None]
    force: F64 = (linear + quadratic * np.abs(x)) * x * np.where(x < 0.0, astern, 1.0)
    return force


def predict(parameters: F64, drive: Drive, vessel: Vessel) -> Prediction:
    """Simulate the drive with each set of parameters [sets, PARAMETERS], from the velocity of its first fix."""
    of = {name: parameters[:, number] for name, number in INDEX.items()}
    fans = [_lagged(fan_force_n(parameters, drive.thrust[:, side]), vessel.fans.lag_s) for side in (0, 1)]
    ahead, port = fans[0] + fans[1], 0.5 * vessel.fans.spacing_m * (fans[1] - fans[0])
    force = np.stack([ahead, np.zeros_like(ahead), port], axis=1)
    motion = _simulate(force, parameters, vessel, _body_axes(drive.heading_rad[0]) @ drive.velocity_mps[0])
    at_fix = _interpolated(motion[:, :2], drive.fix_at)
    heading = np.interp(drive.fix_at, np.arange(len(drive.heading_rad)), drive.heading_rad)[:, None]
    cos, sin = np.cos(heading + of["heading_offset"]), np.sin(heading + of["heading_offset"])
    east = cos * at_fix[:, 0] - sin * at_fix[:, 1] + of["current_east"]
    north = sin * at_fix[:, 0] + cos * at_fix[:, 1] + of["current_north"]
    gyro = _interpolated(motion[:, 2], drive.rate_at) + of["gyro_bias"]
    return Prediction(np.stack([east, north], axis=1), gyro, motion)


def _simulate(force: F64, parameters: F64, vessel: Vessel, start_mps: F64) -> F64:
    """Surge, sway and yaw rate through the water after each step, by Heun's method [n + 1, 3, sets]."""
    of = {name: parameters[:, number] for name, number in INDEX.items()}
    hull, added, sets = vessel.hull, vessel.added_mass, len(parameters)
    mass_surge, mass_sway = hull.mass_kg * (1.0 + added.surge_ratio), hull.mass_kg * (1.0 + added.sway_ratio)
    inertia = np.stack(
        [np.full(sets, mass_surge), np.full(sets, mass_sway), of["yaw_inertia"] * (1.0 + added.yaw_ratio)]
    )
    linear = np.stack([of[f"{axis}_linear"] for axis in ("surge", "sway", "yaw")]) / inertia
    quadratic = np.stack([of[f"{axis}_quadratic"] for axis in ("surge", "sway", "yaw")]) / inertia
    pushed = force / inertia
    windage = _windage(vessel)[:, None] / inertia
    exposed = bool(windage.any())
    crossed = np.stack([np.full(sets, mass_sway / mass_surge), np.full(sets, -mass_surge / mass_sway), np.zeros(sets)])

    def rate(motion: F64, push: F64) -> F64:
        changed: F64 = push - (linear + quadratic * np.abs(motion)) * motion
        changed += crossed * motion[[1, 0, 2]] * motion[2]
        if exposed:
            speed = np.hypot(motion[0], motion[1])
            changed -= windage * np.stack([speed * motion[0], speed * motion[1], 2.0 * motion[0] * motion[1]])
        return changed

    motion = np.empty((len(force) + 1, 3, sets))
    now = np.zeros((3, sets))
    now[:2] = start_mps[:, None]
    motion[0] = now
    for step, push in enumerate(pushed):
        first = rate(now, push)
        now = now + 0.5 * STEP_S * (first + rate(now + STEP_S * first, push))
        now = np.clip(now, -MAX_SPEED, MAX_SPEED)
        motion[step + 1] = now
    return motion


def _windage(vessel: Vessel) -> F64:
    """Resistance of still air over V u, V v and 2 u v (Fossen 2021, section 10.1): the drive's water is calm."""
    windage = vessel.windage
    areas = (windage.frontal_area_m2, windage.lateral_area_m2, windage.lateral_area_m2 * vessel.hull.length_m)
    coefficients = (windage.surge_coefficient, windage.sway_coefficient, windage.yaw_coefficient)
    resistance: F64 = 0.5 * AIR_DENSITY_KGPM3 * np.array(areas) * np.array(coefficients)
    return resistance


def _lagged(force: F64, lag_s: float) -> F64:
    """Mean force over each step of fans that follow their order as a first-order lag [n, sets]."""
    if lag_s == 0.0:
        return force
    part = 1.0 - math.exp(-STEP_S / lag_s)
    means, now = np.empty_like(force), np.zeros(force.shape[1])
    for step, order in enumerate(force):
        means[step] = order + (now - order) * part * lag_s / STEP_S
        now = now + part * (order - now)
    return means


def _interpolated(values: F64, at: F64) -> F64:
    """Values that are given at the start of each step [n + 1, ...], at times in steps [k, ...]."""
    step = np.minimum(at.astype(np.int64), len(values) - 2)
    part = (at - step).reshape(-1, *(1,) * (values.ndim - 1))
    between: F64 = (1.0 - part) * values[step] + part * values[step + 1]
    return between


def _body_axes(heading_rad: float) -> F64:
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    return np.array([[cos, sin], [-sin, cos]])
