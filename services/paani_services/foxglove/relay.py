"""What each message of the bus becomes for viewers. No sockets, no clock: what is sent goes to a function.

Nothing is sent twice, and nothing is made up between messages: what falls silent on the bus falls silent here.
"""

from __future__ import annotations

import collections
from collections.abc import Callable, Mapping
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Picture
from paani.config import Config
from paani.logs import viewer
from paani.map_origin import MapPlace, is_map_moved, map_origin_deg, map_place_of
from paani_services.foxglove import channels, overlay, scene
from paani_services.foxglove.chart import LatLon, chart
from paani_services.foxglove.mask_colours import tint_mask
from paani_services.foxglove.transforms import camera_calibration, transforms

Send = Callable[[str, bytes], None]
Watched = Callable[[str], bool]
MAX_HALVES = 8  # estimates in one frame that wait for the one in the other frame of the same instant


class Relay:
    """Turns messages into channels. send: (channel, message); watched: whether anybody wants a channel."""

    def __init__(self, config: Config, send: Send, watched: Watched, refuse: Callable[[str], None]) -> None:
        """refuse: counts, by cause, what is not shown."""
        self._calibration, self._corridors = config.calibration, config.perception.corridors
        self._send, self._watched, self._refuse = send, watched, refuse
        self._frames = overlay.Frames()
        self._lines = viewer.Viewer()
        self._halves: collections.OrderedDict[tuple[str, int], m.Odometry] = collections.OrderedDict()
        self._origin: LatLon | None = config.localization.origin_lat_lon_deg
        self._place: MapPlace | None = None
        self._route: m.Route | None = None
        self._mission: m.Mission | None = None
        self._draw: Mapping[str, Callable[[Any], None]] = {
            keys.LOCAL_ODOMETRY.name: lambda each: self._pair(keys.LOCAL_ODOMETRY.name, keys.ODOMETRY.name, each),
            keys.ODOMETRY.name: self._odometry,
            keys.TRACKS.name: self._tracks,
            keys.ADVISORY.name: self._advisory,
            keys.PREDICTION.name: lambda each: self._scene(*scene.prediction(each)),
            keys.ROUTE.name: self._follow,
            keys.MISSION.name: self._missioned,
        }

    def take(self, topic: keys.Topic[Any], message: m.Message) -> None:
        """A JSON message: as it is, and as what is drawn of it."""
        if self._watched(topic.name):
            self._send(topic.name, msgspec.json.encode(message))
        if (draw := self._draw.get(topic.name)) is not None:
            draw(message)
        if topic.name != keys.TRACKS.name:  # its boxes are drawn here, over the picture that they belong to
            for channel, _, data in self._lines.derive_from(topic.name, message):
                self._send(channel, data)

    def take_picture(self, picture: Picture) -> None:
        """A picture of the camera, with the lens it was taken through; a frame that was sent is not sent again."""
        if not self._frames.note(picture.header):
            self._refuse("picture_repeated")
            return
        if self._watched(keys.PICTURE.name):
            self._send(keys.PICTURE.name, viewer.picture(picture.header, picture.data))
        if (lens := camera_calibration(picture.header, self._calibration)) is not None:
            self._send(channels.CALIBRATION, lens)

    def take_mask(self, mask: Picture) -> None:
        """The class mask in colours, of a picture that was sent."""
        header = self._frames.claim(channels.MASK, mask.header.frame_epoch, mask.header.frame_seq)
        tinted = tint_mask(mask.data)
        if header is None or tinted is None:
            self._refuse("mask_without_picture" if header is None else "mask_unreadable")
            return
        dated = msgspec.structs.replace(mask.header, source_us=header.source_us)
        self._send(channels.MASK, viewer.picture(dated, tinted))

    def _pair(self, own: str, other: str, half: m.Odometry) -> None:
        """The two estimates of one instant, whichever comes first, are one chain of transforms."""
        found = self._halves.pop((other, half.source_us), None)
        if found is None:
            self._halves[own, half.source_us] = half
            while len(self._halves) > MAX_HALVES:
                self._halves.popitem(last=False)
            return
        odometry, local = (found, half) if other == keys.ODOMETRY.name else (half, found)
        self._send(channels.TRANSFORMS, transforms(odometry, local, self._calibration))

    def _odometry(self, odometry: m.Odometry) -> None:
        self._pair(keys.ODOMETRY.name, keys.LOCAL_ODOMETRY.name, odometry)
        self._scene(scene.boat(odometry))
        place = map_place_of(odometry)
        if place is not None and (self._place is None or is_map_moved(self._place, place)):
            self._place, self._origin = place, map_origin_deg(place)
            self._chart()

    def _tracks(self, tracks: m.Tracks) -> None:
        if (header := self._frames.claim(viewer.ANNOTATIONS, tracks.frame_epoch, tracks.frame_seq)) is not None:
            self._send(viewer.ANNOTATIONS, overlay.draw_tracks(tracks, header))

    def _advisory(self, advisory: m.Advisory) -> None:
        if (header := self._frames.claim(channels.CORRIDORS, advisory.frame_epoch, advisory.frame_seq)) is not None:
            self._send(channels.CORRIDORS, overlay.draw_corridors(advisory, header, self._corridors))
        self._scene(scene.advice(advisory, self._corridors, self._calibration))

    def _follow(self, route: m.Route) -> None:
        self._route = route
        self._scene(scene.route(route))
        self._chart()

    def _missioned(self, mission: m.Mission) -> None:
        self._mission = mission
        self._scene(*scene.mission(mission))
        self._chart()

    def _scene(self, *entities: scene.Entity) -> None:
        if self._watched(channels.SCENE):
            self._send(channels.SCENE, scene.scene_update(entities))

    def _chart(self) -> None:
        if self._origin is not None and self._watched(channels.CHART):
            self._send(channels.CHART, chart(self._route, self._mission, self._origin))
