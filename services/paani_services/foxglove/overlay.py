"""What is drawn over a picture: boxes of tracks, and corridors; never over another frame than their own. Pure."""

from __future__ import annotations

import collections

from paani import messages as m
from paani.config import CorridorConfig
from paani.logs import protobuf as pb

MAX_FRAMES = 32  # pictures whose evidence may still come: six seconds at 5 Hz
ACCEPTED, DANGER, TENTATIVE = (
    pb.colour(1.0, 0.71, 0.33, 1.0),
    pb.colour(1.0, 0.30, 0.32, 1.0),
    pb.colour(0.79, 0.83, 0.85, 1.0),
)
BLOCKED, CLEAR = (1.0, 0.35, 0.37), (0.34, 0.84, 0.61)
BACKGROUND = pb.colour(0.03, 0.04, 0.05, 0.8)
LINE_PX, THICK_PX, FONT_PX = 1.5, 3.0, 11.0
FILL_ALPHA, LINE_ALPHA = 0.10, 0.9
CORRIDOR_INSET_PX = {"left": 6.0, "center": 2.0, "right": 6.0}  # they overlap, so their lower edges lie apart
FrameId = tuple[int, int]


class Frames:
    """Pictures that were sent, by the frame that they show; and what was drawn over each, so that it is drawn once."""

    def __init__(self) -> None:
        self._headers: collections.OrderedDict[FrameId, m.PictureHeader] = collections.OrderedDict()
        self._drawn: collections.deque[tuple[str, FrameId]] = collections.deque(maxlen=2 * MAX_FRAMES)

    def note(self, header: m.PictureHeader) -> bool:
        """A picture has come. False where one of that frame was there before, so that it is not sent again."""
        frame = (header.frame_epoch, header.frame_seq)
        if frame in self._headers:
            return False
        self._headers[frame] = header
        while len(self._headers) > MAX_FRAMES:
            self._headers.popitem(last=False)
        return True

    def claim(self, layer: str, frame_epoch: int, frame_seq: int) -> m.PictureHeader | None:
        """The picture that a layer may be drawn over: None where it was never sent, or has this layer already."""
        frame = (frame_epoch, frame_seq)
        header = self._headers.get(frame)
        if header is None or not header.width_px or not header.height_px or (layer, frame) in self._drawn:
            return None
        self._drawn.append((layer, frame))
        return header


def draw_tracks(tracks: m.Tracks, header: m.PictureHeader) -> bytes:
    """A foxglove.ImageAnnotations with a box, identity and label for each track; dated as its picture is.

    As on the page, what was neither seen in this picture nor counts is left out, and what is only held has no label.
    """
    time = pb.timestamp(header.source_us)
    boxes, texts = [], []
    for track in tracks.tracks:
        if track.held and not track.accepted:
            continue
        x1, y1, x2, y2 = track.box_xyxy
        colour = DANGER if track.immediate_danger else ACCEPTED if track.accepted and not track.held else TENTATIVE
        corners = _rectangle(x1 * header.width_px, y1 * header.height_px, x2 * header.width_px, y2 * header.height_px)
        thickness = THICK_PX if track.immediate_danger else LINE_PX
        boxes.append(
            {
                "timestamp": time, "type": pb.LINE_LOOP, "points": corners, "outline_color": colour,
                "thickness": thickness,
            }
        )  # fmt: skip
        if not track.held:
            text = f"#{track.id} {track.label} {track.confidence:.2f}"
            texts.append(
                {
                    "timestamp": time, "position": corners[0], "text": text, "font_size": FONT_PX,
                    "text_color": colour, "background_color": BACKGROUND,
                }
            )  # fmt: skip
    return pb.encode(pb.IMAGE_ANNOTATIONS, {"points": boxes, "texts": texts})


def draw_corridors(advisory: m.Advisory, header: m.PictureHeader, corridors: CorridorConfig) -> bytes:
    """A foxglove.ImageAnnotations with the three corridors: red where blocked, green where clear, and their risk."""
    time = pb.timestamp(header.source_us)
    areas, texts = [], []
    lanes = (
        ("left", corridors.left, advisory.left),
        ("center", corridors.center, advisory.center),
        ("right", corridors.right, advisory.right),
    )
    for name, (start, end), lane in lanes:
        rgb = BLOCKED if lane.blocked else CLEAR
        x1_px, x2_px, bottom_px = (
            start * header.width_px,
            end * header.width_px,
            header.height_px - CORRIDOR_INSET_PX[name],
        )
        areas.append(
            {
                "timestamp": time, "type": pb.LINE_LOOP, "thickness": LINE_PX,
                "points": _rectangle(x1_px, corridors.top * header.height_px, x2_px, bottom_px),
                "outline_color": pb.colour(*rgb, LINE_ALPHA), "fill_color": pb.colour(*rgb, FILL_ALPHA),
            }
        )  # fmt: skip
        texts.append(
            {
                "timestamp": time, "position": pb.point(x1_px + LINE_PX, bottom_px), "font_size": FONT_PX,
                "text": f"{lane.risk:.2f} {'blocked' if lane.blocked else 'clear'}",
                "text_color": pb.colour(*rgb, 1.0), "background_color": BACKGROUND,
            }
        )  # fmt: skip
    return pb.encode(pb.IMAGE_ANNOTATIONS, {"points": areas, "texts": texts})


def _rectangle(x1_px: float, y1_px: float, x2_px: float, y2_px: float) -> list[bytes]:
    """Its corners, clockwise from the top left."""
    return [pb.point(x, y) for x, y in ((x1_px, y1_px), (x2_px, y1_px), (x2_px, y2_px), (x1_px, y2_px))]
