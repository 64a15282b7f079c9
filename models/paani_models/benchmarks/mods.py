"""Segmentation protocol of the MODS benchmark (Bovcon et al. 2021): water edge, obstacle F1, also in the danger zone.

Written from the description of the protocol. Masks hold MODS's classes: obstacle 0, water 1, sky 2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F64, U8, Bools
from paani.errors import UserError
from paani.undecodable import UNREADABLE

OBSTACLE, WATER, SKY = 0, 1, 2
COLOURS = ((0, 0, 0), (255, 0, 0), (0, 255, 0))  # RGB
SIZE_WH = (1278, 958)
EDGE_TOLERANCE_PX = 20
MIN_OVERLAP = 0.5  # share of an object's area; the benchmark's code has this, its readme says 0.15
MIN_AREA_PX = 25
EXPANDED_FRAC = 0.01  # of the width: margin around land and objects in which nothing is a false alarm
WIDTH_FACTOR = 1.1  # a blob wider than the found object by more than this factor holds false alarms
ZONE_RADIUS_M = 15.0
CAMERA_HEIGHT_M = 1.0
ZONE_HALF_ANGLE_DEG = 40.0

_FROM_OURS = np.array([WATER, OBSTACLE, SKY], np.uint8)  # our classes are water 0, obstacle 1, sky 2


class Obstacle(msgspec.Struct, frozen=True):
    """bbox: x, y, width, height [px]. type "negative" marks a region that is not judged."""

    type: str
    bbox: tuple[float, float, float, float]
    area: float


class WaterEdge(msgspec.Struct, frozen=True):
    """A line from left to right along which water meets land [px]."""

    x_axis: tuple[float, ...]
    y_axis: tuple[float, ...]


class Frame(msgspec.Struct, frozen=True, kw_only=True):
    """One annotated picture. exhaustive: 0 where not everything is annotated, so that nothing is a false alarm."""

    id: int
    image_file_name: str
    obstacles: tuple[Obstacle, ...] = ()
    water_edges: tuple[WaterEdge, ...] = ()
    roll: float = 0.0
    pitch: float = 0.0
    exhaustive: int = 1


class Sequence(msgspec.Struct, frozen=True, kw_only=True):
    """Frames of one run; path is "/NAME/frames/"."""

    id: int
    path: str
    frames: tuple[Frame, ...]
    exhaustive: int = 1


class Dataset(msgspec.Struct, frozen=True):
    """All sequences."""

    sequences: tuple[Sequence, ...]


class _File(msgspec.Struct, frozen=True):
    dataset: Dataset


@dataclass
class ModsTally:
    """Counts over a data set: water edge, and obstacles overall and in the danger zone (found, missed, alarms)."""

    frame_errors_px: list[float] = field(default_factory=list)
    edge_hits: int = 0
    edge_misses: int = 0
    over_px: int = 0
    under_px: int = 0
    objects: NDArray[np.int64] = field(default_factory=lambda: np.zeros((2, 3), np.int64))

    def add(self, label: U8, frame: Frame, zone: Bools, *, exhaustive: bool = True) -> None:
        """Count one picture. label: MODS classes, at the size of the annotation; zone: True in the danger zone."""
        obstacle = label == OBSTACLE
        land = land_mask(frame.water_edges, obstacle.shape)
        self._edge(obstacle, np.where(_columns_under_objects(frame, land), 0, land.sum(0)))
        found = self._objects(obstacle, frame, zone)
        if exhaustive and frame.exhaustive:
            self._alarms(obstacle, frame, land, zone, found)

    def figures(self) -> dict[str, float]:
        """Edge error in px, shares and F1 in percent."""
        edge, wrong = self.edge_hits + self.edge_misses, self.over_px + self.under_px
        return {
            "edge_px": float(np.mean(self.frame_errors_px)) if self.frame_errors_px else float("nan"),
            "edge_hit": 100.0 * self.edge_hits / edge if edge else float("nan"),
            "overshoot": 100.0 * self.over_px / wrong if wrong else 0.0,
            "undershoot": 100.0 * self.under_px / wrong if wrong else 0.0,
            "f1": _f1(self.objects[0]),
            "f1_zone": _f1(self.objects[1]),
        }

    def _edge(self, obstacle: Bools, edge_row: NDArray[np.int64]) -> None:
        """edge_row: first row below the land per column, 0 where none is judged."""
        height = len(obstacle)
        lower = np.zeros(obstacle.shape, np.bool_)
        lower[:-1] = obstacle[:-1] & ~obstacle[1:]
        away = (
            cv2.distanceTransform((~lower).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
            if lower.any()
            else np.full(obstacle.shape, np.inf)
        )
        errors = []
        for x in np.flatnonzero((edge_row > 0) & (edge_row < height)):
            y = int(edge_row[x])
            column, hit = obstacle[:, x], away[y, x] <= EDGE_TOLERANCE_PX
            errors.append(float(away[y, x]) if hit else float(y))
            self.edge_hits += int(hit)
            self.edge_misses += int(not hit)
            if column[y]:
                self.under_px += int(np.append(column[y:], False).argmin())
            else:
                self.over_px += int(np.append(column[:y][::-1], True).argmax())
        if errors:
            self.frame_errors_px.append(float(np.mean(errors)))

    def _objects(self, obstacle: Bools, frame: Frame, zone: Bools) -> list[Obstacle]:
        found = []
        for each in _scored_obstacles(frame):
            spot = _box_slices(each)
            hit = bool(obstacle[spot].sum() >= MIN_OVERLAP * each.area)
            column = 0 if hit else 1
            self.objects[0, column] += 1
            self.objects[1, column] += int(zone[spot].any())
            if hit:
                found.append(each)
        return found

    def _alarms(self, obstacle: Bools, frame: Frame, land: Bools, zone: Bools, found: list[Obstacle]) -> None:
        reach = int(np.ceil(EXPANDED_FRAC * obstacle.shape[1]))
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        near = np.asarray(cv2.dilate(land.astype(np.uint8), kernel), np.bool_)
        for each in frame.obstacles:
            if each.type == "negative":
                near[_box_slices(each, reach)] = True
        count, blobs, stats, _ = cv2.connectedComponentsWithStats((obstacle & ~near).astype(np.uint8), connectivity=8)
        for blob in range(1, count):
            x, y, width, height, area = (int(value) for value in stats[blob])
            if area <= MIN_AREA_PX:
                continue
            mask, widths = blobs == blob, []
            inside = False
            for each in _scored_obstacles(frame):
                covered = int(mask[_box_slices(each, reach)].sum())
                if each in found and covered > MIN_OVERLAP * each.area:
                    widths.append(each.bbox[2])
                inside |= covered > MIN_OVERLAP * area
            wide = max(0, int((width - sum(widths)) / (WIDTH_FACTOR * max(widths))) - 1) if widths else 0
            alarms = wide if widths else int(not inside)
            self.objects[0, 2] += alarms
            self.objects[1, 2] += alarms if zone[y : y + height, x : x + width].any() else 0


def land_mask(edges: tuple[WaterEdge, ...], shape: tuple[int, ...]) -> Bools:
    """True above any of the lines, bool [H,W]; False in columns without one."""
    rows = np.arange(shape[0])[:, None]
    land = np.zeros(shape[:2], np.bool_)
    for edge in edges:
        x, y = np.array(edge.x_axis), np.array(edge.y_axis)
        if len(x) < 2 or len(x) != len(y):
            continue
        order = np.argsort(x, kind="stable")
        columns = np.arange(max(0, int(np.ceil(x.min()))), min(shape[1] - 1, int(x.max())) + 1)
        land[:, columns] |= rows < np.interp(columns, x[order], y[order])
    return land


def danger_zone(
    roll_deg: float,
    pitch_deg: float,
    camera: F64,
    distortion: F64,
    size_wh: tuple[int, int] = SIZE_WH,
    *,
    radius_m: float = ZONE_RADIUS_M,
    height_m: float = CAMERA_HEIGHT_M,
) -> Bools:
    """Water nearer than `radius_m` to a camera `height_m` above it, tilted as its IMU says: bool [H,W].

    camera: 3x3 matrix; distortion: OpenCV's coefficients.
    """
    roll, pitch = np.radians((roll_deg, pitch_deg))
    normal = np.array([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])
    bearing = np.radians(np.linspace(-ZONE_HALF_ANGLE_DEG, ZONE_HALF_ANGLE_DEG, 161))
    ahead, left = radius_m * np.cos(bearing), -radius_m * np.sin(bearing)
    up = -(normal[0] * ahead + normal[1] * left + height_m) / normal[2]
    points = np.stack([-left, -up, ahead], 1)
    projected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera, distortion)[0][:, 0]
    width, height = size_wh
    corners = [(projected[0, 0], 4 * height), *projected, (projected[-1, 0], 4 * height)]
    polygon = np.clip(np.round(corners), -30000, 30000).astype(np.int32)
    mask = np.zeros((height, width), np.uint8)
    cv2.fillPoly(mask, [polygon], (1,))
    return mask.astype(np.bool_)


def to_mods_classes(label: U8) -> U8:
    """Our classes 0..2 -> MODS's."""
    return _FROM_OURS[label]


def write_prediction(folder: Path, method: str, sequence: str, frame: str, label: U8) -> None:
    """Write `folder`/METHOD/SEQUENCE/FRAME.png in the benchmark's colours. label: MODS's classes."""
    path = folder / method / sequence / f"{Path(frame).stem}.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    rgb = np.array(COLOURS, np.uint8)[label]
    if not cv2.imwrite(str(path), cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)):
        raise UserError(f"{path}: cannot be written")


def read_dataset(path: Path) -> Dataset:
    """Annotations of `mods.json`. Raises UserError naming a file that is missing or malformed."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=_File).dataset
    except UNREADABLE as error:
        raise UserError(f"{path}: {error}") from error


def _scored_obstacles(frame: Frame) -> list[Obstacle]:
    return [each for each in frame.obstacles if each.type != "negative" and each.area >= MIN_AREA_PX]


def _box_slices(obstacle: Obstacle, margin: int = 0) -> tuple[slice, slice]:
    x, y, width, height = (round(value) for value in obstacle.bbox)
    return (
        slice(max(0, y - margin), max(0, y + height + margin)),
        slice(max(0, x - margin), max(0, x + width + margin)),
    )


def _columns_under_objects(frame: Frame, land: Bools) -> Bools:
    """Columns where an object stands across the water edge, which cannot be placed there."""
    columns = np.zeros(land.shape[1], np.bool_)
    for each in frame.obstacles:
        patch = land[_box_slices(each)]
        if patch.any() and not patch.all():
            columns[_box_slices(each)[1]] = True
    return columns


def _f1(counts: NDArray[np.int64]) -> float:
    found, missed, alarms = (int(count) for count in counts)
    total = 2 * found + missed + alarms
    return 100.0 * 2 * found / total if total else float("nan")
