"""Evidence from ground truth: what perfect perception would report, without rendering a picture.

Boxes are of things that nothing nearer occludes; the mask has water up to the shore, less the things in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from paani import messages as m
from paani.arrays import F64, Bools
from paani.config import Config, CorridorConfig
from paani_sim.eye.camera import camera_pose, view_projection
from paani_sim.eye.configured_camera import boat_pose, build_camera
from paani_sim.trials.evidence_source import EvidenceFrame
from paani_sim.trials.silhouettes import bounds_in_picture, height_span_m, project_silhouettes
from paani_sim.worlds import Actor, Fault, FaultKind, Kind, Obstacle, World, actor_distance_along_m, actor_pose_along
from paani_sim.worlds.faults import find_active_fault
from paani_sim.worlds.footprint import build_outline, place_outline

MASK_ROWS, MASK_COLUMNS = 64, 80  # of the mask, as the segmenter's
MAX_RANGE_M = 90.0  # beyond it things are smaller than the smallest box
MIN_SIDE_PX = 4.0  # of a box
MIN_VISIBLE_FRAC = 0.3  # of a silhouette, for a box
VISIBLE_BEHIND_SHORE_M = 3.0  # things farther behind the shore are hidden
CONFIDENCE = 0.95
LABEL_OF_KIND = {
    Kind.PERSON: m.Label.PERSON,
    Kind.VESSEL: m.Label.VESSEL,
    Kind.PIER: m.Label.PIER,
    Kind.BUOY: m.Label.BUOY,
}
CAUSE_OF_FAULT = {
    FaultKind.CAMERA_BLACK: m.UnusableCause.BLACK,
    FaultKind.CAMERA_FROZEN: m.UnusableCause.FROZEN,
    FaultKind.CAMERA_BLURRED: m.UnusableCause.BLURRED,
}


class VisibleScene(NamedTuple):
    """`water` `(64, 80)`: which cells show water. `boxes`: label and normalised corners."""

    water: Bools
    boxes: tuple[tuple[m.Label, m.BoxXyxy], ...]


class GroundTruthEvidenceSource:
    """Computes evidence from the geometry of the world."""

    def __init__(self, world: World, faults: Sequence[Fault], config: Config) -> None:
        self._world, self._faults, self._config = world, tuple(faults), config
        self._camera = build_camera(config.eye)
        self._things: tuple[Obstacle | Actor, ...] = (*world.obstacles, *world.actors)
        self._shapes = [build_outline(thing) for thing in self._things]
        self._heights_m = np.array([height_span_m(thing) for thing in self._things]).reshape(-1, 2)
        self._still_m = [place_outline(s, o.pose) for s, o in zip(self._shapes, world.obstacles, strict=False)]
        self._shore_m = world.shore_m
        self._shore_legs = np.roll(world.shore_m, -1, axis=0) - world.shore_m
        self._shore_reach_m = np.hypot(self._shore_legs[:, 0], self._shore_legs[:, 1])
        self._corridor_weights = _CorridorWeights(config.perception.corridors)

    def observe(self, truth: m.TruePose, header: m.PictureHeader, roll_rad: float) -> EvidenceFrame | None:
        """See `EvidenceSource`."""
        t_s = truth.sim_us * 1e-6
        if find_active_fault(self._faults, FaultKind.CAMERA_DROPPED, t_s):
            return None
        cause = next(
            (cause for kind, cause in CAUSE_OF_FAULT.items() if find_active_fault(self._faults, kind, t_s)), None
        )
        evidence = m.Evidence(
            source_us=header.source_us,
            frame_seq=header.frame_seq,
            frame_epoch=header.frame_epoch,
            width_px=header.width_px,
            height_px=header.height_px,
            usable=False,
            cause=cause or m.UnusableCause.NONE,
            models="truth",
        )
        if cause is None:
            evidence = self._fill_evidence(evidence, self.compute_visible_scene(truth), roll_rad)
        return EvidenceFrame(evidence)

    def close(self) -> None:
        """See `EvidenceSource`."""

    def compute_visible_scene(self, truth: m.TruePose) -> VisibleScene:
        """Water cells and boxes of the picture at this pose."""
        pose, t_s = boat_pose(truth), truth.sim_us * 1e-6
        camera_m, map_from_camera = camera_pose(pose, self._camera)
        clip_from_map = view_projection(pose, self._camera)
        ranges_m, directions = self._shore_ranges_m(camera_m, map_from_camera)
        ends = np.column_stack(
            [camera_m[:2] + ranges_m[:, None] * directions, np.zeros(MASK_COLUMNS), np.ones(MASK_COLUMNS)]
        )
        clip = ends @ clip_from_map.T
        shore_down = 0.5 - 0.5 * clip[:, 1] / np.maximum(clip[:, 3], 1e-6)
        water = (np.arange(MASK_ROWS)[:, None] + 0.5) / MASK_ROWS > shore_down[None, :]
        near, distances_m = self._find_candidates(
            camera_m, map_from_camera, ranges_m, self._update_outlines(truth, t_s)
        )
        covered = np.zeros((MASK_ROWS, MASK_COLUMNS), np.uint8)
        boxes = []
        order = sorted(near, key=lambda i: distances_m[i])
        outlines = self._outlines_m[order] if order else np.empty((0, 8, 2))
        for number, points in zip(
            order, project_silhouettes(outlines, self._heights_m[order], clip_from_map), strict=True
        ):
            box = self._rasterise_silhouette(points, covered)
            kind = self._things[number].kind
            if box is not None and kind in LABEL_OF_KIND:
                boxes.append((LABEL_OF_KIND[kind], box))
        return VisibleScene(water & (covered == 0), tuple(boxes))

    def _update_outlines(self, truth: m.TruePose, t_s: float) -> F64:
        alongs = truth.actors_along_m or tuple(actor_distance_along_m(actor, t_s) for actor in self._world.actors)
        moving = [
            place_outline(shape, actor_pose_along(actor, along_m))
            for shape, actor, along_m in zip(
                self._shapes[len(self._still_m) :], self._world.actors, alongs, strict=True
            )
        ]
        self._outlines_m = np.array([*self._still_m, *moving]).reshape(-1, 8, 2)
        middles_m: F64 = self._outlines_m.mean(axis=1)
        return middles_m

    def _find_candidates(
        self, camera_m: F64, map_from_camera: F64, ranges_m: F64, middles_m: F64
    ) -> tuple[list[int], F64]:
        """Things ahead, near enough, and not behind the shore; and how far each one's nearest corner is."""
        rel = middles_m - camera_m[:2]
        corners = self._outlines_m - camera_m[:2]
        distances_m = np.hypot(corners[..., 0], corners[..., 1]).min(axis=1) if len(rel) else np.empty(0)
        ahead = -map_from_camera[:2, 2]
        depth = corners @ ahead
        side = rel @ map_from_camera[:2, 0]
        focal = self._camera.focal_px
        with np.errstate(divide="ignore", invalid="ignore"):
            across = 0.5 + (focal * side / np.maximum(rel @ ahead, 1e-3)) / self._camera.width_px
        column = np.clip(np.nan_to_num(across) * MASK_COLUMNS, 0, MASK_COLUMNS - 1).astype(int)
        is_visible = (
            (depth.max(axis=1) > 0.2)
            & (distances_m < MAX_RANGE_M)
            & (distances_m < ranges_m[column] + VISIBLE_BEHIND_SHORE_M)
        )
        return np.flatnonzero(is_visible).tolist(), distances_m

    def _shore_ranges_m(self, camera_m: F64, map_from_camera: F64) -> tuple[F64, F64]:
        """For each column, how far the shore is along the water, and which way that is."""
        across = ((np.arange(MASK_COLUMNS) + 0.5) / MASK_COLUMNS - 0.5) * self._camera.width_px / self._camera.focal_px
        directions = across[:, None] * map_from_camera[:2, 0] - map_from_camera[:2, 2]
        directions = directions / np.hypot(directions[:, 0], directions[:, 1])[:, None]
        rel = self._shore_m - camera_m[:2]
        near = np.hypot(rel[:, 0], rel[:, 1]) - self._shore_reach_m < MAX_RANGE_M
        start, leg = rel[near], self._shore_legs[near]
        cross = directions[:, :1] * leg[:, 1] - directions[:, 1:] * leg[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            range_m = (start[:, 0] * leg[:, 1] - start[:, 1] * leg[:, 0]) / cross
            part = (start[:, 0] * directions[:, 1:] - start[:, 1] * directions[:, :1]) / cross
        hit = (range_m > 0.0) & (part >= 0.0) & (part <= 1.0)
        nearest = np.where(hit, range_m, 4.0 * MAX_RANGE_M).min(axis=1, initial=4.0 * MAX_RANGE_M)
        return nearest, directions

    def _rasterise_silhouette(self, points: F64, covered: NDArray[np.uint8]) -> m.BoxXyxy | None:
        """Cover its cells; its box where enough of it is to be seen."""
        if not len(points):
            return None
        low, high = bounds_in_picture(points)
        if not (high > low).all():
            return None
        cells = np.zeros((MASK_ROWS, MASK_COLUMNS), np.uint8)
        hull = cv2.convexHull(((points * [MASK_COLUMNS, MASK_ROWS] - 0.5) * 16.0).astype(np.int32))
        cv2.fillConvexPoly(cells, hull, 1, shift=4)
        is_visible = (cells == 1) & (covered == 0)
        whole, count = int(np.count_nonzero(cells)), int(np.count_nonzero(is_visible))
        covered |= cells
        if whole == 0 or count < MIN_VISIBLE_FRAC * whole:
            return None
        if count < 0.9 * whole:
            rows, columns = np.flatnonzero(is_visible.any(axis=1)), np.flatnonzero(is_visible.any(axis=0))
            low = np.maximum(low, (columns[0] / MASK_COLUMNS, rows[0] / MASK_ROWS))
            high = np.minimum(high, ((columns[-1] + 1) / MASK_COLUMNS, (rows[-1] + 1) / MASK_ROWS))
        side_px = (high - low) * (self._camera.width_px, self._camera.height_px)
        if side_px.min() < MIN_SIDE_PX:
            return None
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def _fill_evidence(self, empty: m.Evidence, visible: VisibleScene, roll_rad: float) -> m.Evidence:
        perception = self._config.perception
        bound = perception.max_roll_rad
        roll_rad = float(np.clip(roll_rad, -bound, bound)) if perception.follow_roll else 0.0
        level = level_mask(visible.water, roll_rad, empty.width_px / empty.height_px)
        left, center, right = self._corridor_weights.lane_evidence(level)
        detections = tuple(
            m.Detection(label=label, confidence=CONFIDENCE, box_xyxy=box)
            for label, box in visible.boxes[: perception.detections.max_boxes]
        )
        return m.Evidence(
            source_us=empty.source_us,
            frame_seq=empty.frame_seq,
            frame_epoch=empty.frame_epoch,
            width_px=empty.width_px,
            height_px=empty.height_px,
            usable=True,
            detections=detections,
            left=left,
            center=center,
            right=right,
            segmentation=m.SegmentationSource.LEARNED,
            navigation_eligible=True,
            confidence_threshold=perception.detections.confidence,
            models=empty.models,
            roll_rad=roll_rad,
            water_edge=find_water_edge(visible.water),
        )


class _CorridorWeights:
    """The corridors' weights over the mask."""

    def __init__(self, corridors: CorridorConfig) -> None:
        self._rows = _overlap_frac(MASK_ROWS, corridors.top, 1.0)
        self._clear_column_frac = corridors.clear_column
        self._columns = [
            _overlap_frac(MASK_COLUMNS, *span) for span in (corridors.left, corridors.center, corridors.right)
        ]

    def lane_evidence(self, water: Bools) -> list[m.LaneEvidence]:
        """Left, centre, right."""
        of_column = (self._rows @ water) / self._rows.sum()
        return [self._summarise_corridor(of_column, columns) for columns in self._columns]

    def _summarise_corridor(self, water: F64, columns: F64) -> m.LaneEvidence:
        best = run = 0.0
        for is_clear, width in zip((water >= self._clear_column_frac - 1e-12).tolist(), columns.tolist(), strict=True):
            run = run + width if width > 0.0 and is_clear else 0.0
            best = max(best, run)
        total = float(columns.sum())
        non_water = 1.0 - float((water * columns).sum()) / total
        return m.LaneEvidence(
            non_water=min(1.0, max(0.0, non_water)), uncertainty=0.0, clear_width=min(1.0, best / total)
        )


def level_mask(water: Bools, roll_rad: float, aspect: float) -> Bools:
    """The mask turned about its middle so that the horizon is level; what comes in from outside is no water."""
    if abs(roll_rad) < 1e-3:
        return water
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    rows, columns = water.shape
    x = ((np.arange(columns) + 0.5) / columns - 0.5) * aspect
    y = (np.arange(rows) + 0.5) / rows - 0.5
    from_x = (cos * x[None, :] + sin * y[:, None]) / aspect
    from_y = cos * y[:, None] - sin * x[None, :]
    column = np.floor((from_x + 0.5) * columns).astype(int)
    row = np.floor((from_y + 0.5) * rows).astype(int)
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    turned: Bools = inside & water[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
    return turned


def find_water_edge(water: Bools) -> tuple[float, ...]:
    """Of each column, left to right, the lower edge of the first cell from below that is not water; 0.0: none."""
    rows = water.shape[0]
    blocked = ~water
    last = rows - np.argmax(blocked[::-1], axis=0)
    return tuple(np.where(blocked.any(axis=0), last / rows, 0.0).tolist())


def _overlap_frac(cells: int, start: float, end: float) -> F64:
    """How much of each of `cells` equal cells of [0, 1] lies in [start, end]."""
    edges = np.arange(cells + 1) / cells
    inside: F64 = np.minimum(edges[1:], end) - np.maximum(edges[:-1], start)
    return np.maximum(inside, 0.0) * cells
