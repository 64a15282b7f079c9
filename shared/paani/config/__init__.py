"""Configuration: one frozen tree, layered from defaults, a file, the environment and the command line."""

from paani.config.advisor import (
    AdvisorConfig,
    MotionConfig,
    PeopleConfig,
    PolicyConfig,
    RiskConfig,
    TrackerConfig,
    TuningConfig,
)
from paani.config.autopilot import AutopilotConfig
from paani.config.bridge import BridgeConfig
from paani.config.button import ButtonConfig
from paani.config.foxglove import FoxgloveConfig
from paani.config.guidance import ControllerConfig, LocalizationConfig, NavigatorConfig
from paani.config.loading import decode_config, encode_config, load_config, with_settings
from paani.config.mavlink import MavlinkConfig
from paani.config.perception import (
    CameraConfig,
    CandidateConfig,
    CorridorConfig,
    DetectorConfig,
    EngineName,
    ImageQualityConfig,
    PerceptionConfig,
)
from paani.config.planner import CalibrationConfig, PlannerConfig, calibration_of
from paani.config.profiles import PROFILES
from paani.config.recorder import RecorderConfig
from paani.config.sensors import (
    AisConfig,
    GpsConfig,
    HeadingConfig,
    ImuConfig,
    LidarConfig,
    SensorDevicesConfig,
    SonarConfig,
)
from paani.config.simulator import AdapterConfig, EyeConfig, PlantConfig, SensorsConfig, WorldConfig
from paani.config.thrusters import EscConfig, ThrustersConfig
from paani.config.tree import BusConfig, Config, DashboardConfig

__all__ = [
    "PROFILES",
    "AdapterConfig",
    "AdvisorConfig",
    "AisConfig",
    "AutopilotConfig",
    "BridgeConfig",
    "BusConfig",
    "ButtonConfig",
    "CalibrationConfig",
    "CameraConfig",
    "CandidateConfig",
    "Config",
    "ControllerConfig",
    "CorridorConfig",
    "DashboardConfig",
    "DetectorConfig",
    "EngineName",
    "EscConfig",
    "EyeConfig",
    "FoxgloveConfig",
    "GpsConfig",
    "HeadingConfig",
    "ImageQualityConfig",
    "ImuConfig",
    "LidarConfig",
    "LocalizationConfig",
    "MavlinkConfig",
    "MotionConfig",
    "NavigatorConfig",
    "PeopleConfig",
    "PerceptionConfig",
    "PlannerConfig",
    "PlantConfig",
    "PolicyConfig",
    "RecorderConfig",
    "RiskConfig",
    "SensorDevicesConfig",
    "SensorsConfig",
    "SonarConfig",
    "ThrustersConfig",
    "TrackerConfig",
    "TuningConfig",
    "WorldConfig",
    "calibration_of",
    "decode_config",
    "encode_config",
    "load_config",
    "with_settings",
]
