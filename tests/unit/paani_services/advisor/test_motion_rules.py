"""When the growth of a box is a motion, how sure that is, and what ends it: by hand."""

from __future__ import annotations

import math

import msgspec
import pytest

from paani import messages as m
from paani.config import Config, load_config
from paani.messages import MotionCause, MotionState
from paani_services.advisor.advise import AdvisorState, advise
from paani_services.advisor.motion import MotionHistory, SizeMeasurement, Window, add_measurement, estimate_motion
from tests.unit.paani_services.advisor.advisor_evidence import (
    BUOY_AHEAD,
    CLEAR,
    PAANI,
    PAPER,
    T0_US,
    box,
    lane,
    play,
    seeing,
)

Box = tuple[float, float, float, float]
BUOY = m.Label.BUOY
WINDOW = Window(1.5, 0.75)
MIDDLE = (0.44, 0.44, 0.56, 0.56)
BOTH = pytest.mark.parametrize("config", [PAANI, PAPER], ids=["paani", "paper"])


def measured(sizes: list[float], confidences: list[float], step_us: int) -> tuple[MotionHistory, int]:
    """The history of one box with these log sizes, and the time of the last."""
    history = MotionHistory()
    for number, (size, confidence) in enumerate(zip(sizes, confidences, strict=True)):
        measurement = SizeMeasurement(number * step_us, (0.4, 0.4, 0.6, 0.6), size, confidence, False)
        history = add_measurement(history, measurement, WINDOW, PAPER.advisor.motion)
    return history, (len(sizes) - 1) * step_us


def about(x: float, y: float, half: float) -> Box:
    return (x - half, y - half, x + half, y + half)


@pytest.mark.parametrize(("noise", "margin_per_s"), [(0.1, 0.3), (0.001, 0.01)])
def test_i2_the_margin_is_of_the_residuals_about_the_slope(noise: float, margin_per_s: float) -> None:
    """0.3 a second with every other size a little larger; no margin is below 0.01."""
    history, at_us = measured([0.06 * i + noise * (i % 2) for i in range(5)], [0.8] * 5, 200_000)
    estimate = estimate_motion(history, at_us, WINDOW, PAPER.advisor.motion)
    assert (estimate.rate_per_s, estimate.margin_per_s) == pytest.approx((0.3, margin_per_s))


@pytest.mark.parametrize(("period_s", "kept"), [(0.2, 8), (0.5, 4), (0.52, 3), (0.7, 3), (0.751, 1), (2.0, 1)])
def test_i5_i22_samples_of_one_and_a_half_seconds_are_kept(period_s: float, kept: int) -> None:
    state, _, _ = play([seeing(box(BUOY, (0.4, 0.4, 0.6, 0.6)))] * 12, PAPER, period_s)
    assert len(state.tracker.tracks[0].identity.motion.samples) == kept


@pytest.mark.parametrize(
    ("count", "step_us", "confidences", "quality"),
    [
        (5, 200_000, [0.48, 0.9, 0.9, 0.9, 0.9], 0.8 * 0.625 * 0.8),
        (5, 300_000, [0.9] * 5, 0.625),  # 1.2 s are as good as 1 s
        (10, 50_000, [0.9] * 10, 0.45),  # ten samples are as good as eight
    ],
)
def test_i7_no_factor_of_the_quality_is_above_one(
    count: int, step_us: int, confidences: list[float], quality: float
) -> None:
    """Of an exact slope, by its duration, its samples and the lowest confidence among them."""
    history, at_us = measured([0.3e-6 * step_us * i for i in range(count)], confidences, step_us)
    estimate = estimate_motion(history, at_us, WINDOW, PAPER.advisor.motion)
    assert estimate.state is MotionState.APPROACHING
    assert estimate.confidence == pytest.approx(quality)


@pytest.mark.parametrize("config", [PAANI, PAPER], ids=["paani", "paper"])
@pytest.mark.parametrize("rate_per_s", [0.3, -0.3, 0.0])
def test_i9_no_state_is_surer_than_nine_tenths(config: Config, rate_per_s: float) -> None:
    sizes = [0.08 * math.exp(rate_per_s * 0.1 * i) for i in range(16)]
    _, _, tracks = play([seeing(box(BUOY, about(0.5, 0.5, half))) for half in sizes], config, 0.1)
    assert tracks[-1].tracks[0].motion_confidence == 0.9


@pytest.mark.parametrize(
    ("last", "cause", "left"),
    [
        ([box(BUOY, MIDDLE, 0.39)], MotionCause.WEAK_DETECTION, 0),
        ([box(BUOY, MIDDLE), box(BUOY, (0.47, 0.44, 0.59, 0.56), 0.7)], MotionCause.AMBIGUOUS_ASSOCIATION, 0),
        ([box(BUOY, (0.40, 0.46, 0.60, 0.54))], MotionCause.SHAPE_CHANGE, 1),
        ([box(BUOY, (0.46, 0.40, 0.54, 0.60))], MotionCause.SHAPE_CHANGE, 1),
    ],
    ids=["weak", "two boxes", "wider", "narrower"],
)
def test_i11_i12_i13_nothing_of_before_is_left(last: list[m.Detection], cause: MotionCause, left: int) -> None:
    state, _, tracks = play([*[seeing(box(BUOY, MIDDLE))] * 6, seeing(*last)], PAPER)
    assert [frame.tracks[0].motion_cause for frame in tracks[5:]] == [MotionCause.NONE, cause]
    assert len(state.tracker.tracks[0].identity.motion.samples) == left


def test_i12_one_box_that_two_tracks_overlap_is_ambiguous() -> None:
    two = seeing(box(BUOY, (0.30, 0.40, 0.50, 0.60)), box(BUOY, (0.44, 0.40, 0.64, 0.60)))
    _, _, tracks = play([*[two] * 6, seeing(box(BUOY, (0.37, 0.40, 0.57, 0.60)))], PAPER)
    assert [each.motion_cause for each in tracks[5].tracks] == [MotionCause.NONE] * 2
    assert [each.motion_cause for each in tracks[6].tracks if not each.held] == [MotionCause.AMBIGUOUS_ASSOCIATION]


@pytest.mark.parametrize(("gap_s", "is_known"), [(0.75, True), (0.76, False)])
def test_i16_a_gap_of_more_than_three_quarters_of_a_second_ends_it(gap_s: float, is_known: bool) -> None:
    """Whether the box is in the next picture or not; five samples are of the last 1.5 s."""
    state, _, _ = play([seeing(BUOY_AHEAD)] * 6, PAPER)
    at_us = T0_US + 1_000_000 + round(gap_s * 1e6)
    without = msgspec.structs.replace(CLEAR, frame_seq=6, source_us=at_us)
    _, _, held = advise(state, without, at_us, PAPER)
    again, _, seen = advise(state, msgspec.structs.replace(without, detections=(BUOY_AHEAD,)), at_us, PAPER)
    cause = MotionCause.NONE if is_known else MotionCause.GAP
    assert [found.tracks[0].motion_cause for found in (held, seen)] == [cause] * 2
    assert len(again.tracker.tracks[0].identity.motion.samples) == (5 if is_known else 1)


@pytest.mark.parametrize("time_base", [m.TimeBase.MEDIA, m.TimeBase.FRAME_INDEX])
def test_i17_a_recordings_own_time_says_nothing_of_freshness(time_base: m.TimeBase) -> None:
    frame = msgspec.structs.replace(CLEAR, media_us=7, time_base=time_base)
    _, fresh, _ = advise(AdvisorState(), frame, T0_US + 600_000, PAANI)
    _, late, _ = advise(AdvisorState(), frame, T0_US + 600_001, PAANI)
    assert (fresh.direction, late.reason) == (m.Direction.STRAIGHT, m.Reason.STALE_EVIDENCE)


@pytest.mark.parametrize("label", m.Label)
@pytest.mark.parametrize(
    ("growth", "state"),
    [(0.03, MotionState.APPROACHING), (-0.05, MotionState.RECEDING), (0.0, MotionState.STEADY)],
    ids=["approaching", "receding", "steady"],
)
def test_i20_a_motion_changes_no_advice_whatever_moves(label: m.Label, growth: float, state: MotionState) -> None:
    """With samples too few for any state, everything else alike."""
    without = load_config(sets=["advisor.motion.max_samples=4"])
    seen = [seeing(box(label, about(0.5, 0.45, 0.12 * math.exp(growth * i)), 0.9)) for i in range(12)]
    frames = [msgspec.structs.replace(frame, left=lane(0.0), right=lane(0.0)) for frame in seen]
    (_, advice, tracks), (_, other_advice, other_tracks) = play(frames, PAANI), play(frames, without)
    assert tracks[-1].tracks[0].motion is state
    assert other_tracks[-1].tracks[0].motion is MotionState.UNKNOWN
    assert msgspec.json.encode(advice) == msgspec.json.encode(other_advice)


def test_i1_the_rate_is_the_slope_of_the_least_squares() -> None:
    """Sizes 0, 0.1, 0, 0.1 and 0.2 have a slope of 0.04 a sample, and of 0.05 from the first to the last."""
    history, at_us = measured([0.0, 0.1, 0.0, 0.1, 0.2], [0.8] * 5, 200_000)
    assert estimate_motion(history, at_us, WINDOW, PAPER.advisor.motion).rate_per_s == pytest.approx(0.2)


@pytest.mark.parametrize(("wide", "tall"), [(0.0, 0.3), (0.3, 0.0), (0.1, 0.2)], ids=["taller", "wider", "both"])
def test_i1_the_size_is_half_the_logarithm_of_the_area(wide: float, tall: float) -> None:
    sides = [(0.05 * math.exp(wide * 0.2 * i), 0.05 * math.exp(tall * 0.2 * i)) for i in range(8)]
    _, _, tracks = play([seeing(box(BUOY, (0.5 - w, 0.5 - h, 0.5 + w, 0.5 + h))) for w, h in sides], PAPER)
    assert tracks[-1].tracks[0].motion_rate_per_s == pytest.approx(0.15)


@BOTH
@pytest.mark.parametrize("side", range(4), ids=["left", "top", "right", "bottom"])
def test_i10_nothing_of_before_a_box_is_cut_off_is_left(config: Config, side: int) -> None:
    before, cut = [0.02, 0.02, 0.98, 0.98], [0.02, 0.02, 0.98, 0.98]
    cut[side] = (0.0, 0.0, 1.0, 1.0)[side]
    whole, part = (seeing(box(BUOY, (x1, y1, x2, y2))) for x1, y1, x2, y2 in (before, cut))
    state, _, tracks = play([*[whole] * 6, part], config)
    assert [frame.tracks[0].motion_cause for frame in tracks[5:]] == [MotionCause.NONE, MotionCause.CLIPPED_BY_FRAME]
    assert state.tracker.tracks[0].identity.motion.samples == ()


@BOTH
@pytest.mark.parametrize("back_us", [0, 1, 100_000, 5_000_000])
def test_i14_a_frame_that_is_not_later_than_the_one_before_begins_again(config: Config, back_us: int) -> None:
    state, _, _ = play([seeing(BUOY_AHEAD)] * 6, config)
    at_us = T0_US + 1_000_000 - back_us
    frame = msgspec.structs.replace(seeing(BUOY_AHEAD), frame_seq=6, source_us=at_us)
    state, _, tracks = advise(state, frame, at_us, config)
    assert (tracks.tracks[0].motion, tracks.tracks[0].motion_cause) == (MotionState.UNKNOWN, MotionCause.TIME_REVERSED)
    assert [sample.at_us for sample in state.tracker.tracks[0].identity.motion.samples] == [at_us]


@BOTH
@pytest.mark.parametrize("epoch", [0, 2])
def test_i15_another_epoch_begins_again_whichever_number_it_has(config: Config, epoch: int) -> None:
    state, _, tracks = play([seeing(BUOY_AHEAD)] * 6, config)
    assert tracks[-1].tracks[0].motion_cause is MotionCause.NONE
    frame = msgspec.structs.replace(seeing(BUOY_AHEAD), frame_epoch=epoch, source_us=T0_US + 1_200_000)
    state, _, again = advise(state, frame, T0_US + 1_200_000, config)
    assert (again.tracks[0].motion, again.tracks[0].motion_cause) == (MotionState.UNKNOWN, MotionCause.EPOCH_CHANGE)
    assert len(state.tracker.tracks[0].identity.motion.samples) == 1


@BOTH
@pytest.mark.parametrize(
    ("beta", "margin", "state"),
    [
        (0.11, 0.06, MotionState.APPROACHING),
        (0.09, 0.06, MotionState.UNKNOWN),
        (-0.11, 0.06, MotionState.RECEDING),
        (-0.09, 0.06, MotionState.UNKNOWN),
        (0.0, 0.035, MotionState.STEADY),
        (0.01, 0.035, MotionState.UNKNOWN),
        (-0.01, 0.035, MotionState.UNKNOWN),
    ],
)
def test_i3_i4_a_state_is_of_the_whole_interval(config: Config, beta: float, margin: float, state: MotionState) -> None:
    """Five samples whose residuals give this margin; every interval ends within 0.01 of the dead band's edge."""
    sizes = [0.2 * beta * i + margin / 3.0 * (i % 2) for i in range(5)]
    history, at_us = measured(sizes, [0.8] * 5, 200_000)
    estimate = estimate_motion(history, at_us, WINDOW, config.advisor.motion)
    assert (estimate.rate_per_s, estimate.margin_per_s) == pytest.approx((beta, margin))
    assert estimate.state is state


@BOTH
def test_i6_eight_samples_of_less_than_four_tenths_of_a_second_are_too_short(config: Config) -> None:
    history, at_us = measured([0.3 * 0.05 * i for i in range(8)], [0.9] * 8, 50_000)
    assert estimate_motion(history, at_us, WINDOW, config.advisor.motion).cause is MotionCause.TOO_SHORT


@pytest.mark.parametrize("beta", [0.3, -0.3, 0.0])
@pytest.mark.parametrize(("confidence", "is_known"), [(0.55, False), (0.65, True)])
def test_i8_no_state_is_known_by_a_quality_below_a_quarter(beta: float, confidence: float, is_known: bool) -> None:
    """Five exact samples over 0.41 s: 0.41 * 0.625 * confidence / 0.6, which is 0.235 or 0.256."""
    history, at_us = measured([beta * 0.1025 * i for i in range(5)], [confidence] * 5, 102_500)
    estimate = estimate_motion(history, at_us, WINDOW, PAPER.advisor.motion)
    assert (estimate.state is not MotionState.UNKNOWN) is is_known
    assert estimate.cause is (MotionCause.NONE if is_known else MotionCause.LOW_QUALITY)
