"""World, plant, adapter and eye settings.

Ids such as `J7` name statements of the paper (`paani claims`).
"""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.section import Fraction, JpegQuality, NonNegative, Offset, Positive, Section, Size, Tilt
from paani.keys import VITAL_SERVICES

LensTerm = Annotated[float, msgspec.Meta(ge=-10.0, le=10.0)]


class WorldConfig(Section, frozen=True):
    """`name`: a world, a scenario, `random:WORLD:SEED` or a TOML file. Seed and wind unset: as the scenario says."""

    name: str = "river"
    # Of sensors, waves and gusts; unset: the scenario's.
    seed: Annotated[int, msgspec.Meta(ge=0, le=2**31)] | None = None
    wind_mps: NonNegative | None = None  # mean wind; unset: the scenario's


class SensorsConfig(Section, frozen=True):
    gps_rate_hz: Positive = 5.0  # of a common receiver
    gps_bias_std_m: NonNegative = 0.8  # per axis, of the part of the error that wanders
    gps_bias_time_s: Positive = 60.0  # over which that part forgets itself
    gps_white_std_m: NonNegative = 0.05  # of the part that is new in each fix
    gps_speed_std_mps: NonNegative = 0.05  # of the speed over ground, per axis
    imu_rate_hz: Positive = 100.0  # of a common sensor
    gyro_noise_radps: NonNegative = 0.002  # of one sample
    gyro_bias_std_radps: NonNegative = 0.002  # constant over a drive, drawn at its start
    accel_noise_mps2: NonNegative = 0.03  # of one sample
    compass_noise_rad: NonNegative = 0.01  # of one sample
    tilt_noise_rad: NonNegative = 0.001  # of one sample of roll or pitch, which a unit levels over seconds
    compass_bias_std_rad: NonNegative = 0.02  # constant over a drive, drawn at its start
    ais: bool = True  # whether the boat has a receiver
    lidar: bool = False  # whether it has a range scanner, which costs as much as the board
    sonar: bool = False  # whether the boat has an echo sounder: most small boats have none
    sonar_rate_hz: Positive = 5.0  # of a common one; NMEA sounders speak once or twice a second
    sonar_std_m: NonNegative = 0.01  # of one sounding, as cheap sounders state it
    sonar_std_frac: NonNegative = 0.01  # of one sounding, of its range, as cheap sounders state it
    sonar_min_m: NonNegative = 0.3  # blind zone under the transducer, while it still rings
    sonar_max_m: Positive = 50.0  # beyond it no echo of a soft bottom comes back


class AdapterConfig(Section, frozen=True):
    """The thrust adapter, the last decision before force. `astern`: the most that it lets a fan push astern."""

    force_per_unit_n: Positive = 75.0  # O1
    astern: Fraction = 0.10  # `controller.astern`
    timeout_s: Positive = 0.5  # O2
    max_echo_age_s: Positive = 0.5  # of the plant's stamp that an order echoes, by the plant's own clock
    arming_timeout_s: Positive = 0.5  # two periods and a half of the operator's word
    pulse_timeout_s: Positive = 0.35  # leaves 0.15 s of the 0.5 s for the last beat's journey and one step
    require_pulses: tuple[str, ...] = VITAL_SERVICES  # vital processes; one that is silent means zero thrust


class PlantConfig(Section, frozen=True):
    step_s: Positive = 0.01  # of the integration, small beside every time constant of the hull
    publish_rate_hz: Positive = 20.0  # of clock, pose and applied thrust: twice the controller's rate
    vessel: str | None = None  # its name among the vessels, or a TOML file of the same form; None: the scenario's
    # Where an emulated microcontroller says what pulses it gives; profile hil moves the boat by them alone.
    pwm_line: str = ""
    sensors: SensorsConfig = SensorsConfig()
    adapter: AdapterConfig = AdapterConfig()


class EyeConfig(Section, frozen=True):
    """The simulated camera. `lens_k1`, `lens_k2`: radial distortion after Brown, over focal length; zero: a pinhole.

    `shutter_s` is how long a picture is exposed while the boat turns; `blue_gain` and `red_gain` are its white balance.
    """

    rate_hz: Positive = 5.0  # as `camera.rate_hz`
    width_px: Size = 320  # as `camera.width_px`
    height_px: Size = 240  # as `camera.height_px`
    jpeg_quality: JpegQuality = 85  # as `camera.jpeg_quality`
    camera_height_m: Positive = 0.9  # above the water, boat at rest
    camera_forward_m: Offset = 0.55  # ahead of the boat's middle
    pitch_down_deg: Tilt = 6.0  # shows the water before the bow, and the horizon at 0.4 of the picture's height
    hfov_deg: Positive = 70.0  # a common webcam; `wide` has 102
    exposure_frac: Fraction = 1.0  # of the exposure that suits the light; less is darker
    lens_k1: LensTerm = 0.0
    lens_k2: LensTerm = 0.0
    shutter_s: NonNegative = 0.0
    blue_gain: Positive = 1.0
    red_gain: Positive = 1.0
