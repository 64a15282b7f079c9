"""What is drawn over a picture lies on its own frame, once."""

from __future__ import annotations

from paani.config import CorridorConfig
from paani.logs import protobuf as pb
from paani_services.foxglove.overlay import MAX_FRAMES, Frames, draw_corridors, draw_tracks
from tests.unit.paani_services.foxglove.seen import advisory, corners_of, decoded, header, track, tracks

CORRIDORS = CorridorConfig()


def test_a_layer_is_drawn_once_over_a_picture_that_was_sent() -> None:
    frames = Frames()
    assert frames.claim("boxes", 1, 3) is None, "no picture of that frame was sent"
    assert frames.note(header(3))
    assert frames.claim("boxes", 1, 4) is None, "another frame"
    assert frames.claim("boxes", 2, 3) is None, "the camera began again: another frame of the same number"
    assert frames.claim("boxes", 1, 3) == header(3)
    assert frames.claim("boxes", 1, 3) is None, "drawn already"
    assert frames.claim("corridors", 1, 3) == header(3)
    assert not frames.note(header(3)), "a frame that was sent"


def test_pictures_are_forgotten_in_the_order_they_came() -> None:
    frames = Frames()
    for number in range(MAX_FRAMES + 1):
        frames.note(header(number))
    assert frames.claim("boxes", 1, 0) is None
    assert frames.claim("boxes", 1, 1) == header(1)


def test_a_picture_without_a_size_has_nothing_drawn_over_it() -> None:
    frames = Frames()
    frames.note(header(3, width_px=0))
    assert frames.claim("boxes", 1, 3) is None


def test_boxes_carry_identity_and_the_pictures_time_and_pixels() -> None:
    found = decoded(pb.IMAGE_ANNOTATIONS, draw_tracks(tracks(3, track()), header(3, width_px=640, height_px=480)))
    [box], [text] = found.points, found.texts
    assert corners_of(box.points) == [(160, 240), (320, 240), (320, 360), (160, 360)]
    assert text.text == "#7 buoy 0.81"
    assert {box.timestamp.ToMicroseconds(), text.timestamp.ToMicroseconds()} == {header(3).source_us}


def test_what_was_not_seen_has_no_label_and_what_does_not_count_is_left_out() -> None:
    drawn = tracks(3, track(held=True), track(id=8, held=True, accepted=False), track(id=9, immediate_danger=True))
    found = decoded(pb.IMAGE_ANNOTATIONS, draw_tracks(drawn, header()))
    assert [text.text for text in found.texts] == ["#9 buoy 0.81"]
    assert len(found.points) == 2
    assert found.points[1].thickness > found.points[0].thickness, "immediate danger is drawn thicker"


def test_no_tracks_take_the_old_boxes_away() -> None:
    found = decoded(pb.IMAGE_ANNOTATIONS, draw_tracks(tracks(3), header()))
    assert (len(found.points), len(found.texts)) == (0, 0)


def test_corridors_lie_where_they_are_judged() -> None:
    found = decoded(pb.IMAGE_ANNOTATIONS, draw_corridors(advisory(), header(), CORRIDORS))
    left, center, right = found.points
    for area, (start, end) in ((left, CORRIDORS.left), (center, CORRIDORS.center), (right, CORRIDORS.right)):
        (x1, y1), (x2, _), *_ = corners_of(area.points)
        assert (x1, x2, y1) == (start * 320, end * 320, CORRIDORS.top * 240)
        assert area.timestamp.ToMicroseconds() == header().source_us
    assert [text.text for text in found.texts] == ["0.20 clear", "0.70 blocked", "1.00 blocked"]
    assert left.outline_color.g > left.outline_color.r
    assert center.outline_color.r > center.outline_color.g
