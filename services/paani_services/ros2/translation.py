"""Messages of the bus as ROS 2 messages, encoded. Pure: the same for a live boat and for a recording.

What the boat itself does not believe is withheld: an estimate that is not healthy, and boxes of a picture that is no
evidence. ROS has no field that says so, and an empty array would say that nothing is there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np
import numpy.typing as npt

from paani import keys
from paani import messages as m
from paani.config import CalibrationConfig
from paani.occupancy_cells import unpack_cells
from paani_services.ros2 import topics
from paani_services.ros2.frames import Frames, Quaternion, Transform, Vector, camera_mount, parent_between, rotation_of
from paani_services.ros2.schemas import encode, make
from paani_services.ros2.topics import RosTopic

F64 = npt.NDArray[np.float64]
# Of what is not measured; 0 would claim that it is known exactly, and filters of ROS would believe it.
UNKNOWN_VARIANCE = 1e6
NOT_MEASURED = -1.0  # in the first place of a covariance: the message has no such quantity (sensor_msgs)
STATUS_NO_FIX, STATUS_FIX, SERVICE_GPS = -1, 0, 1
# Of nav_msgs/OccupancyGrid: 0 to 100 %, or -1. What no camera sees is unknown there, whoever answers for it aboard.
OCCUPANCY_PERCENT = {
    m.Occupancy.UNKNOWN: -1,
    m.Occupancy.FREE: 0,
    m.Occupancy.OCCUPIED: 100,
    m.Occupancy.BLIND_ZONE: -1,
}
PERCENT_OF_CELL = np.array([OCCUPANCY_PERCENT[each] for each in m.Occupancy], np.int8)
COVARIANCE_UNKNOWN, COVARIANCE_APPROXIMATED = 0, 1


class RosMessage(NamedTuple):
    """One message of a topic as CDR. source_us: when what it says was measured."""

    topic: RosTopic
    source_us: int
    data: bytes


class Translator:
    """Takes messages of the bus in the order they came; remembers the pose in `odom` and the picture's size."""

    def __init__(self, frames: Frames, calibration: CalibrationConfig) -> None:
        """calibration: where the camera is; unless it is valid, nothing says so in the graph."""
        self._frames = frames
        self._camera = camera_mount(calibration) if calibration.valid else None
        self._local: m.Odometry | None = None
        self._global: m.Odometry | None = None
        self._evidence: m.Evidence | None = None
        self._translations: Mapping[str, Callable[[Any], list[tuple[RosTopic, Any]]]] = {
            keys.GPS.name: self._gps,
            keys.IMU.name: self._imu,
            keys.ODOMETRY.name: self._global_odometry,
            keys.LOCAL_ODOMETRY.name: self._local_odometry,
            keys.EVIDENCE.name: self._detections,
            keys.TRACKS.name: self._tracks,
            keys.ADVISORY.name: self._advisory,
            keys.OCCUPANCY.name: self._occupancy,
        }

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the bus topics that `translate` takes."""
        return tuple(self._translations)

    def translate(self, name: str, message: m.Message) -> list[RosMessage]:
        """What a message of that topic becomes. Raises ValueError for a time beyond 2038, which ROS cannot say."""
        return [RosMessage(topic, message.source_us, encode(ros)) for topic, ros in self._translations[name](message)]

    def picture(self, header: m.PictureHeader, data: bytes) -> RosMessage:
        """An encoded picture."""
        image = make(
            "sensor_msgs/CompressedImage",
            header=self._header(header.source_us, self._frames.camera_optical),
            format=header.media_type.rpartition("/")[2],
            data=np.frombuffer(data, np.uint8),
        )
        return RosMessage(topics.IMAGE, header.source_us, encode(image))

    def _gps(self, fix: m.GpsFix) -> list[tuple[RosTopic, Any]]:
        variance_m2 = fix.position_std_m**2
        position_deg = (fix.latitude_deg, fix.longitude_deg) if fix.fix else (math.nan, math.nan)
        message = make(
            "sensor_msgs/NavSatFix",
            header=self._header(fix.source_us, self._frames.base_link),
            status=make(
                "sensor_msgs/NavSatStatus", status=STATUS_FIX if fix.fix else STATUS_NO_FIX, service=SERVICE_GPS
            ),
            latitude=position_deg[0],
            longitude=position_deg[1],
            altitude=math.nan,
            position_covariance=_diagonal(variance_m2, variance_m2, UNKNOWN_VARIANCE) if fix.fix else np.zeros(9),
            position_covariance_type=COVARIANCE_APPROXIMATED if fix.fix else COVARIANCE_UNKNOWN,
        )
        return [(topics.GPS_FIX, message)]

    def _imu(self, sample: m.ImuSample) -> list[tuple[RosTopic, Any]]:
        orientation, covariance = Quaternion(0.0, 0.0, 0.0, 1.0), _diagonal(NOT_MEASURED, 0.0, 0.0)
        if sample.orientation_available:
            orientation = rotation_of(sample.roll_rad, sample.pitch_rad, sample.yaw_rad)
            covariance = np.zeros(9)
        message = make(
            "sensor_msgs/Imu",
            header=self._header(sample.source_us, self._frames.base_link),
            orientation=_quaternion(orientation),
            orientation_covariance=covariance,
            angular_velocity=_vector(sample.gyro_x_radps, sample.gyro_y_radps, sample.gyro_z_radps),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=_vector(sample.accel_x_mps2, sample.accel_y_mps2, sample.accel_z_mps2),
            linear_acceleration_covariance=np.zeros(9),
        )
        return [(topics.IMU, message)]

    def _global_odometry(self, pose: m.Odometry) -> list[tuple[RosTopic, Any]]:
        self._global = pose
        if not pose.healthy:
            return []
        return [(topics.GLOBAL_ODOMETRY, self._odometry(pose, self._frames.map)), *self._map_to_odom()]

    def _local_odometry(self, pose: m.Odometry) -> list[tuple[RosTopic, Any]]:
        self._local = pose
        if not pose.healthy:
            return []
        links = [(self._frames.odom, self._frames.base_link, _pose(pose))]
        if self._camera is not None:
            links.append((self._frames.base_link, self._frames.camera_optical, self._camera))
        return [
            (topics.LOCAL_ODOMETRY, self._odometry(pose, self._frames.odom)),
            self._transforms(pose.source_us, *links),
            *self._map_to_odom(),
        ]

    def _map_to_odom(self) -> list[tuple[RosTopic, Any]]:
        """Once the second of the two estimates of one moment has come, if both are healthy."""
        whole, local = self._global, self._local
        if whole is None or local is None or whole.source_us != local.source_us:
            return []
        if not (whole.healthy and local.healthy):
            return []
        between = parent_between(_pose(whole), _pose(local))
        return [self._transforms(whole.source_us, (self._frames.map, self._frames.odom, between))]

    def _odometry(self, pose: m.Odometry, frame: str) -> Any:
        variance_m2, unknown = pose.position_std_m**2, UNKNOWN_VARIANCE
        return make(
            "nav_msgs/Odometry",
            header=self._header(pose.source_us, frame),
            child_frame_id=self._frames.base_link,
            pose=make(
                "geometry_msgs/PoseWithCovariance",
                pose=_ros_pose(_pose(pose)),
                covariance=_diagonal(variance_m2, variance_m2, unknown, unknown, unknown, pose.yaw_std_rad**2),
            ),
            twist=make(
                "geometry_msgs/TwistWithCovariance",
                twist=make(
                    "geometry_msgs/Twist",
                    linear=_vector(pose.surge_mps, pose.sway_mps, 0.0),
                    angular=_vector(0.0, 0.0, pose.yaw_rate_radps),
                ),
                covariance=_diagonal(*[unknown] * 6),
            ),
        )

    def _transforms(self, source_us: int, *links: tuple[str, str, Transform]) -> tuple[RosTopic, Any]:
        stamped = [
            make(
                "geometry_msgs/TransformStamped",
                header=self._header(source_us, parent),
                child_frame_id=child,
                transform=make(
                    "geometry_msgs/Transform",
                    translation=_vector(*link.translation_m),
                    rotation=_quaternion(link.rotation),
                ),
            )
            for parent, child, link in links
        ]
        return topics.TRANSFORM, make("tf2_msgs/TFMessage", transforms=stamped)

    def _detections(self, evidence: m.Evidence) -> list[tuple[RosTopic, Any]]:
        self._evidence = evidence
        if not evidence.usable:
            return []
        boxes = [(box.box_xyxy, box.label, box.confidence, "") for box in evidence.detections]
        return [(topics.DETECTIONS, self._boxes(evidence, evidence.source_us, boxes))]

    def _tracks(self, tracks: m.Tracks) -> list[tuple[RosTopic, Any]]:
        """Those that count, in the picture whose size is known: the one of the newest evidence."""
        evidence, frame = self._evidence, (tracks.frame_epoch, tracks.frame_seq)
        if evidence is None or not evidence.usable or (evidence.frame_epoch, evidence.frame_seq) != frame:
            return []
        boxes = [(each.box_xyxy, each.label, each.confidence, str(each.id)) for each in tracks.tracks if each.accepted]
        return [(topics.TRACKS, self._boxes(evidence, tracks.source_us, boxes))]

    def _boxes(self, evidence: m.Evidence, source_us: int, boxes: list[tuple[m.BoxXyxy, m.Label, float, str]]) -> Any:
        header = self._header(source_us, self._frames.camera_optical)
        detections = []
        for (x1, y1, x2, y2), label, score, identity in boxes:
            centre = make(
                "vision_msgs/Point2D", x=0.5 * (x1 + x2) * evidence.width_px, y=0.5 * (y1 + y2) * evidence.height_px
            )
            box = make(
                "vision_msgs/BoundingBox2D",
                center=make("vision_msgs/Pose2D", position=centre, theta=0.0),
                size_x=(x2 - x1) * evidence.width_px,
                size_y=(y2 - y1) * evidence.height_px,
            )
            detections.append(
                make(
                    "vision_msgs/Detection2D", header=header, results=[_hypothesis(label, score)], bbox=box, id=identity
                )
            )
        return make("vision_msgs/Detection2DArray", header=header, detections=detections)

    def _advisory(self, advisory: m.Advisory) -> list[tuple[RosTopic, Any]]:
        return [(topics.ADVISORY, make("std_msgs/String", data=msgspec.json.encode(advisory).decode()))]

    def _occupancy(self, grid: m.OccupancyGrid) -> list[tuple[RosTopic, Any]]:
        """Raises ValueError where the cells are not as many as the grid has."""
        corner = Transform(Vector(grid.west_m, grid.south_m, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
        header = self._header(grid.source_us, self._frames.map)
        info = make(
            "nav_msgs/MapMetaData",
            map_load_time=header.stamp,
            resolution=grid.cell_m,
            width=grid.columns,
            height=grid.rows,
            origin=_ros_pose(corner),
        )
        data = PERCENT_OF_CELL[unpack_cells(grid).ravel()]
        return [(topics.OCCUPANCY, make("nav_msgs/OccupancyGrid", header=header, info=info, data=data))]

    @staticmethod
    def _header(source_us: int, frame: str) -> Any:
        return header_of(source_us, frame)


def header_of(source_us: int, frame: str) -> Any:
    """A std_msgs/Header."""
    seconds, rest_us = divmod(source_us, 1_000_000)
    stamp = make("builtin_interfaces/Time", sec=seconds, nanosec=rest_us * 1000)
    return make("std_msgs/Header", stamp=stamp, frame_id=frame)


def _pose(pose: m.Odometry) -> Transform:
    rotation = rotation_of(pose.roll_rad, pose.pitch_rad, pose.yaw_rad)
    return Transform(Vector(pose.x_m, pose.y_m, 0.0), rotation)


def _ros_pose(at: Transform) -> Any:
    return make(
        "geometry_msgs/Pose",
        position=make("geometry_msgs/Point", **at.translation_m._asdict()),
        orientation=_quaternion(at.rotation),
    )


def _hypothesis(label: m.Label, score: float) -> Any:
    """A class and its score; where it is in space, a box does not say."""
    nowhere = _ros_pose(Transform(Vector(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0)))
    return make(
        "vision_msgs/ObjectHypothesisWithPose",
        hypothesis=make("vision_msgs/ObjectHypothesis", class_id=label.value, score=score),
        pose=make(
            "geometry_msgs/PoseWithCovariance",
            pose=nowhere,
            covariance=_diagonal(NOT_MEASURED, 0.0, 0.0, 0.0, 0.0, 0.0),
        ),
    )


def _vector(x: float, y: float, z: float) -> Any:
    return make("geometry_msgs/Vector3", x=x, y=y, z=z)


def _quaternion(rotation: Quaternion) -> Any:
    return make("geometry_msgs/Quaternion", **rotation._asdict())


def _diagonal(*variances: float) -> F64:
    return np.diag(variances).ravel()
