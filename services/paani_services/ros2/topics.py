"""Every topic of the port: its name, type, quality of service, frame, and the message of the bus that it comes from.

Names without a leading slash lie below `/<vessel>/`.
"""

from __future__ import annotations

from typing import NamedTuple

from paani import keys
from paani.bus.ros_graph import LATCHED, RELIABLE, SENSOR_DATA, TRANSFORMS, RosEndpoint, RosQos
from paani_services.ros2.schemas import type_hash


class RosTopic(NamedTuple):
    """A row of the table. `source`: the topic of the bus; `frame`: in what the numbers count, empty where in none."""

    name: str
    type: str
    qos: RosQos
    frame: str
    source: str
    rate_hz: float

    def full_name(self, vessel: str) -> str:
        """The name from the root of the graph."""
        return self.name if self.name.startswith("/") else f"/{vessel}/{self.name}"

    def endpoint(self, vessel: str) -> RosEndpoint:
        """What it is called on the wire."""
        return RosEndpoint(self.full_name(vessel), self.type, type_hash(self.type), self.qos)


# fmt: off
GPS_FIX = RosTopic("gps/fix", "sensor_msgs/NavSatFix", SENSOR_DATA, "base_link", keys.GPS.name, 5.0)
IMU = RosTopic("imu/data", "sensor_msgs/Imu", SENSOR_DATA, "base_link", keys.IMU.name, 100.0)
GLOBAL_ODOMETRY = RosTopic("odometry/global", "nav_msgs/Odometry", RELIABLE, "map", keys.ODOMETRY.name, 20.0)
LOCAL_ODOMETRY = RosTopic("odometry/local", "nav_msgs/Odometry", RELIABLE, "odom", keys.LOCAL_ODOMETRY.name, 20.0)
IMAGE = RosTopic(
    "camera/image/compressed", "sensor_msgs/CompressedImage", SENSOR_DATA, "camera_optical", keys.PICTURE.name, 5.0
)
DETECTIONS = RosTopic(
    "detections", "vision_msgs/Detection2DArray", RELIABLE, "camera_optical", keys.EVIDENCE.name, 5.0
)
TRACKS = RosTopic("tracks", "vision_msgs/Detection2DArray", RELIABLE, "camera_optical", keys.TRACKS.name, 5.0)
ADVISORY = RosTopic("advisory", "std_msgs/String", RELIABLE, "", keys.ADVISORY.name, 5.0)
OCCUPANCY = RosTopic("occupancy", "nav_msgs/OccupancyGrid", LATCHED, "map", keys.OCCUPANCY.name, 1.0)
DIAGNOSTICS = RosTopic("/diagnostics", "diagnostic_msgs/DiagnosticArray", RELIABLE, "", "health/*", 1.0)
TRANSFORM = RosTopic(
    "/tf", "tf2_msgs/TFMessage", TRANSFORMS, "map, odom", f"{keys.ODOMETRY.name}, {keys.LOCAL_ODOMETRY.name}", 40.0
)
# fmt: on

STOP = RosTopic("stop", "std_msgs/Bool", RELIABLE, "", keys.REQUESTS["ros2"].name, 0.0)
MODE = RosTopic("mode", "std_msgs/String", RELIABLE, "", keys.REQUESTS["ros2"].name, 0.0)
CMD_VEL = RosTopic("cmd_vel", "geometry_msgs/Twist", RELIABLE, "base_link", keys.REQUESTS["ros2"].name, 0.0)
GOAL = RosTopic("goal_pose", "geometry_msgs/PoseStamped", RELIABLE, "map", keys.MISSION_REQUESTS["ros2"].name, 0.0)

SENT = (
    GPS_FIX, IMU, GLOBAL_ODOMETRY, LOCAL_ODOMETRY, IMAGE, DETECTIONS, TRACKS, ADVISORY, OCCUPANCY, DIAGNOSTICS,
    TRANSFORM,
)  # fmt: skip
COMMANDS = (STOP, MODE, CMD_VEL, GOAL)  # the last three only where `ros2.accept_commands`
