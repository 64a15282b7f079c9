"""World, plant, adapter and eye settings.

Ids such as `J7` name statements of the paper (`paani claims`).
"""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.section import Fraction, NonNegative, Positive, Section, Size
from paani.keys import VITAL_SERVICES


class WorldConfig(Section, frozen=True):
    """`name`: a world, a scenario, `random:WORLD:SEED` or a TOML file. Seed and wind unset: as the scenario says."""

    name: str = "river"
    seed: Annotated[int, msgspec.Meta(ge=0, le=2**31)] | None = None
    wind_mps: NonNegative | None = None


class SensorsConfig(Section, frozen=True):
    gps_rate_hz: Positive = 5.0
    gps_bias_std_m: NonNegative = 0.8
    gps_bias_time_s: Positive = 60.0
    gps_white_std_m: NonNegative = 0.05
    gps_speed_std_mps: NonNegative = 0.05
    imu_rate_hz: Positive = 100.0
    gyro_noise_radps: NonNegative = 0.002
    gyro_bias_std_radps: NonNegative = 0.002
    accel_noise_mps2: NonNegative = 0.03
    compass_noise_rad: NonNegative = 0.01
    compass_bias_std_rad: NonNegative = 0.02


class AdapterConfig(Section, frozen=True):
    """The last gate before force. `astern`: the most that it lets a fan push astern."""

    force_per_unit_n: Positive = 75.0  # O1
    astern: Fraction = 0.10  # `controller.astern`
    timeout_s: Positive = 0.5  # O2
    max_echo_age_s: Positive = 0.5
    arming_timeout_s: Positive = 0.5
    pulse_timeout_s: Positive = 0.35  # leaves 0.15 s of the 0.5 s for the last beat's journey and one step
    require_pulses: tuple[str, ...] = VITAL_SERVICES


class PlantConfig(Section, frozen=True):
    step_s: Positive = 0.01
    publish_rate_hz: Positive = 20.0
    vessel: str | None = None  # its name among the vessels, or a TOML file of the same form; None: the scenario's
    sensors: SensorsConfig = SensorsConfig()
    adapter: AdapterConfig = AdapterConfig()


class EyeConfig(Section, frozen=True):
    """The simulated camera. `lens_k1`, `lens_k2`: radial distortion after Brown, over focal length; zero: a pinhole.

    `shutter_s` is how long a picture is exposed while the boat turns; `blue_gain` and `red_gain` are its white balance.
    """

    rate_hz: Positive = 5.0
    width_px: Size = 320
    height_px: Size = 240
    jpeg_quality: Size = 85
    camera_height_m: Positive = 0.9
    camera_forward_m: float = 0.55
    pitch_down_deg: float = 6.0
    hfov_deg: Positive = 70.0
    exposure_frac: Fraction = 1.0
    lens_k1: float = 0.0
    lens_k2: float = 0.0
    shutter_s: NonNegative = 0.0
    blue_gain: Positive = 1.0
    red_gain: Positive = 1.0
