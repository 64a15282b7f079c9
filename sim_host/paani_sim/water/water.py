"""The water and air about one hull, from moment to moment: waves, wakes, current and wind together."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from paani_sim.vessels import Vessel
from paani_sim.water.current import CurrentField
from paani_sim.water.surroundings import CALM, Surroundings
from paani_sim.water.wakes import PACKET_REACH_STD, Packet, Wakes, WakeSource
from paani_sim.water.waves import HullResponse, hull_response, wind_sea
from paani_sim.water.wind import Gusts
from paani_sim.worlds.world import World

SURFACE_UPDATE_S = 0.02  # the shortest waves that the hull responds to have a period of 0.4 s
SLOW_UPDATE_S = 0.1  # period of updates of gusts, current and the response at the present heading
PACKET_MARGIN_M = 1.0  # by which boat and packets may approach each other in that time


class WaveTrain(NamedTuple):
    """One regular wave and the hull's response to it."""

    kx_radpm: float
    ky_radpm: float
    omega_radps: float
    phase_rad: float
    elevation_m: float
    slope_ahead: float
    slope_left: float
    amplitude_m: float


class Water:
    """Surroundings of a hull that moves; equal seeds and calls give equal surroundings."""

    def __init__(self, world: World, vessel: Vessel, sources: int, seed: np.random.SeedSequence) -> None:
        """`sources`: number of vessels that `update_vessels` will be given."""
        waves, gusts = seed.spawn(2)
        wind = world.wind
        self._length_m, self._spacing_m = vessel.hull.length_m, vessel.hull.spacing_m
        self._sea = wind_sea(wind.speed_mps, wind.toward_rad, world.waves.fetch_m, np.random.default_rng(waves))
        self._gusts = Gusts(wind, SLOW_UPDATE_S, np.random.default_rng(gusts))
        self._current = CurrentField(world)
        self._wakes = Wakes(sources)
        self._toward = math.cos(wind.toward_rad), math.sin(wind.toward_rad)
        self._slow_updated_s = self._surface_updated_s = -math.inf
        self._trains: list[WaveTrain] = []
        self._packets: list[tuple[Packet, HullResponse]] = []
        self._now = CALM

    def update_vessels(self, sources: Sequence[WakeSource], at_s: float) -> None:
        """Take the poses of the other vessels."""
        self._wakes.update_vessels(sources, at_s)

    def surroundings_at(self, x_m: float, y_m: float, yaw_rad: float, at_s: float) -> Surroundings:
        """Surroundings of the hull; `at_s` [simulated s] must not decrease from call to call."""
        if at_s - self._slow_updated_s >= SLOW_UPDATE_S - 1e-9:
            self._slow_updated_s = at_s
            self._update_slow(x_m, y_m, yaw_rad, at_s)
        if (self._trains or self._packets) and at_s - self._surface_updated_s >= SURFACE_UPDATE_S - 1e-9:
            self._surface_updated_s = at_s
            self._now = _add_surface(self._now, self._trains, self._packets, self._toward, (x_m, y_m, at_s))
        return self._now

    def _update_slow(self, x_m: float, y_m: float, yaw_rad: float, at_s: float) -> None:
        self._trains = []
        for wave in self._sea:
            a, kx, ky, omega, phase = wave
            response = self._hull_response(kx, ky, yaw_rad)
            lift, ahead, left = a * response.elevation, a * response.slope_ahead_pm, a * response.slope_left_pm
            self._trains.append(WaveTrain(kx, ky, omega, phase, lift, ahead, left, a))
        packets = self._wakes.packets_near(x_m, y_m, at_s, PACKET_MARGIN_M)
        self._packets = [(packet, self._hull_response(packet.kx_radpm, packet.ky_radpm, yaw_rad)) for packet in packets]
        self._now = Surroundings(
            *self._current.at(x_m, y_m), *self._gusts.velocity_mps, *(self._now[4:] if self._trains or packets else ())
        )
        self._gusts.advance()

    def _hull_response(self, kx_radpm: float, ky_radpm: float, yaw_rad: float) -> HullResponse:
        return hull_response(kx_radpm, ky_radpm, yaw_rad, self._length_m, self._spacing_m)


def _add_surface(
    now: Surroundings,
    trains: list[WaveTrain],
    packets: list[tuple[Packet, HullResponse]],
    toward: tuple[float, float],
    here: tuple[float, float, float],
) -> Surroundings:
    """Add the water's surface at this place to `now`."""
    x_m, y_m, at_s = here
    cos, sin = math.cos, math.sin
    elevation = rate = ahead = left = ahead_rate = left_rate = crest = quarter = 0.0
    for kx, ky, omega, phase, lift, slope_ahead, slope_left, amplitude in trains:
        angle = kx * x_m + ky * y_m - omega * at_s + phase
        c, s = cos(angle), sin(angle)
        elevation += lift * c
        rate += lift * omega * s
        ahead -= slope_ahead * s
        left -= slope_left * s
        ahead_rate += slope_ahead * omega * c
        left_rate += slope_left * omega * c
        crest += amplitude * c
        quarter += amplitude * s
    for packet, response in packets:
        px, py, since_s = x_m - packet.x_m, y_m - packet.y_m, at_s - packet.at_s
        off_m = math.hypot(px - packet.vx_mps * since_s, py - packet.vy_mps * since_s)
        if off_m < PACKET_REACH_STD * packet.spread_m:
            a = packet.amplitude_m * math.exp(-0.5 * (off_m / packet.spread_m) ** 2)
            angle = packet.kx_radpm * px + packet.ky_radpm * py - packet.omega_radps * since_s
            c, s = a * cos(angle), a * sin(angle)
            elevation += response.elevation * c
            rate += response.elevation * packet.omega_radps * s
            ahead -= response.slope_ahead_pm * s
            left -= response.slope_left_pm * s
            ahead_rate += response.slope_ahead_pm * packet.omega_radps * c
            left_rate += response.slope_left_pm * packet.omega_radps * c
    envelope_m2 = crest * crest + quarter * quarter
    envelope = envelope_m2 * toward[0], envelope_m2 * toward[1]
    return Surroundings(*now[:4], elevation, rate, ahead, left, ahead_rate, left_rate, *envelope)
