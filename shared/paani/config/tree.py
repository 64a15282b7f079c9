"""The whole configuration, and the settings that cannot work together."""

from __future__ import annotations

import re
from typing import Annotated, Literal

import msgspec

from paani.config.advisor import AdvisorConfig
from paani.config.bridge import BridgeConfig
from paani.config.button import ButtonConfig
from paani.config.foxglove import FoxgloveConfig
from paani.config.guidance import ControllerConfig, LocalizationConfig, NavigatorConfig
from paani.config.mavlink import MavlinkConfig
from paani.config.nmea import NmeaConfig
from paani.config.perception import CameraConfig, PerceptionConfig
from paani.config.planner import CalibrationConfig
from paani.config.recorder import RecorderConfig
from paani.config.ros2 import Ros2Config, require_ros_name
from paani.config.section import Positive, Section
from paani.config.sensors import SensorDevicesConfig
from paani.config.simulator import AdapterConfig, EyeConfig, PlantConfig, WorldConfig
from paani.config.thrusters import ThrustersConfig
from paani.keys import BUTTON, PORTS, Graph
from paani.port_address import parse_address, parse_endpoint
from paani.sides import Side, services_on

Port = Annotated[int, msgspec.Meta(ge=1, le=65535)]
ShortName = Annotated[str, msgspec.Meta(pattern="^[a-z0-9_]{1,32}$")]


EMULATED_LINES = "socket://127.0.0.1:PORT or serial:/dev/pts/N"
# Every other profile is a simulation.
GRAPHS = {"hil": Graph.HIL, "hull": Graph.HULL}


class BusConfig(Section, frozen=True):
    """`runtime_dir` holds credentials and the stop latch; empty: a folder of this user's."""

    domain: Annotated[int, msgspec.Meta(ge=0, le=65535)] = 43  # A6
    vessel: ShortName = "otter"  # the boat's name in every key
    router: str = "tcp/127.0.0.1:7447"  # where the router listens: this machine alone
    side: Side = Side.BOTH  # which processes run here; `paani up --only` sets it
    # Where board and host meet (tcp/ADDRESS:PORT of the board): the board's router listens there, the host's connects.
    link: str = ""
    # Where the shore of a fleet signs in (tcp/ADDRESS:PORT of the vessel; of two machines the board's). Empty: nowhere.
    shore: str = ""
    # Folder of `paani certs make`: the bus is encrypted, and who speaks is told by certificate. Empty: by password.
    certificates: str = ""
    runtime_dir: str = ""
    graph: Graph = Graph.SIMULATION  # set by the profiles `hil` and `hull` alone; it decides who may write what
    lease_ms: Annotated[int, msgspec.Meta(ge=200, le=10_000)] = 1000  # a link that was silent for so long counts as cut
    max_future_s: Positive = 1.0  # a stamp further ahead than two machines' clocks may differ is refused

    def __post_init__(self) -> None:
        """Refuse what is no address."""
        for name, address in (("router", self.router), ("link", self.link), ("shore", self.shore)):
            if address or name == "router":
                try:
                    parse_endpoint(address)
                except ValueError as error:
                    raise ValueError(f"{name} {error}") from error


class DashboardConfig(Section, frozen=True):
    # This machine alone. Any other address is served by TLS, with a certificate of `bus.certificates`, and to whoever
    # gives the operator's key; STOP is for everybody.
    host: str = "127.0.0.1"
    # Whether what leads to `host` listens on a loopback address itself: a container's published port, or a tunnel.
    behind_loopback: bool = False
    port: Port = 8043  # ends in the paper's domain
    serve: bool = True  # whether there is a page; the process runs without it too
    picture_rate_hz: Positive = 10.0  # at most so many pictures are sent to a page
    # A chart below the map (Web Mercator): folder of tiles `{z}/{x}/{y}.png`, `.jpg` or `.webp`, or a file of such
    # pictures in the format PMTiles (extra `charts`). Empty: none.
    tiles: str = ""
    replayed: str = ""  # the recording that the page plays instead of the present; `paani replay --dashboard` sets it


class UpConfig(Section, frozen=True):
    arm_at_start: bool = False  # `paani up` asks once for a simulated boat to be armed: never again after a restart
    ports: tuple[Literal["mavlink", "ros2", "foxglove", "nmea"], ...] = ()  # to what others use; `paani up --with`


class Config(Section, frozen=True):
    """Defaults < TOML file < `PAANI_<SECTION>__<FIELD>` < `--set section.field=value`."""

    # Which set of values the others are compared with; `paani` is the default.
    profile: Literal["paani", "wide", "fans", "paper", "hil", "hull"] = "paani"
    bus: BusConfig = BusConfig()
    camera: CameraConfig = CameraConfig()
    calibration: CalibrationConfig = CalibrationConfig()
    perception: PerceptionConfig = PerceptionConfig()
    advisor: AdvisorConfig = AdvisorConfig()
    sensors: SensorDevicesConfig = SensorDevicesConfig()
    localization: LocalizationConfig = LocalizationConfig()
    navigator: NavigatorConfig = NavigatorConfig()
    controller: ControllerConfig = ControllerConfig()
    thrusters: ThrustersConfig = ThrustersConfig()
    world: WorldConfig = WorldConfig()
    plant: PlantConfig = PlantConfig()
    eye: EyeConfig = EyeConfig()
    up: UpConfig = UpConfig()
    dashboard: DashboardConfig = DashboardConfig()
    recorder: RecorderConfig = RecorderConfig()
    bridge: BridgeConfig = BridgeConfig()
    button: ButtonConfig = ButtonConfig()
    mavlink: MavlinkConfig = MavlinkConfig()
    nmea: NmeaConfig = NmeaConfig()
    ros2: Ros2Config = Ros2Config()
    foxglove: FoxgloveConfig = FoxgloveConfig()

    @property
    def services(self) -> tuple[str, ...]:
        """Processes that run with these settings, in the order they start."""
        idle = set[str](PORTS) - {*self.up.ports}
        if self.camera.source != "sim":
            idle.add("eye")
        if not self.recorder.folder:
            idle.add("recorder")
        if not self.bridge.line:
            idle.add("bridge")
        if not self.button.line:
            idle.add(BUTTON)
        return tuple(name for name in services_on(self.bus.side, self.bus.graph) if name not in idle)

    @property
    def adapter(self) -> AdapterConfig:
        """The thrust adapter's settings. It waits for a button's pulse too, where there is one."""
        adapter = self.plant.adapter
        if not self.button.line or BUTTON in adapter.require_pulses:
            return adapter
        return msgspec.structs.replace(adapter, require_pulses=(*adapter.require_pulses, BUTTON))

    @property
    def is_planner_active(self) -> bool:
        """Whether the metric planner chooses heading and speed: it is switched on, and the camera is calibrated."""
        return self.navigator.planner.acts_on(self.calibration)

    @property
    def turns_on_the_spot(self) -> bool:
        """Whether the boat can turn without making way: its turning radius is 0."""
        return self.navigator.planner.turn_radius_m == 0.0

    def __post_init__(self) -> None:
        """Refuse settings that cannot work together; the message names the fields."""
        self._require_graph()
        self._require_lines()
        if "ros2" in self.up.ports:
            require_ros_name(self.bus.vessel)
        motion, rate_hz = self.advisor.motion, min(self.perception.rate_hz, self.camera.rate_hz)
        starved = 1.0 / rate_hz > motion.max_gap_s or rate_hz * motion.history_s + 1 < motion.min_samples
        if self.profile != "paper" and not motion.follow_rate and starved:
            raise ValueError(
                f"advisor.motion: {motion.min_samples} samples in {motion.history_s} s"
                f" cannot arrive at {rate_hz} Hz (perception.rate_hz, camera.rate_hz)"
            )
        if self.navigator.cruise_mps > self.controller.max_speed_mps:
            raise ValueError(
                f"navigator.cruise_mps {self.navigator.cruise_mps} exceeds"
                f" controller.max_speed_mps {self.controller.max_speed_mps}"
            )
        self._require_foresight()
        policy = self.advisor.policy
        if policy.core_left >= policy.core_right:
            raise ValueError("advisor.policy.core_left must be left of advisor.policy.core_right")
        if self.advisor.evidence_max_age_s > self.advisor.lifetime_s:
            raise ValueError("advisor.evidence_max_age_s exceeds advisor.lifetime_s")
        if self.controller.command_max_receipt_s > self.plant.adapter.timeout_s:
            raise ValueError("controller.command_max_receipt_s exceeds plant.adapter.timeout_s")
        if self.controller.astern > self.plant.adapter.astern:
            raise ValueError("controller.astern exceeds plant.adapter.astern")
        planner, on_the_spot = self.navigator.planner, self.controller.astern >= self.controller.max_steer
        if self.profile != "paper" and planner.use and planner.turn_radius_m == 0.0 and not on_the_spot:
            raise ValueError(
                f"navigator.planner.turn_radius_m must be above 0: with controller.astern {self.controller.astern},"
                f" less than controller.max_steer, no boat turns on the spot (profile=fans is for fans that only push)"
            )

    def _require_foresight(self) -> None:
        """A planner that steps over obstacles, or looks no further than the boat stops, checks nothing."""
        planner, speed_mps = self.navigator.planner, self.controller.max_speed_mps
        if not planner.use:
            return
        if planner.step_s * speed_mps > planner.hull_radius_m:
            raise ValueError(f"navigator.planner.step_s {planner.step_s} steps over what is as wide as the hull")
        if planner.horizon_s < 2.0 * planner.step_s:
            raise ValueError(f"navigator.planner.horizon_s {planner.horizon_s} is less than two steps (step_s)")
        reach_m = planner.horizon_s * self.navigator.cruise_mps + planner.look_m
        needed_m = max(planner.room_m, planner.stop_s * self.navigator.cruise_mps)
        if reach_m < needed_m:
            raise ValueError(
                f"navigator.planner looks {reach_m:.2g} m ahead (horizon_s, look_m),"
                f" less than the boat needs to stop or turn away: {needed_m:.2g} m (stop_s, room_m)"
            )

    def _require_graph(self) -> None:
        """The graph is its profile's, and what a real boat must not have is refused there."""
        graph = GRAPHS.get(self.profile, Graph.SIMULATION)
        if self.bus.graph is not graph:
            raise ValueError(
                f"bus.graph '{self.bus.graph}' is set by the profiles hil and hull alone;"
                f" profile '{self.profile}' has the graph '{graph}' (--profile hil or hull, without bus.graph)"
            )
        if graph is Graph.HULL and self.camera.source == "sim":
            raise ValueError("camera.source 'sim': a hull has no simulated camera (--camera webcam or PATH)")
        line = self.thrusters.line
        for name, address in (("thrusters.line", line), ("plant.pwm_line", self.plant.pwm_line)):
            if graph is Graph.HIL and address and not is_emulated(address):
                raise ValueError(f"{name} {address}: profile hil drives an emulator alone ({EMULATED_LINES})")
        autopilot = self.thrusters.autopilot.line
        if graph is not Graph.HULL and autopilot:
            raise ValueError(f"thrusters.autopilot.line {autopilot}: drives a real boat alone (--profile hull)")
        if graph is Graph.HULL and line.startswith("socket:"):
            raise ValueError(f"thrusters.line {line}: a hull's microcontroller is at a serial device or unix:/PATH")
        if graph is not Graph.SIMULATION and self.up.arm_at_start:
            raise ValueError(f"up.arm_at_start: profile {self.profile} waits for its operator")

    def _require_lines(self) -> None:
        """A line has one user, and a recording guides no boat that moves."""
        autopilot, source = self.thrusters.autopilot.line, self.camera.source
        is_moved = self.thrusters.line and not is_emulated(self.thrusters.line)
        way = "thrusters.autopilot.line" if autopilot else "thrusters.line" if is_moved else ""
        if way and self.camera.is_recording:
            raise ValueError(f"camera.source {source}: a recording is no camera of a boat that moves ({way} is set)")
        for role, line in self.sensors.lines.items():
            name = f"sensors.{role}.line"
            for other, taken in (
                ("bridge.line", self.bridge.line),
                ("thrusters.line", self.thrusters.line),
                ("thrusters.autopilot.line", autopilot),
            ):
                if line and line.partition("@")[0] == taken.partition("@")[0]:
                    raise ValueError(f"{name} {line}: is also {other}; a sensor needs a line of its own")
            if way and line.startswith("file:"):
                raise ValueError(f"{name} {line}: a recording is no sensor of a boat that moves ({way} is set)")


def is_emulated(line: str) -> bool:
    """Whether only a program of this machine can be at the other end: loopback interface, or pseudo-terminal."""
    try:
        device, baud = parse_address(line)
    except ValueError:
        return False
    return re.fullmatch(r"/dev/pts/\d+", device) is not None if baud else device.rpartition(":")[0] == "127.0.0.1"
