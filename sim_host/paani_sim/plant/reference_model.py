"""A published model of the same boats, solved with SciPy, to compare the plant with.

Model: 3 degrees of freedom, surge, sway and yaw, T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion
Control, 2nd ed. 2021, chapter 6: M nu_r' + C(nu_r) nu_r + D(nu_r) nu_r = tau with nu_r the velocity through a steady,
irrotational current. As in the author's otter.py there is no Munk moment. It shares no line with the plant and reads
no vessel file: its numbers stand below, from the same sources.
"""

import dataclasses
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

from paani.arrays import F64
from paani.config import PlantConfig
from paani.geometry import wrap_rad
from paani.statistics.figure_table import FigureTable
from paani_sim.plant.plant import Plant
from paani_sim.worlds import Current, Wind, World, load_world

MASS_KG, YAW_INERTIA_KGM2 = 12.4, 2.05  # K4; 12.4 kg over 1.3 x 0.75 m
LINEAR, QUADRATIC = np.array([4.0, 20.0, 4.0]), np.array([20.0, 80.0, 25.0])  # K5
FAN_ARM_M = 0.30
OTTER_ADDED = np.array([0.1, 1.5, 1.7])  # otter.py: -Xu'/m, -Yv'/m, -Nr'/Iz
OTTER_LAG_S = 0.1  # otter.py
FRONTAL_M2, LATERAL_M2 = 0.15, 0.30
SAMPLE_S = 0.1
HALF_WIDTH_M = 300.0  # of the water below: the current is the same all about the boat


class Manoeuvre(NamedTuple):
    """From rest, heading east, at the origin; the wind blows north.

    `zigzag_rad` > 0: the fans change sides each time that this heading is reached.
    """

    name: str
    seconds: float
    left_n: float
    right_n: float
    current_mps: float = 0.0
    current_rad: float = 0.0
    wind_mps: float = 0.0
    zigzag_rad: float = 0.0


MANOEUVRES = (
    Manoeuvre("straight line, 12 N", 40.0, 6.0, 6.0),
    Manoeuvre("turning circle, 3 N and 9 N", 60.0, 3.0, 9.0),
    Manoeuvre("zig-zag 20/20, 3 N and 9 N", 60.0, 3.0, 9.0, zigzag_rad=math.radians(20.0)),
    Manoeuvre("drift in 0.4 m/s on the quarter", 60.0, 0.0, 0.0, 0.4, math.radians(60.0)),
    Manoeuvre("drift in 6 m/s of wind", 60.0, 0.0, 0.0, wind_mps=6.0),
    Manoeuvre("crossing 0.3 m/s under 12 N", 40.0, 6.0, 6.0, 0.3, math.radians(90.0)),
)


class ManoeuvreDifference(NamedTuple):
    """Largest differences of plant and model, at the same times."""

    distance_m: float
    position_m: float
    heading_deg: float


def compare_manoeuvre(vessel: str, manoeuvre: Manoeuvre) -> ManoeuvreDifference:
    """Run plant and reference model through one manoeuvre."""
    expected, found = solve_reference(vessel, manoeuvre), simulate_plant(vessel, manoeuvre)
    return ManoeuvreDifference(
        distance_m=float(np.linalg.norm(np.diff(expected[:, :2], axis=0), axis=1).sum()),
        position_m=float(np.linalg.norm(found[:, :2] - expected[:, :2], axis=1).max()),
        heading_deg=max(abs(math.degrees(wrap_rad(float(turn)))) for turn in found[:, 2] - expected[:, 2]),
    )


def solve_reference(vessel: str, manoeuvre: Manoeuvre) -> F64:
    """`(n, 3)` x, y [m] and heading [rad] of the published model every `SAMPLE_S`."""
    times = np.arange(0.0, manoeuvre.seconds + 1e-9, SAMPLE_S)
    turn = manoeuvre.zigzag_rad

    def heading_reached(side: float) -> Callable[[float, F64], float]:
        def heading_left(_: float, state: F64) -> float:
            return float(state[2] - side * turn)

        heading_left.terminal = True  # type: ignore[attr-defined]  # how scipy is told to stop there
        heading_left.direction = side  # type: ignore[attr-defined]
        return heading_left

    state, start_s, side, parts = np.zeros(8), 0.0, 1.0, []
    while start_s < manoeuvre.seconds:
        fans = (manoeuvre.left_n, manoeuvre.right_n) if side > 0.0 else (manoeuvre.right_n, manoeuvre.left_n)
        run = solve_ivp(
            lambda _, x, fans=fans: _state_derivative(x, vessel, manoeuvre, np.array(fans)),
            (start_s, manoeuvre.seconds),
            state,
            rtol=1e-8,
            atol=1e-9,
            dense_output=True,
            events=heading_reached(side) if turn else None,
        )
        within = times[(times >= start_s) & (times < run.t[-1] + 1e-12)]
        parts.append(run.sol(within)[:3].T)
        state, start_s, side = run.y[:, -1], run.t[-1] + 1e-12, -side
    return np.vstack(parts)[: len(times)]


def _state_derivative(state: F64, vessel: str, manoeuvre: Manoeuvre, ordered_n: F64) -> F64:
    """Of x, y, heading, u, v, r and the two fans' forces; u, v, r over ground."""
    heading, rate = state[2], state[5]
    cos, sin = math.cos(heading), math.sin(heading)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    toward = manoeuvre.current_rad
    current = manoeuvre.current_mps * np.array([math.cos(toward), math.sin(toward), 0.0])
    through_water = state[3:6] - rotation.T @ current

    rigid = np.array([MASS_KG, MASS_KG, YAW_INERTIA_KGM2])
    added = rigid * (OTTER_ADDED if vessel == "otter" else 0.0)
    coriolis_rigid = MASS_KG * np.array([[0.0, -rate, 0.0], [rate, 0.0, 0.0], [0.0, 0.0, 0.0]])
    coriolis_added = np.array(
        [[0.0, 0.0, -added[1] * through_water[1]], [0.0, 0.0, added[0] * through_water[0]], [0.0, 0.0, 0.0]]
    )
    fans_n = state[6:8] if vessel == "otter" else ordered_n
    force = np.array([fans_n.sum(), 0.0, FAN_ARM_M * (fans_n[1] - fans_n[0])])
    force -= (LINEAR + QUADRATIC * np.abs(through_water)) * through_water
    if vessel == "otter":
        force += _wind_force(state[3:6] - rotation.T @ np.array([0.0, manoeuvre.wind_mps, 0.0]))
    through_rate = (force - (coriolis_rigid + coriolis_added) @ through_water) / (rigid + added)
    current_rate = rate * np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]) @ rotation.T @ current
    return np.concatenate([rotation @ state[3:6], through_rate + current_rate, (ordered_n - state[6:8]) / OTTER_LAG_S])


def _wind_force(through_air: F64) -> F64:
    """Section 10.1: 0.5 rho V^2 (A_F c_x cos, A_L c_y sin, A_L L c_n sin 2) of the angle the air comes from."""
    speed_mps, angle = math.hypot(through_air[0], through_air[1]), math.atan2(through_air[1], through_air[0])
    shape = (
        -FRONTAL_M2 * 0.5 * math.cos(angle),
        -LATERAL_M2 * 0.7 * math.sin(angle),
        -LATERAL_M2 * 1.3 * 0.05 * math.sin(2.0 * angle),
    )
    return 0.5 * 1.225 * speed_mps**2 * np.array(shape)


def simulate_plant(vessel: str, manoeuvre: Manoeuvre) -> F64:
    """`(n, 3)` as `solved`, of the plant."""
    plant = Plant(build_open_water(manoeuvre), PlantConfig(vessel=vessel))
    try:
        plant.place(0.0, 0.0, 0.0)
        left_n, right_n, side, track = manoeuvre.left_n, manoeuvre.right_n, 1.0, [(0.0, 0.0, 0.0)]
        steps_per_sample = round(SAMPLE_S * 100)
        for step in range(1, round(manoeuvre.seconds * 100) + 1):
            plant.step(left_n, right_n)
            heading = plant.attitude.yaw_rad
            if manoeuvre.zigzag_rad and side * heading >= manoeuvre.zigzag_rad:
                left_n, right_n, side = right_n, left_n, -side
            if step % steps_per_sample == 0:
                track.append((*plant.position_m, heading))
        return np.array(track)
    finally:
        plant.close()


def build_open_water(manoeuvre: Manoeuvre) -> World:
    """A broad channel along the current, without wind, with the boat in its middle."""
    along = np.array([math.cos(manoeuvre.current_rad), math.sin(manoeuvre.current_rad)])
    left = np.array([-along[1], along[0]])
    corners = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
    return dataclasses.replace(
        load_world("lake"),
        shore_m=HALF_WIDTH_M * np.array([x * along + y * left for x, y in corners]),
        channel_m=np.array([-HALF_WIDTH_M * along, HALF_WIDTH_M * along]),
        obstacles=(),
        actors=(),
        wind=Wind(manoeuvre.wind_mps, 0.5 * math.pi),
        current=Current(manoeuvre.current_mps, manoeuvre.current_rad),
    )


def compare_with_reference() -> FigureTable:
    """Every manoeuvre with both vessels."""
    rows = [
        (vessel, manoeuvre.name, *compare_manoeuvre(vessel, manoeuvre))
        for vessel in ("paper", "otter")
        for manoeuvre in MANOEUVRES
    ]
    return FigureTable(
        name="plant beside Fossen's 3-DOF model, solved with scipy",
        columns=("vessel", "manoeuvre", "way m", "position, largest difference m", "heading, largest difference deg"),
        rows=tuple(rows),
        note="zig-zag: the plant's helm looks every 10 ms, the model's at once. crossing: its current fades sideways",
    )
