"""A recording in Rerun: pictures, boxes, tracks, map and plots. Needs the extra `rerun`; nothing else imports its SDK.

Everything lies on the timeline `time`: pictures and what is drawn over them when the picture was taken, the rest when
it was sent. Rerun shows the newest of each thing at a time, so a thing is cleared where it had gone stale.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from paani import keys
from paani import messages as m
from paani.config import Config
from paani.errors import UserError
from paani.geometry import quaternion
from paani.logs.pictures import RecordedPicture, paired_pictures
from paani.logs.reader import Log, Record
from paani.undecodable import UNDECODABLE
from paani.whole_file import replacement_file
from paani_services.foxglove.mask_colours import tint_mask
from paani_services.foxglove.transforms import camera_rotation

TIMELINE = "time"
MAP, BOAT, CAMERA = "map", "map/boat", "map/boat/camera"
PICTURE, BOXES, MASK = f"{CAMERA}/picture", f"{CAMERA}/picture/tracks", "mask"
PLAN, OBSTACLES, ROUTE, FENCE, TRACK = "map/plan", "map/obstacles", "map/route", "map/fence", "map/track"
HOME, RALLY = "map/home", "map/rally"
EARTH, EARTH_TRACK = "earth/gps", "earth/track"
ORANGE, GREY, RED, BLUE, GREEN = (255, 181, 84), (160, 170, 178), (242, 92, 92), (89, 168, 242), (87, 214, 155)
WHITE = (242, 242, 242)
EYE_M, LOOK_AT_M = (-9.0, 3.0, 5.0), (5.0, 0.0, 0.0)  # from astern, in the axes of the boat
CHART_ZOOM = 18.0  # half a kilometre across
LINE_M, HULL_M, OBSTACLE_M, PLACE_M = 0.06, 0.5, 1.0, 0.2
MAX_FRAMES = 32  # pictures whose evidence may still come
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")
PICTURES = (keys.PICTURE.name, keys.MASK.name)
HEADER = msgspec.json.Decoder(m.PictureHeader)
SERIES = {
    "plots/speed/ordered": BLUE, "plots/speed/estimated": ORANGE, "plots/risk/left": BLUE, "plots/risk/center": ORANGE,
    "plots/risk/right": GREEN, "plots/risk/limit": GREY, "plots/thrust/left": RED, "plots/thrust/right": GREEN,
}  # fmt: skip


def view_in_rerun(log: Log, out: Path | None, seen: Callable[[Record], None]) -> str:
    """Write the file, or open the viewer where none is named. Returns a line that says what was done.

    seen: is called with each record. Raises UserError where there is no screen, or the file cannot be written.
    """
    stream = rr.RecordingStream("paani", recording_id=log.files[0].stem)
    if out is None:
        if not any(os.environ.get(name) for name in SCREENS):
            raise UserError("logs view: no screen here; name a file to write, to be opened elsewhere: --out FILE")
        stream.spawn(default_blueprint=layout())
        return f"{_convert(log, stream, seen)} messages shown in Rerun"
    with replacement_file(out, "--out") as beside:
        stream.save(beside, default_blueprint=layout())
        written = _convert(log, stream, seen)
        stream.disconnect()
    return f"{out}: {written} messages; open it with `rerun {out}`"


def _convert(log: Log, stream: rr.RecordingStream, seen: Callable[[Record], None]) -> int:
    drive = RerunDrive(stream, log.config())
    wanted = (*drive.topics, *PICTURES, *(f"{name}/header" for name in PICTURES))

    def noted() -> Any:
        for record in log.records(wanted):
            seen(record)
            yield record

    for each in paired_pictures(noted(), PICTURES):
        drive.add(each)
    drive.finish()
    stream.flush()
    return drive.written


class RerunDrive:
    """Turns recorded messages into Rerun's archetypes. `written`: messages shown so far."""

    def __init__(self, stream: rr.RecordingStream, config: Config) -> None:
        self._stream, self._calibration = stream, config.calibration
        self._frames: dict[tuple[int, int], m.PictureHeader] = {}
        self._fresh_until_us: dict[str, int] = {}
        self._track: list[tuple[float, float]] = []
        self._earth_track: list[tuple[float, float]] = []
        self._lines: dict[str, str] = {}
        self._lens_size: tuple[int, int] | None = None  # of the pictures that the pinhole was said of
        self.written = 0
        views: Mapping[keys.Topic[Any], Callable[[Any], None]] = {
            keys.ODOMETRY: self._odometry, keys.GPS: self._gps, keys.TRACKS: self._tracks,
            keys.ADVISORY: self._advisory, keys.COMMAND: self._command, keys.THRUST_APPLIED: self._applied,
            keys.PREDICTION: self._prediction, keys.ROUTE: self._route, keys.MISSION: self._mission,
            keys.OPERATOR_STATE: self._operator,
        }  # fmt: skip
        self._views = {topic.name: (msgspec.json.Decoder(topic.type), view) for topic, view in views.items()}
        rr.set_log_time_enabled(False, recording=stream)
        rr.set_log_tick_enabled(False, recording=stream)
        for path, colour in SERIES.items():
            stream.log(path, rr.SeriesLines(colors=[colour], names=[path.rpartition("/")[2]]), static=True)
        for path in (MAP, BOAT):
            stream.log(path, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.log(
            f"{BOAT}/hull", rr.Arrows3D(vectors=[[2 * HULL_M, 0.0, 0.0]], origins=[[-HULL_M, 0.0, 0.0]], radii=0.12),
            static=True,
        )  # fmt: skip

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics that are shown, pictures apart."""
        return tuple(self._views)

    def add(self, each: Record | RecordedPicture) -> None:
        """The next message, in the order of the recording. What cannot be decoded is left out."""
        try:
            if isinstance(each, RecordedPicture):
                self._picture(each.topic, HEADER.decode(each.header), each.data)
            else:
                decoder, view = self._views[each.topic]
                message = decoder.decode(each.data)
                self._expire(message.sent_us)
                self._at(message.sent_us)
                view(message)
        except UNDECODABLE:
            return
        self.written += 1

    def finish(self) -> None:
        """The whole track, in the map and on the earth."""
        if len(self._track) > 1:
            line = [(x, y, 0.0) for x, y in self._track]
            self._stream.log(TRACK, rr.LineStrips3D([line], radii=LINE_M, colors=[ORANGE]), static=True)
        if len(self._earth_track) > 1:
            self._stream.log(EARTH_TRACK, rr.GeoLineStrings(lat_lon=[self._earth_track], colors=[ORANGE]), static=True)

    def _at(self, time_us: int) -> None:
        self._stream.set_time(TIMELINE, timestamp=np.datetime64(time_us, "us"))

    def _transient(self, path: str, entity: rr.AsComponents, at_us: int, fresh_s: float) -> None:
        self._stream.log(path, entity)
        self._fresh_until_us[path] = at_us + round(fresh_s * 1e6)

    def _expire(self, now_us: int) -> None:
        """Clear what was not renewed while it was fresh."""
        for path, until_us in list(self._fresh_until_us.items()):
            if until_us < now_us:
                self._at(until_us)
                self._stream.log(path, rr.Clear(recursive=False))
                del self._fresh_until_us[path]

    def _picture(self, topic: str, header: m.PictureHeader, data: bytes) -> None:
        self._at(header.source_us)
        if topic == keys.MASK.name:
            if (tinted := tint_mask(data)) is not None:
                self._stream.log(MASK, rr.EncodedImage(contents=tinted, media_type="image/png"))
            return
        self._frames[header.frame_epoch, header.frame_seq] = header
        while len(self._frames) > MAX_FRAMES:
            del self._frames[next(iter(self._frames))]
        size = (header.width_px, header.height_px)
        if self._calibration.valid and header.width_px and size != self._lens_size:
            self._lens(header)
            self._lens_size = size
        self._stream.log(PICTURE, rr.EncodedImage(contents=data, media_type=header.media_type))
        # No box of an earlier picture lies over this one; its own come later, at the same time.
        self._stream.log(BOXES, rr.Clear(recursive=False))

    def _lens(self, header: m.PictureHeader) -> None:
        lens = self._calibration
        focal_px = float(0.5 / np.tan(0.5 * np.radians(lens.hfov_deg)) * header.width_px)
        size = (header.width_px, header.height_px)
        centre = [share * side for share, side in zip(lens.centre_frac, size, strict=True)]
        turn = camera_rotation(lens)
        mount = rr.Transform3D(
            translation=[lens.forward_m, 0.0, lens.height_m], quaternion=rr.Quaternion(xyzw=[turn[k] for k in "xyzw"])
        )
        self._stream.log(CAMERA, mount, static=True)
        pinhole = rr.Pinhole(
            focal_length=focal_px, principal_point=centre, resolution=size, image_plane_distance=2.0,
        )  # fmt: skip
        self._stream.log(PICTURE, pinhole, static=True)

    def _tracks(self, tracks: m.Tracks) -> None:
        header = self._frames.pop((tracks.frame_epoch, tracks.frame_seq), None)
        if header is None:
            return  # without its picture, or drawn already
        drawn = [track for track in tracks.tracks if track.accepted or not track.held]
        size = np.array([header.width_px, header.height_px] * 2, np.float32)
        array = np.array([track.box_xyxy for track in drawn], np.float32).reshape(-1, 4) * size
        self._at(header.source_us)
        boxes = rr.Boxes2D(
            array=array, array_format=rr.Box2DFormat.XYXY,
            labels=[f"#{track.id} {track.label} {track.confidence:.2f}" for track in drawn],
            colors=[RED if t.immediate_danger else ORANGE if t.accepted and not t.held else GREY for t in drawn],
        )  # fmt: skip
        self._stream.log(BOXES, boxes)

    def _odometry(self, pose: m.Odometry) -> None:
        turn = quaternion(pose.roll_rad, pose.pitch_rad, pose.yaw_rad)
        place = rr.Transform3D(
            translation=[pose.x_m, pose.y_m, 0.0], quaternion=rr.Quaternion(xyzw=[turn[k] for k in "xyzw"])
        )
        self._plot("plots/speed/estimated", pose.surge_mps)
        if pose.healthy:
            self._transient(BOAT, place, pose.sent_us, keys.ODOMETRY.fresh_s)
            self._track.append((pose.x_m, pose.y_m))
            self._earth_track.append((pose.latitude_deg, pose.longitude_deg))

    def _gps(self, fix: m.GpsFix) -> None:
        if fix.fix:
            point = rr.GeoPoints(lat_lon=[[fix.latitude_deg, fix.longitude_deg]], radii=[-6.0], colors=[BLUE])
            self._transient(EARTH, point, fix.sent_us, keys.GPS.fresh_s)

    def _advisory(self, advisory: m.Advisory) -> None:
        for name, risk in (
            ("left", advisory.left.risk), ("center", advisory.center.risk), ("right", advisory.right.risk),
            ("limit", advisory.center_block_risk),
        ):  # fmt: skip
            self._plot(f"plots/risk/{name}", risk)
        stands = advisory.direction in {m.Direction.STOP, m.Direction.NO_DATA}
        text = f"{advisory.direction} ({advisory.reason}). {advisory.explanation}"
        self._line("advisor", text, f"{advisory.direction} {advisory.reason}", warn=stands)

    def _command(self, command: m.NavCommand) -> None:
        self._plot("plots/speed/ordered", command.speed_mps if command.enable else 0.0)

    def _applied(self, applied: m.ThrustApplied) -> None:
        self._plot("plots/thrust/left", applied.left_n)
        self._plot("plots/thrust/right", applied.right_n)
        zero = applied.zero_cause is not m.ZeroCause.NONE
        text = f"no thrust: {applied.zero_cause}" if zero else "thrust applied"
        self._line("thrust", text, text, warn=zero)

    def _operator(self, state: m.OperatorState) -> None:
        text = f"stopped by {state.by}" if state.stopped else f"armed by {state.by}" if state.armed else "not armed"
        self._line("operator", text, text, warn=state.stopped)

    def _prediction(self, ahead: m.Prediction) -> None:
        path = [[(p.x_m, p.y_m, 0.05) for p in ahead.path]] if len(ahead.path) > 1 else []
        plan = rr.LineStrips3D(path, radii=LINE_M, colors=[ORANGE] * len(path))
        self._transient(PLAN, plan, ahead.sent_us, keys.PREDICTION.fresh_s)
        moving = ahead.obstacles
        obstacles = rr.Cylinders3D(
            lengths=[OBSTACLE_M] * len(moving), radii=[each.radius_m for each in moving],
            centers=[(each.x_m, each.y_m, OBSTACLE_M / 2) for each in moving], colors=[RED] * len(moving),
            labels=[f"#{each.track_id} {np.hypot(each.east_mps, each.north_mps):.1f} m/s" for each in moving],
        )  # fmt: skip
        self._transient(OBSTACLES, obstacles, ahead.sent_us, keys.PREDICTION.fresh_s)
        self._transient(HOME, _places(ahead.home, "home"), ahead.sent_us, keys.PREDICTION.fresh_s)

    def _route(self, route: m.Route) -> None:
        points = [(p.x_m, p.y_m, 0.0) for p in route.waypoints]
        points += points[:1] if route.repeat else []
        line = [points] if len(points) > 1 else []
        self._transient(
            ROUTE, rr.LineStrips3D(line, radii=LINE_M / 2, colors=[BLUE] * len(line)), route.sent_us, keys.ROUTE.fresh_s
        )

    def _mission(self, mission: m.Mission) -> None:
        lines = [[(p.x_m, p.y_m, 0.0) for p in (*area.corners, area.corners[0])] for area in mission.bounds]
        colours = [GREEN if area.keep is m.Keep.IN else RED for area in mission.bounds]
        fence = rr.LineStrips3D(lines, radii=LINE_M, colors=colours)
        self._transient(FENCE, fence, mission.sent_us, keys.MISSION.fresh_s)
        self._transient(RALLY, _places(mission.rally, "rally"), mission.sent_us, keys.MISSION.fresh_s)

    def _plot(self, path: str, value: float) -> None:
        self._stream.log(path, rr.Scalars(value))

    def _line(self, name: str, text: str, key: str, *, warn: bool) -> None:
        """A line of the log where what it says (its key) has changed."""
        if self._lines.get(name) != key:
            self._lines[name] = key
            level = rr.TextLogLevel.WARN if warn else rr.TextLogLevel.INFO
            self._stream.log(f"log/{name}", rr.TextLog(text, level=level))


def _places(points: Sequence[m.Waypoint], label: str) -> rr.Points3D:
    """Places that RETURN may lead to."""
    count = len(points)
    return rr.Points3D(
        [(p.x_m, p.y_m, 0.0) for p in points], radii=[PLACE_M] * count, colors=[WHITE] * count, labels=[label] * count
    )


def layout() -> rrb.Blueprint:
    """Pictures to the left, map in the middle, plots and log to the right."""
    pictures = rrb.Vertical(
        rrb.Spatial2DView(origin=PICTURE, name="What the boat sees"),
        rrb.Spatial2DView(origin=MASK, name="Water, obstacle, sky"),
    )
    eye = rrb.EyeControls3D(position=EYE_M, look_target=LOOK_AT_M)
    maps = rrb.Vertical(
        rrb.Spatial3DView(origin=BOAT, contents=f"/{MAP}/**", name="Boat, plan, obstacles, fence", eye_controls=eye),
        rrb.MapView(origin="earth", name="Chart", zoom=CHART_ZOOM),
        row_shares=[3, 2],
    )
    plots = rrb.Vertical(
        rrb.TimeSeriesView(origin="plots/speed", name="Speed [m/s]"),
        rrb.TimeSeriesView(origin="plots/risk", name="Risk of the corridors"),
        rrb.TimeSeriesView(origin="plots/thrust", name="Thrust applied [N]"),
        rrb.TextLogView(origin="log", name="Log"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(pictures, maps, plots, column_shares=[3, 4, 3]),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
