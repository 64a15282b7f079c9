"""What each sighting, and each frame without one, does to a track: by hand, with both profiles' constants."""

from __future__ import annotations

import pytest

from paani import messages as m
from paani.config import Config
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
