"""The few Foxglove messages that every viewer draws, in Protocol Buffers, without the library. Pure.

`encode(name, fields)` writes one message; `descriptors(name)` is the FileDescriptorSet that goes into the file as its
schema. Both read the same table, which follows the published definitions of Foxglove's schemas.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Mapping
from typing import Any, NamedTuple

Fields = Mapping[str, Any]
_POINT = struct.Struct("<BdBd")

DOUBLE, ENUM, STRING, BYTES, FIXED32, MESSAGE, BOOL = (
    1,
    14,
    9,
    12,
    7,
    11,
    8,
)  # descriptor.proto: FieldDescriptorProto.Type
OPTIONAL, REPEATED = 1, 3
VARINT, I64, LEN, I32 = 0, 1, 2, 5


class Field(NamedTuple):
    """A field of a message: number, type, the message or enumeration it names, whether it repeats."""

    number: int
    kind: int
    of: str = ""
    repeated: bool = False


TIME, DURATION = "google.protobuf.Timestamp", "google.protobuf.Duration"
COLOR, POINT2 = "foxglove.Color", "foxglove.Point2"
VECTOR3, QUATERNION, POSE = "foxglove.Vector3", "foxglove.Quaternion", "foxglove.Pose"
COMPRESSED_IMAGE, LOCATION_FIX, POSE_IN_FRAME = (
    "foxglove.CompressedImage",
    "foxglove.LocationFix",
    "foxglove.PoseInFrame",
)
POINTS, TEXTS, CIRCLES = "foxglove.PointsAnnotation", "foxglove.TextAnnotation", "foxglove.CircleAnnotation"
IMAGE_ANNOTATIONS, LOG = "foxglove.ImageAnnotations", "foxglove.Log"
CAMERA_CALIBRATION, GEO_JSON = "foxglove.CameraCalibration", "foxglove.GeoJSON"
FRAME_TRANSFORMS, FRAME_TRANSFORM = "foxglove.FrameTransforms", "foxglove.FrameTransform"
SCENE_UPDATE, SCENE_ENTITY = "foxglove.SceneUpdate", "foxglove.SceneEntity"
DELETION, KEY_VALUE, POINT3 = "foxglove.SceneEntityDeletion", "foxglove.KeyValuePair", "foxglove.Point3"
ARROW, CUBE, SPHERE = "foxglove.ArrowPrimitive", "foxglove.CubePrimitive", "foxglove.SpherePrimitive"
CYLINDER, LINE, TRIANGLES = (
    "foxglove.CylinderPrimitive",
    "foxglove.LinePrimitive",
    "foxglove.TriangleListPrimitive",
)
TEXT, MODEL = "foxglove.TextPrimitive", "foxglove.ModelPrimitive"
LINE_LOOP = 2
SCENE_LINE_STRIP, SCENE_LINE_LOOP = 0, 1
COVARIANCE_APPROXIMATED = 1
INFO, WARNING = 2, 3

ENUMS: dict[str, tuple[str, ...]] = {
    f"{LOCATION_FIX}.PositionCovarianceType": ("UNKNOWN", "APPROXIMATED", "DIAGONAL_KNOWN", "KNOWN"),
    f"{POINTS}.Type": ("UNKNOWN", "POINTS", "LINE_LOOP", "LINE_STRIP", "LINE_LIST"),
    f"{LOG}.Level": ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"),
    f"{DELETION}.Type": ("MATCHING_ID", "ALL"),
    f"{LINE}.Type": ("LINE_STRIP", "LINE_LOOP", "LINE_LIST"),
}
INT64, INT32 = 3, 5
MESSAGES: dict[str, dict[str, Field]] = {
    TIME: {"seconds": Field(1, INT64), "nanos": Field(2, INT32)},
    DURATION: {"seconds": Field(1, INT64), "nanos": Field(2, INT32)},
    COLOR: {name: Field(number, DOUBLE) for number, name in enumerate("rgba", 1)},
    POINT2: {name: Field(number, DOUBLE) for number, name in enumerate("xy", 1)},
    VECTOR3: {name: Field(number, DOUBLE) for number, name in enumerate("xyz", 1)},
    QUATERNION: {name: Field(number, DOUBLE) for number, name in enumerate("xyzw", 1)},
    POSE: {"position": Field(1, MESSAGE, VECTOR3), "orientation": Field(2, MESSAGE, QUATERNION)},
    COMPRESSED_IMAGE: {
        "timestamp": Field(1, MESSAGE, TIME), "data": Field(2, BYTES), "format": Field(3, STRING),
        "frame_id": Field(4, STRING),
    },
    LOCATION_FIX: {
        "latitude": Field(1, DOUBLE), "longitude": Field(2, DOUBLE), "altitude": Field(3, DOUBLE),
        "position_covariance": Field(4, DOUBLE, repeated=True),
        "position_covariance_type": Field(5, ENUM, f"{LOCATION_FIX}.PositionCovarianceType"),
        "timestamp": Field(6, MESSAGE, TIME), "frame_id": Field(7, STRING),
    },
    POSE_IN_FRAME: {
        "timestamp": Field(1, MESSAGE, TIME), "frame_id": Field(2, STRING), "pose": Field(3, MESSAGE, POSE),
    },
    CIRCLES: {
        "timestamp": Field(1, MESSAGE, TIME), "position": Field(2, MESSAGE, POINT2), "diameter": Field(3, DOUBLE),
        "thickness": Field(4, DOUBLE), "fill_color": Field(5, MESSAGE, COLOR),
        "outline_color": Field(6, MESSAGE, COLOR),
    },
    POINTS: {
        "timestamp": Field(1, MESSAGE, TIME), "type": Field(2, ENUM, f"{POINTS}.Type"),
        "points": Field(3, MESSAGE, POINT2, repeated=True), "outline_color": Field(4, MESSAGE, COLOR),
        "outline_colors": Field(5, MESSAGE, COLOR, repeated=True), "fill_color": Field(6, MESSAGE, COLOR),
        "thickness": Field(7, DOUBLE),
    },
    TEXTS: {
        "timestamp": Field(1, MESSAGE, TIME), "position": Field(2, MESSAGE, POINT2), "text": Field(3, STRING),
        "font_size": Field(4, DOUBLE), "text_color": Field(5, MESSAGE, COLOR),
        "background_color": Field(6, MESSAGE, COLOR),
    },
    IMAGE_ANNOTATIONS: {
        "circles": Field(1, MESSAGE, CIRCLES, repeated=True), "points": Field(2, MESSAGE, POINTS, repeated=True),
        "texts": Field(3, MESSAGE, TEXTS, repeated=True),
    },
    LOG: {
        "timestamp": Field(1, MESSAGE, TIME), "level": Field(2, ENUM, f"{LOG}.Level"), "message": Field(3, STRING),
        "name": Field(4, STRING), "file": Field(5, STRING), "line": Field(6, FIXED32),
    },
    GEO_JSON: {"geojson": Field(1, STRING)},
    CAMERA_CALIBRATION: {
        "timestamp": Field(1, MESSAGE, TIME), "width": Field(2, FIXED32), "height": Field(3, FIXED32),
        "distortion_model": Field(4, STRING), "D": Field(5, DOUBLE, repeated=True),
        "K": Field(6, DOUBLE, repeated=True), "R": Field(7, DOUBLE, repeated=True),
        "P": Field(8, DOUBLE, repeated=True), "frame_id": Field(9, STRING),
    },
    FRAME_TRANSFORM: {
        "timestamp": Field(1, MESSAGE, TIME), "parent_frame_id": Field(2, STRING), "child_frame_id": Field(3, STRING),
        "translation": Field(4, MESSAGE, VECTOR3), "rotation": Field(5, MESSAGE, QUATERNION),
    },
    FRAME_TRANSFORMS: {"transforms": Field(1, MESSAGE, FRAME_TRANSFORM, repeated=True)},
    POINT3: {name: Field(number, DOUBLE) for number, name in enumerate("xyz", 1)},
    KEY_VALUE: {"key": Field(1, STRING), "value": Field(2, STRING)},
    DELETION: {
        "timestamp": Field(1, MESSAGE, TIME), "type": Field(2, ENUM, f"{DELETION}.Type"), "id": Field(3, STRING),
    },
    ARROW: {
        "pose": Field(1, MESSAGE, POSE), "shaft_length": Field(2, DOUBLE), "shaft_diameter": Field(3, DOUBLE),
        "head_length": Field(4, DOUBLE), "head_diameter": Field(5, DOUBLE), "color": Field(6, MESSAGE, COLOR),
    },
    CUBE: {"pose": Field(1, MESSAGE, POSE), "size": Field(2, MESSAGE, VECTOR3), "color": Field(3, MESSAGE, COLOR)},
    SPHERE: {"pose": Field(1, MESSAGE, POSE), "size": Field(2, MESSAGE, VECTOR3), "color": Field(3, MESSAGE, COLOR)},
    CYLINDER: {
        "pose": Field(1, MESSAGE, POSE), "size": Field(2, MESSAGE, VECTOR3), "bottom_scale": Field(3, DOUBLE),
        "top_scale": Field(4, DOUBLE), "color": Field(5, MESSAGE, COLOR),
    },
    LINE: {
        "type": Field(1, ENUM, f"{LINE}.Type"), "pose": Field(2, MESSAGE, POSE), "thickness": Field(3, DOUBLE),
        "scale_invariant": Field(4, BOOL), "points": Field(5, MESSAGE, POINT3, repeated=True),
        "color": Field(6, MESSAGE, COLOR), "colors": Field(7, MESSAGE, COLOR, repeated=True),
        "indices": Field(8, FIXED32, repeated=True),
    },
    TRIANGLES: {
        "pose": Field(1, MESSAGE, POSE), "points": Field(2, MESSAGE, POINT3, repeated=True),
        "color": Field(3, MESSAGE, COLOR), "colors": Field(4, MESSAGE, COLOR, repeated=True),
        "indices": Field(5, FIXED32, repeated=True),
    },
    TEXT: {
        "pose": Field(1, MESSAGE, POSE), "billboard": Field(2, BOOL), "font_size": Field(3, DOUBLE),
        "scale_invariant": Field(4, BOOL), "color": Field(5, MESSAGE, COLOR), "text": Field(6, STRING),
    },
    MODEL: {
        "pose": Field(1, MESSAGE, POSE), "scale": Field(2, MESSAGE, VECTOR3), "color": Field(3, MESSAGE, COLOR),
        "override_color": Field(4, BOOL), "url": Field(5, STRING), "media_type": Field(6, STRING),
        "data": Field(7, BYTES),
    },
    SCENE_ENTITY: {
        "timestamp": Field(1, MESSAGE, TIME), "frame_id": Field(2, STRING), "id": Field(3, STRING),
        "lifetime": Field(4, MESSAGE, DURATION), "frame_locked": Field(5, BOOL),
        "metadata": Field(6, MESSAGE, KEY_VALUE, repeated=True), "arrows": Field(7, MESSAGE, ARROW, repeated=True),
        "cubes": Field(8, MESSAGE, CUBE, repeated=True), "spheres": Field(9, MESSAGE, SPHERE, repeated=True),
        "cylinders": Field(10, MESSAGE, CYLINDER, repeated=True), "lines": Field(11, MESSAGE, LINE, repeated=True),
        "triangles": Field(12, MESSAGE, TRIANGLES, repeated=True), "texts": Field(13, MESSAGE, TEXT, repeated=True),
        "models": Field(14, MESSAGE, MODEL, repeated=True),
    },
    SCENE_UPDATE: {
        "deletions": Field(1, MESSAGE, DELETION, repeated=True),
        "entities": Field(2, MESSAGE, SCENE_ENTITY, repeated=True),
    },
}  # fmt: skip


def encode(name: str, fields: Fields) -> bytes:
    """One message. Messages in fields are mappings, or bytes where they are encoded already; repeated fields are
    sequences; what is zero or empty is left out.
    """
    table = MESSAGES[name]
    out = bytearray()
    for field_name, value in fields.items():
        field = table[field_name]
        if field.repeated and field.kind == DOUBLE:
            if value:
                out += _tag(field.number, LEN) + _bytes(struct.pack(f"<{len(value)}d", *value))
            continue
        for item in value if field.repeated else (value,):
            if field.kind == MESSAGE:
                inside = item if isinstance(item, bytes) else encode(field.of, item)
                out += _tag(field.number, LEN) + _bytes(inside)
            elif item or field.repeated:
                out += _scalar(field, item)
    return bytes(out)


def timestamp(time_us: int) -> bytes:
    """An encoded google.protobuf.Timestamp."""
    return encode(TIME, {"seconds": time_us // 1_000_000, "nanos": time_us % 1_000_000 * 1000})


def duration(seconds: float) -> bytes:
    """An encoded google.protobuf.Duration."""
    whole_us = round(seconds * 1e6)
    return encode(DURATION, {"seconds": whole_us // 1_000_000, "nanos": whole_us % 1_000_000 * 1000})


def point(x_px: float, y_px: float) -> bytes:
    """An encoded foxglove.Point2."""
    return _POINT.pack(1 << 3 | I64, x_px, 2 << 3 | I64, y_px)


def colour(r: float, g: float, b: float, a: float) -> bytes:
    """An encoded foxglove.Color; shares of one."""
    return encode(COLOR, {"r": r, "g": g, "b": b, "a": a})


@functools.cache
def descriptors(name: str) -> bytes:
    """The FileDescriptorSet of a message and of all that it names: one file for each package."""
    needed: dict[str, None] = {}
    _collect(name, needed)
    packages: dict[str, list[str]] = {}
    for message in needed:
        packages.setdefault(message.rpartition(".")[0], []).append(message)
    order = sorted(packages, key=lambda package: package == "foxglove")  # what is imported comes first
    imports = [_file_name(package) for package in order[:-1]]
    files = [_file(package, packages[package], imports if package == order[-1] else []) for package in order]
    return b"".join(_tag(1, LEN) + _bytes(file) for file in files)


def _collect(name: str, needed: dict[str, None]) -> None:
    needed[name] = None
    for field in MESSAGES[name].values():
        if field.kind == MESSAGE and field.of not in needed:
            _collect(field.of, needed)


def _file_name(package: str) -> str:
    return {"foxglove": "foxglove/messages.proto", "google.protobuf": "google/protobuf/timestamp.proto"}[package]


def _file(package: str, messages: list[str], imports: list[str]) -> bytes:
    """A FileDescriptorProto."""
    out = _text(1, _file_name(package)) + _text(2, package)
    out += b"".join(_text(3, name) for name in imports)
    out += b"".join(_tag(4, LEN) + _bytes(_message(name)) for name in messages)
    return out + _text(12, "proto3")


def _message(name: str) -> bytes:
    """A DescriptorProto with the enumerations that lie in it."""
    out = _text(1, name.rpartition(".")[2])
    for field_name, field in MESSAGES[name].items():
        label = REPEATED if field.repeated else OPTIONAL
        body = _text(1, field_name) + _int(3, field.number) + _int(4, label) + _int(5, field.kind)
        if field.of:
            body += _text(6, f".{field.of}")
        out += _tag(2, LEN) + _bytes(body)
    for enum, words in ENUMS.items():
        if enum.rpartition(".")[0] == name:
            values = b"".join(
                _tag(2, LEN) + _bytes(_text(1, word) + _int(2, number)) for number, word in enumerate(words)
            )
            out += _tag(4, LEN) + _bytes(_text(1, enum.rpartition(".")[2]) + values)
    return out


def _scalar(field: Field, value: Any) -> bytes:
    if field.kind == DOUBLE:
        return _tag(field.number, I64) + struct.pack("<d", value)
    if field.kind == FIXED32:
        return _tag(field.number, I32) + struct.pack("<I", value)
    if field.kind == STRING:
        return _text(field.number, value)
    if field.kind == BYTES:
        return _tag(field.number, LEN) + _bytes(value)
    return _int(field.number, value)


def _text(number: int, value: str) -> bytes:
    return _tag(number, LEN) + _bytes(value.encode())


def _int(number: int, value: int) -> bytes:
    return _tag(number, VARINT) + _varint(value)


@functools.cache
def _tag(number: int, wire: int) -> bytes:
    return _varint(number << 3 | wire)


def _bytes(data: bytes) -> bytes:
    return _varint(len(data)) + data


def _varint(value: int) -> bytes:
    if value <= 0x7F:
        return bytes((value,))
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)
