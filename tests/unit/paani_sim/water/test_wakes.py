"""Wakes: where Kelvin's cusp lies, how long and how high its waves are."""

import math

import numpy as np
import pytest

from paani_sim.water.wakes import CUSP_RAD, DEPTH_M, Wakes, WakeSource, emit_packets, height_m, wavelength_m

SPEED_MPS = 2.5
KELVIN_RAD = math.asin(1.0 / 3.0)  # half angle of the wedge: 19.47 degrees


def passed(speed_mps: float, seconds: float = 60.0) -> Wakes:
    """A vessel that has run east along y = 0 and is at the origin after `seconds`."""
    wakes = Wakes(1)
    for t_s in np.arange(0.0, seconds + 1e-9, 0.05):
        wakes.update_vessels([WakeSource(speed_mps * (t_s - seconds), 0.0, 0.0, speed_mps, 2.0)], float(t_s))
    return wakes


def surface_m(wakes: Wakes, x_m: float, y_m: float, t_s: float) -> complex:
    """Elevation, and a quarter period later."""
    total = 0j
    for packet in wakes.packets_near(x_m, y_m, t_s, 0.0):
        age_s = t_s - packet.at_s
        px, py = x_m - packet.x_m, y_m - packet.y_m
        off_m = math.hypot(px - packet.vx_mps * age_s, py - packet.vy_mps * age_s)
        phase = packet.kx_radpm * px + packet.ky_radpm * py - packet.omega_radps * age_s
        amplitude_m = packet.amplitude_m * math.exp(-0.5 * (off_m / packet.spread_m) ** 2)
        total += amplitude_m * complex(math.cos(phase), math.sin(phase))
    return total


def test_wavelength_and_height() -> None:
    """lambda = 2 pi U^2 / g (2/3) = 4.19 U^2 / g; H falls with d^(-1/3) and rises with U^4."""
    assert wavelength_m(3.0) == pytest.approx(4.19 * 9.0 / 9.81, rel=1e-3)
    assert height_m(3.0, 8.0) == pytest.approx(height_m(3.0, 1.0) / 2.0)
    assert height_m(2.0, 5.0) == pytest.approx(16.0 * height_m(1.0, 5.0))
    assert height_m(3.0, 10.0) == pytest.approx(0.226, abs=0.002)


def test_packets_keep_the_crests_of_those_before() -> None:
    """omega = k U cos 35.3 deg: the wave that the vessel meets stands still for it; and it is a deep-water wave."""
    packet, _ = emit_packets(WakeSource(0.0, 0.0, 0.3, SPEED_MPS, 2.0), 0.0, 1.0)
    k = math.hypot(packet.kx_radpm, packet.ky_radpm)
    assert packet.omega_radps == pytest.approx(k * SPEED_MPS * math.cos(CUSP_RAD))
    assert packet.omega_radps**2 == pytest.approx(9.81 * k)
    assert math.hypot(packet.vx_mps, packet.vy_mps) == pytest.approx(0.5 * packet.omega_radps / k)


def test_wake_lies_on_the_cusp() -> None:
    """40 m astern the waves are highest on the edges of Kelvin's wedge, and as high as the formula says."""
    wakes = passed(SPEED_MPS)
    offsets_m = np.linspace(0.0, 30.0, 121)
    heights_m = [2.0 * abs(surface_m(wakes, -40.0, float(y), 60.0)) for y in offsets_m]
    cusp_m = 40.0 * math.tan(KELVIN_RAD)
    assert offsets_m[int(np.argmax(heights_m))] == pytest.approx(cusp_m, abs=0.5)
    assert max(heights_m) == pytest.approx(height_m(SPEED_MPS, cusp_m), rel=0.1)
    assert 2.0 * abs(surface_m(wakes, -40.0, -cusp_m, 60.0)) == pytest.approx(max(heights_m), rel=0.02)
    assert heights_m[0] < 0.05 * max(heights_m)


def test_no_wake_ahead_and_none_from_slow_vessels() -> None:
    assert abs(surface_m(passed(SPEED_MPS), 10.0, 0.0, 60.0)) == 0.0
    assert passed(0.9).packets_near(-20.0, 7.0, 60.0, 50.0) == []


def test_wake_runs_on_when_its_source_stops() -> None:
    wakes = passed(SPEED_MPS, 20.0)
    for step in range(200):
        wakes.update_vessels([WakeSource(0.0, 0.0, 0.0, 0.0, 2.0)], 20.0 + 0.05 * step)
    gone_m = 0.5 * SPEED_MPS * math.cos(CUSP_RAD) * 10.0
    abeam_m = gone_m * math.sin(CUSP_RAD)
    assert abs(surface_m(wakes, gone_m * math.cos(CUSP_RAD) - 2.0, abeam_m, 30.0)) > 0.1 * height_m(SPEED_MPS, DEPTH_M)
