"""Messages of one picture, and what viewers make of the bytes that we send."""

from __future__ import annotations

from typing import Any

import msgspec

from paani import messages as m
from paani.config import CalibrationConfig
from tests.unit.paani.logs.test_protobuf import decoder

NOW_US = 1_700_000_000_123_456
CALIBRATION = CalibrationConfig(
    valid=True, hfov_deg=70.0, height_m=0.9, forward_m=0.55, pitch_down_deg=6.0, roll_deg=2.0, yaw_deg=-10.0
)
WAYPOINTS = (m.Waypoint(x_m=0.0, y_m=0.0), m.Waypoint(x_m=30.0, y_m=0.0), m.Waypoint(x_m=30.0, y_m=40.0))


def decoded(kind: str, data: bytes) -> Any:
    """As the official library reads it."""
    return decoder(kind).FromString(data)


def odometry(**changes: Any) -> m.Odometry:
    values: dict[str, Any] = {
        "source_us": NOW_US, "sent_us": NOW_US + 900, "x_m": 12.0, "y_m": -5.0, "yaw_rad": 0.7, "surge_mps": 0.5,
        "latitude_deg": 52.0, "longitude_deg": 4.0, "healthy": True, "roll_rad": 0.05, "pitch_rad": -0.03,
    }  # fmt: skip
    return m.Odometry(**(values | changes))


def header(frame_seq: int = 3, **changes: Any) -> m.PictureHeader:
    values: dict[str, Any] = {
        "source_us": NOW_US + 200_000 * frame_seq, "frame_seq": frame_seq, "frame_epoch": 1, "width_px": 320,
        "height_px": 240,
    }  # fmt: skip
    return m.PictureHeader(**(values | changes))


def track(**changes: Any) -> m.Track:
    values: dict[str, Any] = {
        "id": 7, "label": m.Label.BUOY, "hazard": m.Hazard.MARKER, "confidence": 0.81,
        "box_xyxy": (0.25, 0.5, 0.5, 0.75), "hits": 3, "confirmed": True, "immediate_danger": False, "accepted": True,
        "held": False, "age_s": 1.0, "urgency": 0.0,
    }  # fmt: skip
    return m.Track(**(values | changes))


def tracks(frame_seq: int = 3, *found: m.Track) -> m.Tracks:
    return m.Tracks(source_us=NOW_US, frame_seq=frame_seq, frame_epoch=1, tracks=found)


def advisory(frame_seq: int = 3, **changes: Any) -> m.Advisory:
    values: dict[str, Any] = {
        "source_us": NOW_US, "direction": m.Direction.LEFT, "reason": m.Reason.CENTER_RISK, "frame_seq": frame_seq,
        "frame_epoch": 1, "left": m.LaneRisk(risk=0.2, blocked=False), "center": m.LaneRisk(risk=0.7, blocked=True),
    }  # fmt: skip
    return m.Advisory(**(values | changes))


def corners_of(points: Any) -> list[tuple[float, float]]:
    return [(point.x, point.y) for point in points]


def as_json(data: bytes) -> Any:
    return msgspec.json.decode(data)
