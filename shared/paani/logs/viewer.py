"""What Foxglove, Lichtblick and Rerun draw without being taught our messages: derived, never read back. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import msgspec

from paani import keys
from paani import messages as m
from paani.geometry import quaternion
from paani.logs import protobuf as pb
from paani.undecodable import UNDECODABLE

GPS, POSE, ANNOTATIONS, LINES = "viewer/gps", "viewer/pose", "viewer/annotations", "viewer/log"
CHANNELS = {GPS: pb.LOCATION_FIX, POSE: pb.POSE_IN_FRAME, ANNOTATIONS: pb.IMAGE_ANNOTATIONS, LINES: pb.LOG}
CAMERA_FRAME, MAP_FRAME, GPS_FRAME = "camera_optical", "map", "gps"
# As on the dashboard: what counts is orange, what is only held or not yet confirmed is pale.
ACCEPTED, OTHERS = pb.colour(1.0, 0.71, 0.33, 1.0), pb.colour(0.6, 0.65, 0.7, 1.0)
BACKGROUND = pb.colour(0.03, 0.04, 0.05, 0.8)
LINE_PX, FONT_PX = 2.0, 11.0


class Derived(NamedTuple):
    """One message of a viewer channel, and the time it speaks of [us]."""

    channel: str
    source_us: int
    data: bytes


def picture(header: m.PictureHeader, data: bytes) -> bytes:
    """Encoded picture bytes as a foxglove.CompressedImage."""
    return pb.encode(
        pb.COMPRESSED_IMAGE,
        {
            "timestamp": pb.timestamp(header.source_us),
            "data": data,
            "format": header.media_type.rpartition("/")[2],
            "frame_id": CAMERA_FRAME,
        },
    )


class Viewer:
    """Derives the viewer's messages; remembers the picture's size and what the last line said."""

    def __init__(self) -> None:
        self._size_px = (0, 0)
        self._said: dict[str, object] = {}
        views: Mapping[keys.Topic[Any], Callable[[Any], list[Derived]]] = {
            keys.GPS: self._gps,
            keys.ODOMETRY: self._pose,
            keys.EVIDENCE: self._evidence,
            keys.TRACKS: self._tracks,
            keys.ADVISORY: self._advisory,
            keys.THRUST_APPLIED: self._applied,
            keys.ARMING: self._arming,
        }
        self._views = {topic.name: (msgspec.json.Decoder(topic.type), view) for topic, view in views.items()}

    def derive(self, topic: str, data: bytes) -> list[Derived]:
        """What a message adds to the viewer's channels; nothing for other topics and for what cannot be decoded."""
        if topic not in self._views:
            return []
        decoder, _ = self._views[topic]
        try:
            message = decoder.decode(data)
        except UNDECODABLE:
            return []
        return self.derive_from(topic, message)

    def derive_from(self, topic: str, message: m.Message) -> list[Derived]:
        """The same of a message that is decoded already."""
        _, view = self._views.get(topic, (None, None))
        return view(message) if view is not None else []

    def _gps(self, fix: m.GpsFix) -> list[Derived]:
        if not fix.fix:
            return []
        variance_m2 = fix.position_std_m**2
        fields = {
            "latitude": fix.latitude_deg,
            "longitude": fix.longitude_deg,
            "position_covariance": (variance_m2, 0.0, 0.0, 0.0, variance_m2, 0.0, 0.0, 0.0, 0.0),
            "position_covariance_type": pb.COVARIANCE_APPROXIMATED,
            "timestamp": pb.timestamp(fix.source_us),
            "frame_id": GPS_FRAME,
        }
        return [Derived(GPS, fix.source_us, pb.encode(pb.LOCATION_FIX, fields))]

    def _pose(self, pose: m.Odometry) -> list[Derived]:
        fields = {
            "timestamp": pb.timestamp(pose.source_us),
            "frame_id": MAP_FRAME,
            "pose": {
                "position": {"x": pose.x_m, "y": pose.y_m},
                "orientation": quaternion(pose.roll_rad, pose.pitch_rad, pose.yaw_rad),
            },
        }
        return [Derived(POSE, pose.source_us, pb.encode(pb.POSE_IN_FRAME, fields))]

    def _evidence(self, evidence: m.Evidence) -> list[Derived]:
        self._size_px = (evidence.width_px, evidence.height_px)
        line = "picture usable" if evidence.usable else f"picture unusable: {evidence.cause}"
        return self._line("perception", line, evidence.source_us, pb.INFO if evidence.usable else pb.WARNING)

    def _tracks(self, tracks: m.Tracks) -> list[Derived]:
        width, height = self._size_px
        time = pb.timestamp(tracks.source_us)
        boxes, texts = [], []
        for track in tracks.tracks if width and height else ():
            x1, y1, x2, y2 = track.box_xyxy
            corners = [pb.point(x * width, y * height) for x, y in ((x1, y1), (x2, y1), (x2, y2), (x1, y2))]
            colour = ACCEPTED if track.accepted and not track.held else OTHERS
            boxes.append(
                {
                    "timestamp": time, "type": pb.LINE_LOOP, "points": corners, "outline_color": colour,
                    "thickness": LINE_PX,
                }
            )  # fmt: skip
            texts.append(
                {
                    "timestamp": time, "position": corners[0], "font_size": FONT_PX, "text_color": colour,
                    "text": f"#{track.id} {track.label} {track.confidence:.2f}",
                    "background_color": BACKGROUND,
                }
            )  # fmt: skip
        return [
            Derived(ANNOTATIONS, tracks.source_us, pb.encode(pb.IMAGE_ANNOTATIONS, {"points": boxes, "texts": texts}))
        ]

    def _advisory(self, advisory: m.Advisory) -> list[Derived]:
        stands = advisory.direction in {m.Direction.STOP, m.Direction.NO_DATA}
        key = (advisory.direction, advisory.reason)
        line = f"{advisory.direction} ({advisory.reason}). {advisory.explanation}"
        return self._line("advisor", line, advisory.sent_us, pb.WARNING if stands else pb.INFO, key)

    def _applied(self, applied: m.ThrustApplied) -> list[Derived]:
        zero = applied.zero_cause is not m.ZeroCause.NONE
        line = f"no thrust: {applied.zero_cause}" if zero else "thrust applied"
        return self._line("plant", line, applied.source_us, pb.WARNING if zero else pb.INFO)

    def _arming(self, arming: m.Arming) -> list[Derived]:
        line = "stopped by the operator" if arming.stopped else "armed" if arming.armed else "not armed"
        return self._line("operator", line, arming.sent_us, pb.WARNING if arming.stopped else pb.INFO)

    def _line(self, name: str, line: str, at_us: int, level: int, key: object = None) -> list[Derived]:
        """A line of the log when what it says (its key, else the line) has changed."""
        key = line if key is None else key
        if self._said.get(name) == key:
            return []
        self._said[name] = key
        fields = {"timestamp": pb.timestamp(at_us), "level": level, "message": line, "name": name}
        return [Derived(LINES, at_us, pb.encode(pb.LOG, fields))]
