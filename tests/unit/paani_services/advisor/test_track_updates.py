"""What each sighting, and each frame without one, does to a track: by hand, with both profiles' constants."""

from __future__ import annotations

import math

import pytest

from paani import messages as m
from paani.config import Config
from paani_services.advisor.association import assign_boxes
from paani_services.advisor.tracker import HAZARDS
from tests.unit.paani_services.advisor.advisor_evidence import BUOY_AHEAD, CLEAR, PAANI, PAPER, box, play, seeing

BOTH = pytest.mark.parametrize("config", [PAANI, PAPER], ids=["paani", "paper"])
MIDDLE = (0.4, 0.4, 0.6, 0.6)


@BOTH
@pytest.mark.parametrize("hits", [1, 2])
def test_g3_a_track_is_held_for_three_seconds_however_often_it_was_seen(config: Config, hits: int) -> None:
    """Frames are 0.2 s apart."""
    _, _, tracks = play([seeing(BUOY_AHEAD)] * hits + [CLEAR] * 15, config)
    assert [[each.held for each in frame.tracks] for frame in tracks[hits:]] == [*[[True]] * 14, []]


@BOTH
def test_g6_g7_what_is_displayed_keeps_a_share_of_what_was_displayed(config: Config) -> None:
    """0.35 of every side of the box and 0.65 of the confidence, risen or fallen."""
    frames = [(MIDDLE, 0.6), ((0.42, 0.44, 0.66, 0.68), 0.9), (MIDDLE, 0.5)]
    _, _, tracks = play([seeing(box(m.Label.BUOY, xyxy, confidence)) for xyxy, confidence in frames], config)
    displayed, displayed_confidence = frames[0]
    for (xyxy, confidence), frame in zip(frames[1:], tracks[1:], strict=True):
        x1, y1, x2, y2 = (0.35 * before + 0.65 * now for before, now in zip(displayed, xyxy, strict=True))
        displayed = (x1, y1, x2, y2)
        displayed_confidence = 0.65 * displayed_confidence + 0.35 * confidence
        assert frame.tracks[0].box_xyxy == pytest.approx(displayed)
        assert frame.tracks[0].confidence == pytest.approx(displayed_confidence)


def test_g8_a_hazard_is_known_at_first_sight() -> None:
    boxes = [box(label, (0.05 + 0.24 * k, 0.4, 0.20 + 0.24 * k, 0.6)) for k, label in enumerate(m.Label)]
    for frame in play([seeing(*boxes)] * 2)[2]:
        assert {each.label: each.hazard for each in frame.tracks} == HAZARDS


@BOTH
@pytest.mark.parametrize(
    ("after", "period_s", "urgency"),
    [
        ((0.392, 0.392, 0.608, 0.608), 0.2, 0.5),
        ((0.392, 0.392, 0.608, 0.608), 0.1, 1.0),
        ((0.38, 0.38, 0.62, 0.62), 0.2, 1.0),
        ((0.408, 0.408, 0.592, 0.592), 0.2, 0.0),
        # As large as the first, and not square.
        ((0.4, 0.38336, 0.6, 0.61664), 0.2, 0.5),
        ((0.38336, 0.4, 0.61664, 0.6), 0.2, 0.5),
    ],
    ids=["0.08/s", "0.16/s", "0.20/s", "shrinks", "higher", "wider"],
)
def test_h1_urgency_is_the_growth_of_the_areas_root(
    config: Config, after: tuple[float, float, float, float], period_s: float, urgency: float
) -> None:
    """A full 1 from 0.16 a second on, and nothing of what shrinks."""
    _, _, tracks = play([seeing(box(m.Label.BUOY, xyxy)) for xyxy in (MIDDLE, after)], config, period_s)
    assert tracks[1].tracks[0].urgency == pytest.approx(urgency, abs=1e-9)


@pytest.mark.parametrize("hits", [2, 12])
def test_h5_frames_without_a_track_leave_its_motion_as_it_was(hits: int) -> None:
    frames = [seeing(box(m.Label.BUOY, MIDDLE))] * hits
    seen, held = play(frames)[0], play([*frames, *[CLEAR] * 3])[0]
    assert held.tracker.tracks[0].identity == seen.tracker.tracks[0].identity


@BOTH
def test_g1_no_more_boxes_of_a_frame_are_compared_than_tracks_are_kept(config: Config) -> None:
    """Each box that is left makes a track, and each track takes the next number, whether or not it is kept."""
    many = [box(m.Label.BUOY, (x, y, x + 0.05, y + 0.05)) for i in range(100) for x, y in [(i % 10 / 10, i // 10 / 10)]]
    state, _, tracks = play([seeing(*many)], config)
    assert [each.id for each in tracks[0].tracks] == list(range(1, 65))
    assert state.tracker.next_id == 65


@BOTH
@pytest.mark.parametrize(
    "xyxy", [(-0.1, 0.4, 0.2, 0.6), (0.4, -0.1, 0.6, 0.2), (0.8, 0.4, 1.1, 0.6), (80, 60, 120, 90)]
)
def test_g1_a_box_that_is_not_in_the_normalised_picture_is_no_track(config: Config, xyxy: m.BoxXyxy) -> None:
    state, advice, tracks = play([seeing(box(m.Label.BUOY, xyxy))], config)
    assert tracks[0].tracks == ()
    assert (state.tracker.malformed, advice[0].reason) == (1, m.Reason.MALFORMED_EVIDENCE)


def test_g2_a_box_that_overlaps_two_tracks_goes_to_the_one_it_overlaps_more() -> None:
    """By 0.905 the second, and by 0.74 the first."""
    first, second = (0.0, 0.0, 0.2, 0.2), (0.04, 0.0, 0.24, 0.2)
    assert assign_boxes([first, second], [(0.03, 0.0, 0.23, 0.2)], 0.25).track_of == {0: 1}
    assert assign_boxes([second, first], [(0.03, 0.0, 0.23, 0.2)], 0.25).track_of == {0: 0}


@BOTH
def test_g4_the_second_hit_confirms_also_after_a_miss(config: Config) -> None:
    _, _, tracks = play([seeing(BUOY_AHEAD), CLEAR, seeing(BUOY_AHEAD)], config)
    assert [(each.hits, each.confirmed, each.held) for frame in tracks for each in frame.tracks] == [
        (1, False, False), (1, False, True), (2, True, False),
    ]  # fmt: skip


@BOTH
@pytest.mark.parametrize(("bottom", "area", "danger"), [(0.6501, 0.0201, True), (0.6501, 0.0199, False),
                                                        (0.6499, 0.0201, False), (0.9, 0.0199, False)])  # fmt: skip
def test_g5_what_is_low_and_large_is_accepted_at_first_sight(
    config: Config, bottom: float, area: float, danger: bool
) -> None:
    _, _, tracks = play([seeing(box(m.Label.BUOY, (0.4, bottom - area / 0.2, 0.6, bottom)))], config)
    track = tracks[0].tracks[0]
    assert (track.immediate_danger, track.accepted, track.confirmed) == (danger, danger, False)


@BOTH
def test_g10_a_box_that_moves_down_is_matched_with_the_last_one_seen(config: Config) -> None:
    """An IoU of 0.29 with the last box, and of less than 0.25 with any mean of the last two."""
    steps = [seeing(box(m.Label.BUOY, (0.4, y, 0.6, y + 0.2))) for y in (0.10, 0.21, 0.32, 0.43)]
    assert [[each.id for each in frame.tracks] for frame in play(steps, config)[2]] == [[1]] * 4


@BOTH
def test_g10_what_returns_after_its_hold_is_another_track(config: Config) -> None:
    _, _, tracks = play([*[seeing(BUOY_AHEAD)] * 2, *[CLEAR] * 15, seeing(BUOY_AHEAD)], config)
    assert [[each.id for each in frame.tracks] for frame in tracks[15:]] == [[1], [], [2]]


@BOTH
@pytest.mark.parametrize(
    ("before", "after", "urgency"),
    [
        ((0.4, 0.2, 0.6, 0.4), (0.4, 0.22, 0.6, 0.42), 0.5),
        ((0.4, 0.6, 0.6, 0.8), (0.4, 0.58, 0.6, 0.78), 0.5),
        ((0.6, 0.4, 0.8, 0.6), (0.58, 0.4, 0.78, 0.6), 0.5),
        ((0.4, 0.2, 0.6, 0.4), (0.4, 0.25, 0.6, 0.45), 1.0),
        ((0.4, 0.22, 0.6, 0.42), (0.4, 0.2, 0.6, 0.4), 0.0),
    ],
    ids=["from-above", "from-below", "from-the-right", "faster", "away"],
)
def test_h2_urgency_is_the_rate_towards_the_middle_from_wherever(
    config: Config, before: m.BoxXyxy, after: m.BoxXyxy, urgency: float
) -> None:
    """0.10 a second is half of full scale; above 0.20 there is no more."""
    _, _, tracks = play([seeing(box(m.Label.BUOY, xyxy)) for xyxy in (before, after)], config)
    assert tracks[1].tracks[0].urgency == pytest.approx(urgency, abs=1e-9)


@BOTH
@pytest.mark.parametrize(("x", "half", "urgency"), [(0.32, 0.098, 0.5), (0.28, 0.104, 0.25)])
def test_h3_one_of_both_is_enough_while_the_other_falls(config: Config, x: float, half: float, urgency: float) -> None:
    """What shrinks on its way to the middle, and what grows on its way out."""
    after = box(m.Label.BUOY, (x - half, 0.5 - half, x + half, 0.5 + half))
    _, _, tracks = play([seeing(box(m.Label.BUOY, (0.2, 0.4, 0.4, 0.6))), seeing(after)], config)
    assert tracks[1].tracks[0].urgency == pytest.approx(urgency)


@BOTH
def test_h4_the_decayed_urgency_is_what_the_risk_takes(config: Config) -> None:
    """Until the track is gone, 3 s after it was seen."""
    seen = [seeing(box(m.Label.BUOY, (0.4, y, 0.6, y + 0.2))) for y in (0.20, 0.22)]
    _, advice, tracks = play([*seen, *[CLEAR] * 15], config)
    expected = [0.5 * math.exp(-0.2 * frame) for frame in range(15)]
    assert [frame.tracks[0].urgency for frame in tracks[1:16]] == pytest.approx(expected)
    assert [advised.center.urgency for advised in advice[1:]] == pytest.approx([*expected, 0.0])


@BOTH
def test_h6_the_risk_takes_the_urgency_of_what_approaches_and_no_more(config: Config) -> None:
    """The last frame's growth of the box's side over 0.2 s and 0.16 a second, whatever the motion state is."""
    halves = [0.05 * math.exp(0.02 * i) for i in range(10)]
    _, advice, tracks = play([seeing(box(m.Label.BUOY, (0.5 - h, 0.5 - h, 0.5 + h, 0.5 + h))) for h in halves], config)
    assert tracks[-1].tracks[0].motion is m.MotionState.APPROACHING
    urgency = 2.0 * (halves[-1] - halves[-2]) / 0.2 / 0.16
    assert (tracks[-1].tracks[0].urgency, advice[-1].center.urgency) == pytest.approx((urgency, urgency))
    quiet = 0.05 + 0.65 * advice[-1].center.obstacle
    assert advice[-1].center.risk == pytest.approx(quiet + 0.20 * urgency)
