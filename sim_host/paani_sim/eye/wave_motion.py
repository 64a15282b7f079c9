"""Heave, roll and pitch of floating things in the wind sea. Pure."""

from typing import NamedTuple

import numpy as np

from paani_sim.water.waves import GRAVITY_MPS2, peak_omega_radps, significant_height_m
from paani_sim.worlds.sizes import is_afloat_by_nature
from paani_sim.worlds.world import Actor, Kind, Obstacle, Pose2, Waves, Wind

MIN_SPEED_MPS = 0.3  # of a wind that moves the water at all
DEFAULT_FETCH_M = 40.0  # of a world that names none: the eye's ripples need some water to grow on
ROCKING_STD_RAD = 0.012  # how far a small boat is rocked by its own mooring and crew, standard deviation

FLOATING_PIERS = ("pontoon", "finger")


class SeaState(NamedTuple):
    """Significant height, peak period and the way the waves run."""

    height_m: float
    period_s: float
    toward_rad: float

    @property
    def wave_m(self) -> float:
        """Length of the wave at the peak, in deep water."""
        return GRAVITY_MPS2 * self.period_s**2 / (2.0 * np.pi)


class WaveMotion(NamedTuple):
    """Displacement of a thing from its rest."""

    up_m: float
    roll_rad: float
    pitch_rad: float


def wind_sea_state(wind: Wind, waves: Waves) -> SeaState:
    """The wind sea of a world."""
    speed_mps, fetch_m = max(wind.speed_mps, MIN_SPEED_MPS), max(waves.fetch_m or DEFAULT_FETCH_M, 1.0)
    period_s = 2.0 * np.pi / peak_omega_radps(speed_mps, fetch_m)
    return SeaState(significant_height_m(speed_mps, fetch_m), period_s, wind.toward_rad)


def is_floating(thing: Obstacle | Actor) -> bool:
    """Whether a thing moves with the water."""
    return (
        isinstance(thing, Actor)
        or is_afloat_by_nature(thing)
        or (thing.kind is Kind.PIER and thing.look in FLOATING_PIERS)
    )


def compute_wave_motion(sea: SeaState, thing: Obstacle | Actor, pose: Pose2, t_s: float) -> WaveMotion:
    """A long wave through the thing's middle, taken less seriously the longer the thing is; and its own rocking."""
    k_radpm = 2.0 * np.pi / sea.wave_m
    omega = 2.0 * np.pi / sea.period_s
    along = np.cos(sea.toward_rad) * pose.x_m + np.sin(sea.toward_rad) * pose.y_m
    off = pose.yaw_rad - sea.toward_rad
    phase = k_radpm * along - omega * t_s
    fore = _filtered(k_radpm * thing.length_m * np.cos(off))
    side = _filtered(k_radpm * thing.width_m * np.sin(off))
    beat = 0.7 + 0.3 * np.sin(0.31 * omega * t_s + 0.7 * along)
    amplitude = 0.5 * sea.height_m * beat
    slope = k_radpm * amplitude
    moored = thing.kind is Kind.PIER
    rock = 0.0 if moored else ROCKING_STD_RAD * min(1.5, 2.0 / max(thing.width_m, 0.3))
    own = np.sin(2.1 * t_s / np.sqrt(max(thing.width_m, 0.4)) + 1.7 * pose.x_m + 0.9 * pose.y_m)
    return WaveMotion(
        float(amplitude * fore * side * np.sin(phase)),
        float(np.clip(slope * fore * side * np.cos(phase) * np.sin(off), -0.15, 0.15) + rock * own),
        float(np.clip(-slope * fore * side * np.cos(phase) * np.cos(off), -0.1, 0.1)),
    )


def _filtered(angle: float) -> float:
    """Mean of a wave over a length that spans `angle` of it: |sinc|."""
    return float(abs(np.sinc(0.5 * angle / np.pi)))
