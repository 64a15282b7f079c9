"""Where each limit of the policy lies, from both sides: by hand."""

from __future__ import annotations

import math

import msgspec
import pytest

from paani import messages as m
from paani.config import Config
from paani.messages import Direction, Reason
from paani_services.advisor.advise import advise
from paani_services.advisor.risk import severity
from tests.unit.paani_services.advisor.advisor_evidence import (
    CLEAR,
    PAANI,
    PAPER,
    T0_US,
    box,
    lane,
    play,
    seeing,
    water,
)

Box = tuple[float, float, float, float]
BUOY = m.Label.BUOY
BOTH = pytest.mark.parametrize("config", [PAANI, PAPER], ids=["paani", "paper"])


@pytest.mark.parametrize(
    ("confidence", "xyxy", "expected"),
    [(1.0, (0.4, 0.05, 0.6, 0.15), 0.08), (0.5, (0.4, 0.0, 0.6, 0.65), 0.35)],
    ids=["far above", "tall"],
)
def test_j1_nearness_and_height_count_from_zero_to_one(confidence: float, xyxy: Box, expected: float) -> None:
    assert severity(confidence, xyxy) == pytest.approx(expected)


@BOTH
@pytest.mark.parametrize(("bottom", "is_low"), [(0.65, True), (0.649, False)])
@pytest.mark.parametrize(("width", "is_wide"), [(0.096, True), (0.094, False)])
def test_j6_the_centre_is_filled_by_a_quarter_of_its_width_in_the_third_frame(
    config: Config, bottom: float, is_low: bool, width: float, is_wide: bool
) -> None:
    """Its width is 0.38, a quarter of which is 0.095."""
    filling = seeing(box(BUOY, (0.45, bottom - 0.05, 0.45 + width, bottom), 0.42))
    _, advice, _ = play([filling] * 3, config)
    assert [each.center.occupied for each in advice] == [False, False, is_low and is_wide]


@pytest.mark.parametrize(("name", "x1"), [("left", 0.10), ("right", 0.77)])
def test_j6_a_filled_side_is_blocked_whatever_its_risk(name: str, x1: float) -> None:
    _, advice, _ = play([seeing(box(BUOY, (x1, 0.60, x1 + 0.13, 0.66), 0.42))] * 3, PAPER)
    side = {"left": advice[2].left, "right": advice[2].right}[name]
    assert side.risk < 0.58
    assert (side.occupied, side.blocked) == (True, True)


@pytest.mark.parametrize(
    ("xyxy", "is_ahead"),
    [((0.40, 0.22, 0.60, 0.421), True), ((0.40, 0.22, 0.60, 0.419), False), ((0.21, 0.22, 0.41, 0.53), False)],
    ids=["0.0402", "0.0398", "0.062, half of it in the centre"],
)
def test_j7_a_vessel_blocks_by_its_area_in_the_centre(xyxy: Box, is_ahead: bool) -> None:
    vessel = msgspec.structs.replace(seeing(box(m.Label.VESSEL, xyxy, 0.5)), left=lane(0.2))
    _, advice, _ = play([vessel] * 2, PAPER)
    assert advice[1].center.risk < 0.48
    assert (advice[1].center.blocked, advice[1].reason is Reason.CENTER_VESSEL) == (is_ahead, is_ahead)


@BOTH
@pytest.mark.parametrize(("gain", "side"), [(0.019, Direction.RIGHT), (0.021, Direction.LEFT)])
def test_j8_less_than_two_hundredths_is_a_tie(config: Config, gain: float, side: Direction) -> None:
    assert play([water(0.30, 0.50, 0.30 + gain)], config)[1][0].direction is side


@BOTH
def test_j8_a_tie_keeps_the_side_and_a_turn_never_leads_into_a_blocked_one(config: Config) -> None:
    _, advice, _ = play([water(0.30, 0.50, 0.40), water(0.319, 0.50, 0.30)], config)
    assert [each.direction for each in advice] == [Direction.LEFT] * 2
    _, advice, _ = play([water(0.05, 0.50, 0.30), water(0.65, 0.05, 0.05)], config)
    assert [each.direction for each in advice] == [Direction.LEFT, Direction.STRAIGHT]


@BOTH
def test_j10_clear_frames_count_from_the_turn_on(config: Config) -> None:
    _, advice, _ = play([CLEAR, CLEAR, water(0.05, 0.50, 0.30), CLEAR, CLEAR], config)
    ahead, left = Direction.STRAIGHT, Direction.LEFT
    assert [each.direction for each in advice] == [ahead, ahead, left, left, ahead]


def test_j10_a_slight_turn_is_kept_as_well() -> None:
    edge = box(m.Label.PIER, (0.30, 0.30, 0.40, 0.62), 0.9)
    beside = msgspec.structs.replace(CLEAR, center=lane(0.30), detections=(edge,))
    _, advice, _ = play([beside] * 2 + [CLEAR] * 12, PAANI)
    assert advice[1].direction is Direction.SLIGHT_RIGHT
    first = next(each for each in advice[2:] if not each.center.blocked)
    assert (first.direction, first.reason) == (Direction.SLIGHT_RIGHT, Reason.TURN_RETAINED)


def test_j12_the_explanation_is_of_what_overrides_the_decision() -> None:
    state, _, _ = play([water(0.10, 0.50, 0.40)])
    ahead = msgspec.structs.replace(CLEAR, frame_seq=1, source_us=T0_US + 60_000_000)
    _, of_new, _ = advise(state, ahead, T0_US + 200_000, PAANI)
    _, of_old, _ = advise(state, state.evidence, T0_US - 200_000, PAANI)
    for advice, future_s in ((of_new, "59.8"), (of_old, "0.2")):
        assert advice.explanation == (
            f"Stop: the picture is dated {future_s} s in the future. Only new evidence can change that."
        )


def test_j13_a_track_contributes_in_every_lane_that_it_overlaps() -> None:
    """One reaches with 0.08 of its width into the left lane; the other lies on the right alone."""
    boxes = [box(BUOY, (0.382, 0.40, 0.482, 0.60)), box(BUOY, (0.75, 0.40, 0.85, 0.60))]
    _, advice, tracks = play([seeing(*boxes)] * 2)
    first, second = (each.id for each in tracks[1].tracks)
    lanes = (advice[1].left, advice[1].center, advice[1].right)
    assert [each.track_ids for each in lanes] == [(first,), (first,), (second,)]
    assert advice[1].contributing_track_ids == (first, second)


def test_j13_a_track_in_danger_contributes_at_first_sight() -> None:
    _, advice, tracks = play([seeing(box(BUOY, (0.42, 0.56, 0.58, 0.70), 0.41))])
    assert advice[0].contributing_track_ids == (tracks[0].tracks[0].id,)


def test_j16_advice_lives_for_three_and_a_half_seconds() -> None:
    assert play([CLEAR])[1][0].lifetime_s == 3.5


@BOTH
def test_j2_both_corridors_count_a_box_by_its_share_in_each(config: Config) -> None:
    """Of a width of 0.2, 0.09 lie in the left corridor and 0.19 in the centre."""
    frames = [seeing(box(BUOY, (0.30, 0.2, 0.50, bottom))) for bottom in (0.40, 0.45)]
    _, advice, tracks = play(frames, config)
    weight, urgency = severity(0.8, (0.30, 0.2, 0.50, 0.45)), tracks[1].tracks[0].urgency
    assert urgency > 0.5
    for found, share in ((advice[1].left, 0.45), (advice[1].center, 0.95), (advice[1].right, 0.0)):
        assert (found.obstacle, found.urgency) == pytest.approx((share * weight, share * urgency))


@BOTH
def test_j3_j4_a_risk_is_of_every_accepted_track_and_of_the_water(config: Config) -> None:
    """Three that grow count, a fourth does not at first sight; non-water is 0.2, uncertainty 0.3."""
    grown = [[(x, 0.35 - d, x + 0.1, 0.5) for x, d in ((0.32, k), (0.45, 2 * k), (0.58, 3 * k))] for k in (0.0, 0.01)]
    first, second = (seeing(*(box(BUOY, xyxy) for xyxy in boxes)) for boxes in grown)
    fourth = box(BUOY, (0.45, 0.60, 0.55, 0.64))
    second = msgspec.structs.replace(
        second, detections=(*second.detections, fourth), center=m.LaneEvidence(non_water=0.2, uncertainty=0.3)
    )
    _, advice, tracks = play([first, second], config)
    urgencies = [track.urgency for track in tracks[1].tracks]
    assert all(urgency > 0.05 for urgency in urgencies[:3])
    assert [track.accepted for track in tracks[1].tracks] == [True, True, True, False]
    obstacle = 1.0 - math.prod(1.0 - severity(0.8, xyxy) for xyxy in grown[1])
    urgency = 1.0 - math.prod(1.0 - each for each in urgencies)
    center = advice[1].center
    assert (center.obstacle, center.urgency) == pytest.approx((obstacle, urgency))
    assert center.risk == pytest.approx(0.55 * 0.2 + 0.65 * obstacle + 0.20 * urgency + 0.15 * 0.3)
