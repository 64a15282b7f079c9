"""Wind sea: JONSWAP components in deep water, and the response of a hull of finite length to one.

Spectrum and fetch laws: K. Hasselmann et al., Measurements of wind-wave growth and swell decay during the
Joint North Sea Wave Project (JONSWAP), Dt. Hydrogr. Z. A8 no. 12, 1973. Spreading: cos^2 about the wind.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

GRAVITY_MPS2 = 9.81
COMPONENTS = 12
PEAK_ENHANCEMENT = 3.3  # gamma of the mean JONSWAP spectrum
_BAND_OF_PEAK = (0.5, 4.0)  # frequencies kept, of the peak's: beyond them lies less than 1 % of the energy


class Component(NamedTuple):
    """One regular wave, `amplitude_m * cos(kx x + ky y - omega t + phase)`."""

    amplitude_m: float
    kx_radpm: float
    ky_radpm: float
    omega_radps: float
    phase_rad: float


def significant_height_m(wind_mps: float, fetch_m: float) -> float:
    """Hs = 0.0016 sqrt(g F / U^2) U^2 / g, of a sea limited by its fetch (Hasselmann 1973)."""
    return 0.0016 * math.sqrt(GRAVITY_MPS2 * fetch_m) * wind_mps / GRAVITY_MPS2


def peak_omega_radps(wind_mps: float, fetch_m: float) -> float:
    """omega_p = 22 (g^2 / (U F))^(1/3)."""
    return 22.0 * math.cbrt(GRAVITY_MPS2**2 / (wind_mps * fetch_m))


def spectrum_m2s(omega_radps: npt.NDArray[np.float64], wind_mps: float, fetch_m: float) -> npt.NDArray[np.float64]:
    """Spectral density [m^2 s / rad] at `omega_radps` > 0."""
    peak = peak_omega_radps(wind_mps, fetch_m)
    alpha = 0.076 * (wind_mps**2 / (fetch_m * GRAVITY_MPS2)) ** 0.22
    width = np.where(omega_radps <= peak, 0.07, 0.09)
    enhanced = PEAK_ENHANCEMENT ** np.exp(-((omega_radps - peak) ** 2) / (2.0 * (width * peak) ** 2))
    density = alpha * GRAVITY_MPS2**2 * omega_radps**-5.0 * np.exp(-1.25 * (peak / omega_radps) ** 4) * enhanced
    return np.asarray(density)


def wind_sea(wind_mps: float, toward_rad: float, fetch_m: float, rng: np.random.Generator) -> tuple[Component, ...]:
    """`COMPONENTS` waves of equal energy that add up to the spectrum; none without wind or fetch.

    Each stands for one band of the spectrum that holds its share, at that band's middle; direction and
    phase are drawn.
    """
    if wind_mps <= 0.0 or fetch_m <= 0.0:
        return ()
    omega = np.linspace(*_BAND_OF_PEAK, 2000) * peak_omega_radps(wind_mps, fetch_m)
    energy = np.cumsum(spectrum_m2s(omega, wind_mps, fetch_m)) * (omega[1] - omega[0])
    shares = (np.arange(COMPONENTS) + 0.5) / COMPONENTS
    omegas = np.interp(shares * energy[-1], energy, omega)
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 400)
    spread = np.cumsum(np.cos(angle) ** 2)
    directions = toward_rad + np.interp(rng.permutation(shares), spread / spread[-1], angle)
    phases = rng.uniform(0.0, 2.0 * np.pi, COMPONENTS)
    amplitude_m = math.sqrt(2.0 * float(energy[-1]) / COMPONENTS)
    k = omegas**2 / GRAVITY_MPS2
    rows = zip(k * np.cos(directions), k * np.sin(directions), omegas, phases, strict=True)
    return tuple(Component(amplitude_m, *map(float, row)) for row in rows)


class HullResponse(NamedTuple):
    """Response of a hull of two slender pontoons to a regular wave, per metre of its amplitude.

    The mean elevation under it (in phase with the crest) and the slopes that turn it (a quarter period off).
    """

    elevation: float
    slope_ahead_pm: float
    slope_left_pm: float


def hull_response(kx_radpm: float, ky_radpm: float, yaw_rad: float, length_m: float, spacing_m: float) -> HullResponse:
    """Averages of the wave over two waterlines (Froude-Krylov): along the hull the elevation falls as sinc(k L / 2)."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    ahead, left = kx_radpm * cos + ky_radpm * sin, ky_radpm * cos - kx_radpm * sin
    along, across = 0.5 * ahead * length_m, 0.5 * left * spacing_m
    mean = _sinc(along)
    return HullResponse(
        elevation=mean * math.cos(across),
        slope_ahead_pm=ahead * _slope(along) * math.cos(across),
        slope_left_pm=left * mean * _sinc(across),
    )


def _sinc(x: float) -> float:
    return math.sin(x) / x if abs(x) > 1e-6 else 1.0


def _slope(x: float) -> float:
    """Least-squares slope of cos over [-x, x] as a part of the slope in the middle."""
    return 3.0 * (math.sin(x) - x * math.cos(x)) / x**3 if abs(x) > 1e-2 else 1.0 - x * x / 10.0
