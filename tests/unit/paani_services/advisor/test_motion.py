"""Motion that follows the rate, says why it is unknown, bounds its work, and never reaches the advice."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import messages as m
from paani.config import Config, MotionConfig, load_config
from paani.errors import UserError
from paani_services.advisor.advise import AdvisorState, advise
from paani_services.advisor.motion import (
    MotionHistory,
    SizeMeasurement,
    Window,
    add_measurement,
    estimate_motion,
    motion_window,
)
from paani_services.advisor.rotation import MAX_ATTITUDES
from paani_services.advisor.tracker import MAX_PERIODS
from tests.unit.paani_services.advisor.advisor_evidence import BUOY_AHEAD, CLEAR, PAANI, PAPER, T0_US, box, play, seeing

pytestmark = pytest.mark.slow

BUOY = m.Label.BUOY
S, C = m.MotionState, m.MotionCause


def square(half: float, aspect: float = 1.0) -> m.BoxXyxy:
    """A centred box; `aspect` is width over height at the same area."""
    wide, tall = half * math.sqrt(aspect), half / math.sqrt(aspect)
    return (0.5 - wide, 0.5 - tall, 0.5 + wide, 0.5 + tall)


def growing(rate_per_s: float, n: int, period_s: float) -> list[m.Evidence]:
    return [seeing(box(BUOY, square(0.05 * math.exp(rate_per_s * i * period_s)))) for i in range(n)]


def test_the_window_follows_the_period() -> None:
    """At least six frame periods of history, and gaps of two and a half."""
    config = MotionConfig()
    assert motion_window(0.2, config) == Window(3.0, 0.75)
    assert motion_window(1.0, config) == Window(6.0, 2.5)
    assert motion_window(2.0, config) == Window(12.0, 5.0)
    paper = PAPER.advisor.motion
    assert [motion_window(period_s, paper) for period_s in (0.2, 2.0)] == [Window(1.5, 0.75)] * 2  # I5, I16


@pytest.mark.parametrize("rate_hz", [0.5, 1.0, 2.0, 4.0, 5.0, 10.0])
@pytest.mark.parametrize(("growth", "state"), [(0.1, S.APPROACHING), (-0.1, S.RECEDING), (0.0, S.STEADY)])
def test_paani_knows_at_every_rate(rate_hz: float, growth: float, state: m.MotionState) -> None:
    """I22 mended: where five samples can come, they count; the tracks say which times applied."""
    frames = growing(growth, round(12 * rate_hz) + 1 if rate_hz >= 1.0 else 7, 1.0 / rate_hz)
    _, _, tracks = play(frames, PAANI, 1.0 / rate_hz)
    assert tracks[-1].tracks[0].motion is state
    assert tracks[-1].period_s == pytest.approx(1.0 / rate_hz)
    assert tracks[-1].motion_history_s == pytest.approx(max(3.0, 6.0 / rate_hz))
    assert tracks[-1].motion_max_gap_s == pytest.approx(max(0.75, 2.5 / rate_hz))


def test_i22_with_the_papers_constants_nothing_is_ever_known_at_half_a_hertz() -> None:
    """I22: 151 frames, as in the paper's session: at most one usable sample, unknown throughout, with its cause."""
    frames = [seeing(box(BUOY, square(0.03 + 0.02 * (1.0 + math.sin(0.2 * i)))), BUOY_AHEAD) for i in range(151)]
    state, _, tracks = play(frames, PAPER, 2.0)
    seen = [track for frame in tracks for track in frame.tracks]
    assert {track.motion for track in seen} == {S.UNKNOWN}
    assert C.NONE not in {track.motion_cause for track in seen}
    assert max(len(track.identity.motion.samples) for track in state.tracker.tracks) == 1
    assert {frame.motion_history_s for frame in tracks} == {1.5}


def test_h5_what_is_held_is_known_no_longer_than_the_gap() -> None:
    """H5, I16: no sighting, no motion; after the gap the cause is the gap."""
    _, _, tracks = play([*growing(0.2, 12, 0.2), *[CLEAR] * 6])
    states = [(frame.tracks[0].motion, frame.tracks[0].motion_cause) for frame in tracks]
    assert states[11:15] == [(S.APPROACHING, C.NONE)] * 4
    assert states[15:] == [(S.UNKNOWN, C.GAP)] * 3


def test_i13_a_new_shape_counts_from_its_second_sighting() -> None:
    """`paani` leaves one box of another shape out and begins again at the second; `paper` at the first."""
    usual, odd = seeing(box(BUOY, square(0.1))), seeing(box(BUOY, square(0.1, 2.0)))
    _, _, tracks = play([*[usual] * 6, odd, usual, odd, odd])
    assert [frame.tracks[0].motion_cause for frame in tracks[5:]] == [C.NONE] * 4 + [C.SHAPE_CHANGE]
    _, _, tracks = play([*[usual] * 6, odd, usual], PAPER)
    assert [frame.tracks[0].motion_cause for frame in tracks[5:]] == [C.NONE, C.SHAPE_CHANGE, C.SHAPE_CHANGE]


def test_a_cause_does_not_outlive_its_samples() -> None:
    """Once known again, an old reset no longer explains a later lack of samples."""
    config, window = MotionConfig(), Window(3.0, 0.75)
    history = MotionHistory(reset_cause=C.CLIPPED_BY_FRAME)
    for i in range(5):
        assert estimate_motion(history, i * 200_000, window, config).cause is C.CLIPPED_BY_FRAME
        history = add_measurement(history, SizeMeasurement(i * 200_000, square(0.1), -2.0, 0.8, False), window, config)
    assert history.reset_cause is C.NONE
    assert estimate_motion(history, 800_000, window, config).cause is C.NONE


def test_a_slope_needs_a_spread() -> None:
    with pytest.raises(UserError, match=r"advisor\.motion\.min_samples"):
        load_config(sets=["advisor.motion.min_samples=2"])


MEASUREMENT = st.builds(
    SizeMeasurement,
    st.integers(0, 20_000_000),
    st.tuples(st.floats(0.0, 0.45), st.floats(0.0, 0.45), st.floats(0.46, 1.0), st.floats(0.46, 1.0)),
    st.floats(-30.0, 1.0),
    st.floats(0.0, 1.0),
    st.booleans(),
)
WINDOWS = st.builds(Window, st.floats(0.5, 20.0), st.floats(0.1, 6.0))


@settings(max_examples=150, deadline=None)
@given(st.lists(MEASUREMENT, max_size=60), WINDOWS, st.booleans())
def test_unknown_has_a_cause_and_only_unknown(
    measurements: list[SizeMeasurement], window: Window, in_order: bool
) -> None:
    """Every `unknown` has its cause; at most 24 samples within the window; the confidence stays within its cap."""
    config, history = MotionConfig(), MotionHistory()
    for measurement in sorted(measurements) if in_order else measurements:
        history = add_measurement(history, measurement, window, config)
        found = estimate_motion(history, measurement.at_us, window, config)
        assert (found.state is S.UNKNOWN) == (found.cause is not C.NONE)
        assert 0.0 <= found.confidence <= config.max_confidence
        assert len(history.samples) <= config.max_samples
        assert len(history.outliers) < config.shape_change_hits
        if history.samples:
            assert history.samples[-1].at_us - history.samples[0].at_us <= window.history_s * 1e6 + 1


SPOT = st.builds(
    lambda x, y, w, h, c: box(BUOY, (x, y, min(x + w, 1.0), min(y + h, 1.0)), c),
    st.floats(0.0, 0.9), st.floats(0.2, 0.8), st.floats(0.03, 0.4), st.floats(0.03, 0.4), st.floats(0.3, 1.0),
)  # fmt: skip
DRIFT = st.tuples(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(-0.1, 0.1))


def drifting(start: m.Detection, drift: tuple[float, float, float], n: int) -> list[m.Evidence]:
    """A box that moves and grows evenly, kept in the picture."""
    x1, y1, x2, y2 = start.box_xyxy
    frames = []
    for i in range(n):
        half_w, half_h = ((b - a) / 2.0 * math.exp(drift[2] * i) for a, b in ((x1, x2), (y1, y2)))
        x, y = (x1 + x2) / 2.0 + drift[0] * i, (y1 + y2) / 2.0 + drift[1] * i
        left, right = max(0.0, x - half_w), min(1.0, x + half_w)
        high, low = max(0.0, y - half_h), min(1.0, y + half_h)
        sound = right - left > 1e-3 and low - high > 1e-3
        frames.append(seeing(box(BUOY, (left, high, right, low), start.confidence)) if sound else CLEAR)
    return frames


@settings(max_examples=60, deadline=None)
@given(SPOT, DRIFT, st.sampled_from([0.1, 0.2, 0.5]), st.floats(1e-6, 1.0), st.integers(3, 12), st.floats(0.1, 10.0))
def test_i20_motion_never_reaches_the_advice(
    start: m.Detection, drift: tuple[float, float, float], period_s: float, band: float, samples: int, history_s: float
) -> None:
    """I20, H6: whatever the estimator says of the same boxes, the advice is the same to the byte.

    So it lowers no risk and authorises nothing: the states differ, the directions and risks do not.
    """
    other = load_config(
        sets=[
            f"advisor.motion.deadband_per_s={band}",
            f"advisor.motion.min_samples={samples}",
            f"advisor.motion.history_s={history_s}",
            "advisor.motion.min_quality=0.0",
        ]
    )
    frames = drifting(start, drift, 14)
    assert msgspec.json.encode(play(frames, PAANI, period_s)[1]) == msgspec.json.encode(
        play(frames, other, period_s)[1]
    )


@pytest.mark.parametrize(("growth", "state"), [(0.05, S.APPROACHING), (-0.05, S.RECEDING), (0.0, S.STEADY)])
def test_i20_a_known_state_and_an_unknown_one_give_the_same_advice(growth: float, state: m.MotionState) -> None:
    """I20: with room for four samples nothing is ever known of the same boxes, and nothing else changes."""
    blind = load_config(sets=["advisor.motion.max_samples=4"])
    frames = drifting(box(BUOY, (0.42, 0.42, 0.58, 0.58), 0.9), (0.0, 0.0, growth), 10)
    (_, advice, tracks), (_, blind_advice, blind_tracks) = play(frames, PAANI), play(frames, blind)
    assert (tracks[-1].tracks[0].motion, blind_tracks[-1].tracks[0].motion) == (state, S.UNKNOWN)
    assert advice[-1].center.obstacle > 0.2
    assert msgspec.json.encode(advice) == msgspec.json.encode(blind_advice)


ANY = st.floats(allow_nan=True, allow_infinity=True) | st.floats(0.0, 1.0)
UNIT, FINITE = st.floats(0.0, 1.0), st.floats(-1e9, 1e9)
STAMP = st.integers(0, 2**53) | st.integers(10**9, 10**9 + 10**7)


def moments(of_box: st.SearchStrategy[float], of_boat: st.SearchStrategy[float]) -> st.SearchStrategy[Any]:
    """Frames in any order of time and epoch, with boxes and odometry made of such numbers."""
    detection = st.builds(
        m.Detection,
        label=st.sampled_from(m.Label),
        confidence=of_box,
        box_xyxy=st.tuples(of_box, of_box, of_box, of_box),
    )
    odometry = st.none() | st.builds(
        m.Odometry,
        source_us=STAMP,
        epoch=st.integers(0, 2),
        x_m=of_boat,
        y_m=of_boat,
        yaw_rad=of_boat,
        surge_mps=of_boat,
        yaw_rate_radps=of_boat,
        roll_rad=of_boat,
        pitch_rad=of_boat,
        healthy=st.booleans(),
    )
    frame = st.builds(
        m.Evidence,
        source_us=STAMP,
        media_us=STAMP,
        frame_seq=st.integers(0, 5),
        frame_epoch=st.integers(0, 2),
        width_px=st.integers(0, 640),
        height_px=st.integers(0, 480),
        usable=st.just(True),
        time_base=st.sampled_from(m.TimeBase),
        detections=st.lists(detection | SPOT, max_size=8).map(tuple),
    )
    return st.lists(st.tuples(frame, odometry), max_size=12)


def advise_all(frames: list[tuple[m.Evidence, m.Odometry | None]], config: Config) -> AdvisorState:
    """The state after these frames, its bounds kept; what is said on the way survives the wire."""
    state = AdvisorState()
    for frame, odometry in frames:
        state, _, tracks = advise(state, frame, frame.source_us, config, odometry)
        assert msgspec.json.decode(msgspec.json.encode(tracks), type=m.Tracks) == tracks
        assert len(state.tracker.tracks) <= config.advisor.tracker.max_tracks
        assert len(state.tracker.periods_s) <= MAX_PERIODS
        assert len(state.tracker.attitudes) <= MAX_ATTITUDES
    return state


@settings(max_examples=60, deadline=None)
@given(moments(ANY, ANY), st.sampled_from([PAANI, PAPER]))
def test_no_box_no_time_and_no_odometry_is_too_bad(frames: list[Any], config: Config) -> None:
    """NaN, inverted, empty and outlying boxes, time and epochs in any order: bounded, and no exception."""
    advise_all(frames, config)


@settings(max_examples=60, deadline=None)
@given(moments(UNIT, FINITE), st.sampled_from([PAANI, PAPER]))
def test_a_state_survives_json_exactly(frames: list[Any], config: Config) -> None:
    """Whatever the wire lets through: the ledger's state is the state."""
    state = advise_all(frames, config)
    assert msgspec.json.decode(msgspec.json.encode(state), type=AdvisorState) == state


def test_ten_thousand_boxes_are_bounded_and_counted() -> None:
    """G1: the most confident 64 of the sound ones are tracked; every other kind is counted."""
    tiny = [
        box(BUOY, (x, y, x + 0.004, y + 0.004), 0.5)
        for i in range(7000)
        for x, y in [((i % 90) / 100, (i // 90) / 100)]
    ]
    sure = [box(BUOY, (0.1 * i, 0.9, 0.1 * i + 0.05, 0.99), 0.9) for i in range(9)]
    bad = [
        box(BUOY, (math.nan, 0.1, 0.2, 0.2)),
        box(BUOY, (0.3, 0.1, 0.2, 0.2)),
        box(BUOY, (0.2, 0.1, 0.2, 0.2)),
        box(BUOY, (0.1, 0.1, 1.2, 0.2)),
        box(BUOY, (0.1, 0.1, 0.2, 0.2), math.nan),
    ] * 600
    state, advice, tracks = play([seeing(*tiny, *bad, *sure)] * 3)
    assert [len(frame.tracks) for frame in tracks] == [64] * 3
    assert sum(track.confidence > 0.8 for track in tracks[-1].tracks) == 9
    assert state.tracker.malformed == 3 * 3000
    assert {a.reason for a in advice} == {m.Reason.MALFORMED_EVIDENCE}


def test_time_that_jumps_back_holds_nothing_for_longer() -> None:
    """Every step back is a step; what was held from the future is forgotten in its own time."""
    state, _, _ = play([seeing(BUOY_AHEAD)] * 6)
    for seq, at_us in enumerate((T0_US - 60_000_000, T0_US - 120_000_000), 6):
        frame = msgspec.structs.replace(CLEAR, frame_seq=seq, source_us=at_us)
        state, _, tracks = advise(state, frame, at_us, PAANI)
        assert [track.held for track in tracks.tracks] == [True]
    gone = msgspec.structs.replace(CLEAR, frame_seq=8, source_us=T0_US - 117_000_000)
    state, _, tracks = advise(state, gone, T0_US - 117_000_000, PAANI)
    assert tracks.tracks == ()
