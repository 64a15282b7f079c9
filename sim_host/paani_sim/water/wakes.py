"""Wakes of passing vessels: packets of the diverging waves at the cusp of Kelvin's wedge, in deep water.

Where they run, and how long they are: Lord Kelvin 1887; T. H. Havelock, Proc. R. Soc. A 81, 1908. How high:
secondary ship waves in CIRIA/CUR/CETMEF, The Rock Manual, 2007, section 4.3.4, which fall with d^(-1/3).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from paani_sim.water.waves import GRAVITY_MPS2

CUSP_RAD = math.acos(math.sqrt(2.0 / 3.0))  # 35.3 degrees between the course and the waves at the cusp
DEPTH_M = 3.0  # of the water under the vessels, for the height alone
MIN_HEIGHT_M = 0.005
MAX_DISTANCE_M = 60.0  # from the sailing line
MIN_SPEED_MPS = 0.5
PACKET_REACH_STD = 3.0  # standard deviations from its middle, beyond which a packet is neglected
MAX_PACKETS = 4096


class WakeSource(NamedTuple):
    """A vessel under way."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    width_m: float


class Packet(NamedTuple):
    """A train of waves `amplitude_m cos(kx (x - x_m) + ky (y - y_m) - omega (t - at_s))`.

    Gaussian about a middle that leaves `x_m, y_m` at `at_s` with velocity `vx_mps, vy_mps`.
    """

    x_m: float
    y_m: float
    at_s: float
    kx_radpm: float
    ky_radpm: float
    omega_radps: float
    vx_mps: float
    vy_mps: float
    spread_m: float
    amplitude_m: float


def wavelength_m(speed_mps: float) -> float:
    """2 pi U^2 / g cos^2(35.3 deg)."""
    return 2.0 * math.pi * speed_mps**2 / GRAVITY_MPS2 * math.cos(CUSP_RAD) ** 2


def height_m(speed_mps: float, distance_m: float) -> float:
    """H = 1.2 h (d / h)^(-1/3) U^4 / (g h)^2 at `distance_m` from the sailing line."""
    froude2 = speed_mps**2 / (GRAVITY_MPS2 * DEPTH_M)
    return 1.2 * DEPTH_M / math.cbrt(distance_m / DEPTH_M) * froude2**2


def emit_packets(source: WakeSource, at_s: float, since_m: float) -> tuple[Packet, Packet]:
    """The packets to port and starboard of a vessel that has gone `since_m` since its last ones.

    Their crests continue those of the packets before, for omega = k U cos(35.3 deg); their amplitude is of the
    height `DEPTH_M` away, shared so that all packets of a straight course add up to it.
    """
    spread_m = wavelength_m(source.speed_mps)
    k = 2.0 * math.pi / spread_m
    phase_mps = source.speed_mps * math.cos(CUSP_RAD)
    share = since_m * math.sqrt(0.5) / (math.sqrt(2.0 * math.pi) * spread_m)
    amplitude_m = 0.5 * share * height_m(source.speed_mps, DEPTH_M)

    def emit_packet(side: float) -> Packet:
        cos, sin = math.cos(source.yaw_rad + side * CUSP_RAD), math.sin(source.yaw_rad + side * CUSP_RAD)
        return Packet(
            source.x_m, source.y_m, at_s, k * cos, k * sin, k * phase_mps,
            0.5 * phase_mps * cos, 0.5 * phase_mps * sin, spread_m, amplitude_m,
        )  # fmt: skip

    return emit_packet(1.0), emit_packet(-1.0)


class Wakes:
    """All wave packets under way."""

    def __init__(self, sources: int) -> None:
        """`sources`: number of vessels that `update_vessels` will be given, always in the same order."""
        self._last_m = [(math.inf, math.inf)] * sources
        self._packets: npt.NDArray[np.float64] = np.zeros((MAX_PACKETS, len(Packet._fields)))
        self._launched = 0

    def update_vessels(self, sources: Sequence[WakeSource], at_s: float) -> None:
        """Take the vessels' poses; one that makes waves emits a pair of packets every wavelength along its course."""
        for index, source in enumerate(sources):
            last_x_m, last_y_m = self._last_m[index]
            since_m = math.hypot(source.x_m - last_x_m, source.y_m - last_y_m)
            if source.speed_mps < MIN_SPEED_MPS or height_m(source.speed_mps, source.width_m) < MIN_HEIGHT_M:
                self._last_m[index] = source.x_m, source.y_m
            elif since_m >= wavelength_m(source.speed_mps):
                if math.isfinite(since_m):
                    for packet in emit_packets(source, at_s, since_m):
                        self._packets[self._launched % MAX_PACKETS] = packet
                        self._launched += 1
                self._last_m[index] = source.x_m, source.y_m

    def packets_near(self, x_m: float, y_m: float, at_s: float, within_m: float) -> list[Packet]:
        """The packets whose reach comes `within_m` of a place now, with the height they have there."""
        if not self._launched:
            return []
        packets = self._packets[: self._launched]
        age_s = at_s - packets[:, 2]
        middle_x = packets[:, 0] + packets[:, 6] * age_s - x_m
        middle_y = packets[:, 1] + packets[:, 7] * age_s - y_m
        close = np.hypot(middle_x, middle_y) < PACKET_REACH_STD * packets[:, 8] + within_m
        found = []
        for index in np.flatnonzero(close).tolist():
            packet = Packet(*packets[index].tolist())
            gone_m = math.hypot(packet.vx_mps, packet.vy_mps) * (at_s - packet.at_s) * math.sin(CUSP_RAD)
            amplitude_m = packet.amplitude_m / math.cbrt(max(gone_m, packet.spread_m) / DEPTH_M)
            if gone_m < MAX_DISTANCE_M:
                found.append(packet._replace(amplitude_m=amplitude_m))
        return found
