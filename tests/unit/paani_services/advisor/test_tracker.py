"""Identity, confirmation, hold, smoothing, urgency, apparent motion."""

from __future__ import annotations

import math

import msgspec
import pytest

from paani import messages as m
from paani.boxes import iou
from paani.config import Config
from paani_services.advisor.advise import AdvisorState, advise
from paani_services.advisor.association import assign_boxes
from paani_services.advisor.motion import MotionHistory, SizeMeasurement, Window, add_measurement, estimate_motion
from paani_services.advisor.tracker import HAZARDS
from tests.unit.paani_services.advisor.advisor_evidence import BUOY_AHEAD, CLEAR, PAANI, PAPER, T0_US, box, play, seeing

BUOY = m.Label.BUOY
S, C = m.MotionState, m.MotionCause
WINDOW = Window(1.5, 0.75)


def growing(rate_per_s: float, n: int, period_s: float = 0.2, confidence: float = 0.8) -> list[m.Evidence]:
    """A centred box whose log size grows at the rate."""
    frames = []
    for i in range(n):
        half = 0.05 * math.exp(rate_per_s * i * period_s)
        frames.append(seeing(box(BUOY, (0.5 - half, 0.5 - half, 0.5 + half, 0.5 + half), confidence)))
    return frames


def test_g8_hazards_are_one_to_one() -> None:
    """G8: four labels, four hazards, the label kept."""
    assert {label: HAZARDS[label].value for label in m.Label} == {
        m.Label.PERSON: "swimmer", m.Label.VESSEL: "craft", m.Label.PIER: "structure", m.Label.BUOY: "marker",
    }  # fmt: skip
    boxes = [box(label, (0.05 + 0.24 * k, 0.4, 0.20 + 0.24 * k, 0.6)) for k, label in enumerate(m.Label)]
    _, _, tracks = play([seeing(*boxes)] * 2)
    assert {each.label: each.hazard for each in tracks[-1].tracks} == HAZARDS


def test_g2_greedy_overlap() -> None:
    """G2: the best pair first; below 0.25 no pair."""
    assert iou((0.0, 0.0, 0.2, 0.2), (0.1, 0.0, 0.3, 0.2)) == pytest.approx(1 / 3)
    found = assign_boxes([(0.0, 0.0, 0.2, 0.2)], [(0.1, 0.0, 0.3, 0.2), (0.01, 0.0, 0.2, 0.2)], 0.25)
    assert found.track_of == {1: 0}
    assert found.ambiguous == {1}
    assert assign_boxes([(0.0, 0.0, 0.2, 0.2)], [(0.13, 0.0, 0.33, 0.2)], 0.25).track_of == {}


@pytest.mark.parametrize(("shift", "same"), [(0.1198, True), (0.1202, False)])
@pytest.mark.parametrize("config", [PAANI, PAPER], ids=["paani", "paper"])
def test_g2_a_quarter_of_overlap_is_enough(config: Config, shift: float, same: bool) -> None:
    """G2: boxes of width 0.2 that are 0.12 apart overlap by 0.08 / 0.32 = 0.25; a little less begins another track."""
    frames = [seeing(box(BUOY, (0.3 + x, 0.4, 0.5 + x, 0.6))) for x in (0.0, shift)]
    _, _, tracks = play(frames, config)
    assert (tracks[1].tracks[0].hits == 2) is same
    assert len(tracks[1].tracks) == (1 if same else 2)


def test_g4_two_hits_confirm() -> None:
    """G4, G11: acceptance is its own field, the score is not touched."""
    _, _, tracks = play([seeing(BUOY_AHEAD)] * 2)
    first, second = tracks[0].tracks[0], tracks[1].tracks[0]
    assert (first.hits, first.confirmed, first.accepted, first.confidence) == (1, False, False, 0.8)
    assert (second.hits, second.confirmed, second.accepted, second.id) == (2, True, True, first.id)


def test_g11_what_a_track_is_stands_in_fields_of_its_own() -> None:
    """G11: sighted, confirmed, then only predicted, and in danger at first sight; the score stays what it was."""
    near = box(BUOY, (0.40, 0.50, 0.60, 0.70))

    def fields(track: m.Track) -> tuple[bool, bool, bool, bool, float]:
        return track.confirmed, track.immediate_danger, track.accepted, track.held, track.confidence

    _, _, tracks = play([seeing(BUOY_AHEAD), seeing(BUOY_AHEAD), CLEAR])
    assert [fields(frame.tracks[0]) for frame in tracks] == [
        (False, False, False, False, 0.8),
        (True, False, True, False, 0.8),
        (True, False, True, True, 0.8),
    ]
    _, _, tracks = play([seeing(near)])
    assert fields(tracks[0].tracks[0]) == (False, True, True, False, 0.8)


def test_g10_no_motion_filter_and_no_reidentification() -> None:
    """G10: a box is matched with the last one seen, neither smoothed nor moved on; unseen it stays, elsewhere is new.

    Steps of 0.11 at a width of 0.2 leave an IoU of 0.29 with the last box, and of 0.15 with the smoothed one.
    """
    steps = [seeing(box(BUOY, (x, 0.4, x + 0.2, 0.6))) for x in (0.10, 0.21, 0.32, 0.43)]
    elsewhere = seeing(box(BUOY, (0.75, 0.4, 0.95, 0.6)))
    _, _, tracks = play([*steps, CLEAR, CLEAR, elsewhere])
    assert [[t.id for t in frame.tracks] for frame in tracks[:6]] == [[1]] * 6
    assert tracks[3].tracks[0].box_xyxy == tracks[4].tracks[0].box_xyxy == tracks[5].tracks[0].box_xyxy
    assert [t.id for t in tracks[6].tracks] == [1, 2]


@pytest.mark.parametrize(
    ("xyxy", "danger"),
    [
        ((0.40, 0.55, 0.6001, 0.65), True),  # bottom 0.65, area 0.02
        ((0.40, 0.53, 0.60, 0.649), False),  # area 0.0238
        ((0.40, 0.56, 0.60, 0.65), False),  # area 0.018
    ],
)
def test_g5_immediate_danger(xyxy: m.BoxXyxy, danger: bool) -> None:
    """G5: accepted without waiting, from both limits on."""
    _, _, tracks = play([seeing(box(BUOY, xyxy))])
    track = tracks[0].tracks[0]
    assert (track.immediate_danger, track.accepted, track.confirmed) == (danger, danger, False)


def test_g3_hold() -> None:
    """G3: listed as held for 3.0 s after the last sighting, then gone."""
    _, _, tracks = play([seeing(BUOY_AHEAD)] * 2 + [CLEAR] * 16)
    held = [[t.held for t in frame.tracks] for frame in tracks]
    assert held[1] == [False]
    assert held[2:16] == [[True]] * 14
    assert held[16:] == [[], []]


def test_g6_g7_smoothing() -> None:
    """G6: 0.35 of the box before; G7: 0.65 of the score before."""
    _, _, tracks = play(
        [
            seeing(box(BUOY, (0.40, 0.40, 0.60, 0.60), 0.6)),
            seeing(box(BUOY, (0.42, 0.40, 0.62, 0.60), 0.9)),
        ]
    )
    track = tracks[1].tracks[0]
    assert track.box_xyxy == pytest.approx((0.413, 0.40, 0.613, 0.60))
    assert track.confidence == pytest.approx(0.65 * 0.6 + 0.35 * 0.9)


def test_g1_work_is_bounded() -> None:
    """G1: at most `max_tracks` tracks, whatever comes."""
    many = [box(BUOY, (0.01 * i, 0.01 * j, 0.01 * i + 0.005, 0.01 * j + 0.005)) for i in range(40) for j in range(40)]
    _, _, tracks = play([seeing(*many)] * 2)
    assert [len(frame.tracks) for frame in tracks] == [64, 64]


def test_a_label_may_change_without_losing_the_track() -> None:
    """G8: identity follows the box; the newest source label is kept."""
    xyxy = (0.4, 0.4, 0.6, 0.6)
    _, _, tracks = play([seeing(box(m.Label.PIER, xyxy)), seeing(box(m.Label.VESSEL, xyxy))])
    assert tracks[0].tracks[0].id == tracks[1].tracks[0].id
    assert (tracks[1].tracks[0].label, tracks[1].tracks[0].hazard) == (m.Label.VESSEL, m.Hazard.CRAFT)


def test_h1_growth() -> None:
    """H1: sqrt(area) from 0.20 to 0.216 in 0.2 s is 0.08/s: half of full scale."""
    _, _, tracks = play(
        [
            seeing(box(BUOY, (0.4, 0.4, 0.6, 0.6))),
            seeing(box(BUOY, (0.392, 0.392, 0.608, 0.608))),
        ]
    )
    assert tracks[1].tracks[0].urgency == pytest.approx(0.5)


def test_h2_centering_and_h3_maximum() -> None:
    """H2: 0.02 nearer to the centre in 0.2 s is 0.10/s: half of full scale; H3: the larger of both counts."""
    _, _, tracks = play(
        [
            seeing(box(BUOY, (0.2, 0.4, 0.4, 0.6))),
            seeing(box(BUOY, (0.22, 0.4, 0.42, 0.6))),
            seeing(box(BUOY, (0.19, 0.4, 0.39, 0.6))),
        ]
    )
    assert tracks[1].tracks[0].urgency == pytest.approx(0.5)
    assert tracks[2].tracks[0].urgency == pytest.approx(0.0, abs=1e-9)  # moving away is no urgency


@pytest.mark.parametrize(("half", "urgency"), [(0.104, 0.5), (0.112, 0.75)])
def test_h3_the_larger_of_both_counts(half: float, urgency: float) -> None:
    """H3: half of full scale towards the centre, beside a quarter or three quarters of growth: the larger, no sum."""
    before = box(BUOY, (0.2, 0.4, 0.4, 0.6))
    after = box(BUOY, (0.32 - half, 0.5 - half, 0.32 + half, 0.5 + half))
    _, _, tracks = play([seeing(before), seeing(after)])
    assert tracks[1].tracks[0].urgency == pytest.approx(urgency)


def test_h4_h5_held_urgency_decays() -> None:
    """H4: exp(-dt / 1 s) while held; H5: a miss adds no motion sample."""
    _, _, tracks = play(
        [
            seeing(box(BUOY, (0.2, 0.4, 0.4, 0.6))),
            seeing(box(BUOY, (0.22, 0.4, 0.42, 0.6))),
            *[CLEAR] * 15,
        ]
    )
    assert tracks[6].tracks[0].urgency == pytest.approx(0.5 * math.exp(-1.0))
    assert tracks[6].tracks[0].hits == 2
    assert tracks[15].tracks[0].urgency == pytest.approx(0.5 * math.exp(-2.8))
    assert tracks[16].tracks == ()  # 3 s after it was seen


def test_h6_urgency_and_the_diagnostic_stay_apart() -> None:
    """H6, I20: the motion state appears on the track; risk takes the urgency only."""
    _, advice, tracks = play(growing(-0.3, 10))
    assert tracks[-1].tracks[0].motion is S.RECEDING
    assert advice[-1].center.urgency == tracks[-1].tracks[0].urgency == 0.0
    assert advice[-1].center.risk == pytest.approx(0.05 + 0.65 * advice[-1].center.obstacle)


@pytest.mark.parametrize(
    ("rate_per_s", "state"),
    [
        *[(0.30, S.APPROACHING), (0.051, S.APPROACHING), (-0.30, S.RECEDING), (-0.051, S.RECEDING)],
        *[(0.0, S.STEADY), (0.029, S.STEADY), (-0.029, S.STEADY)],
        *[(0.045, S.UNKNOWN), (0.031, S.UNKNOWN), (-0.031, S.UNKNOWN), (-0.045, S.UNKNOWN)],
    ],
)
def test_i3_i4_states(rate_per_s: float, state: m.MotionState) -> None:
    """I1, I3, I4, U9: expansion, contraction and steady; an interval across the dead band's edge is unknown."""
    _, _, tracks = play(growing(rate_per_s, 10), PAPER)
    track = tracks[-1].tracks[0]
    assert track.motion is state
    assert track.motion_rate_per_s == pytest.approx(rate_per_s, abs=1e-9)
    assert track.motion_margin_per_s == pytest.approx(0.01)  # I2: the floor, for a perfect fit
    assert track.motion_cause is (C.NONE if state is not S.UNKNOWN else C.AMBIGUOUS_INTERVAL)


def test_i2_margin_by_hand() -> None:
    """I2: y = 0, .1, 0, .1, 0 at 0..0.8 s: beta 0, SSE 0.012, S_tt 0.4, m = 3*sqrt(.012/(3*.4)) = 0.3."""
    history = MotionHistory()
    for i, y in enumerate((0.0, 0.1, 0.0, 0.1, 0.0)):
        half = 0.1 * math.exp(y)
        xyxy = (0.5 - half, 0.5 - half, 0.5 + half, 0.5 + half)
        history = add_measurement(
            history, SizeMeasurement(i * 200_000, xyxy, y, 0.8, False), WINDOW, PAPER.advisor.motion
        )
    found = estimate_motion(history, 800_000, WINDOW, PAPER.advisor.motion)
    assert found.rate_per_s == pytest.approx(0.0, abs=1e-12)
    assert found.margin_per_s == pytest.approx(0.3)
    assert (found.state, found.cause) == (S.UNKNOWN, C.LOW_QUALITY)  # I7, I8: 0.8 * 5/8 * 1 * .04/.3 = 0.067


def zigzag(beta_per_s: float, margin_per_s: float, confidence: float) -> MotionHistory:
    """Five samples over 0.8 s whose slope and margin are these: residuals as in `test_i2_margin_by_hand`, scaled."""
    history = MotionHistory()
    for i, residual in enumerate((0.0, 0.1, 0.0, 0.1, 0.0)):
        y = beta_per_s * 0.2 * i + residual * margin_per_s / 0.3
        xyxy = (0.4, 0.4, 0.6, 0.6)
        measurement = SizeMeasurement(i * 200_000, xyxy, y, confidence, False)
        history = add_measurement(history, measurement, WINDOW, PAPER.advisor.motion)
    return history


def test_i7_each_factor_of_the_quality_counts() -> None:
    """I7: duration 0.8 / 1.0, samples 5 / 8, confidence 0.42 / 0.6, margin 0.04 / 0.05: 0.8 * 0.625 * 0.7 * 0.8."""
    found = estimate_motion(zigzag(0.3, 0.05, 0.42), 800_000, WINDOW, PAPER.advisor.motion)
    assert [found.rate_per_s, found.margin_per_s, found.confidence] == pytest.approx([0.3, 0.05, 0.28])
    assert found.state is S.APPROACHING


@pytest.mark.parametrize(("confidence", "state"), [(0.415, S.APPROACHING), (0.412, S.UNKNOWN)])
def test_i8_a_quality_below_a_quarter_is_unknown(confidence: float, state: m.MotionState) -> None:
    """I8: 0.5 * 0.725 * confidence / 0.6 on either side of 0.25; exactly 0.25 is in `test_i5_i6_samples`."""
    found = estimate_motion(zigzag(0.3, 0.04 / 0.725, confidence), 800_000, WINDOW, PAPER.advisor.motion)
    assert found.state is state
    assert found.cause is (C.NONE if state is S.APPROACHING else C.LOW_QUALITY)


def test_i5_i6_samples() -> None:
    """I5: 1.5 s and 24 samples at most; I6: five over 0.4 s at least."""
    _, _, tracks = play(growing(0.3, 5), PAPER)
    assert [frame.tracks[0].motion_cause for frame in tracks] == [C.TOO_FEW_SAMPLES] * 4 + [C.NONE]
    _, _, tracks = play(growing(0.3, 5, 0.0999), PAPER, period_s=0.0999)
    assert tracks[-1].tracks[0].motion_cause is C.TOO_SHORT
    _, _, tracks = play(growing(0.3, 5, 0.1), PAPER, period_s=0.1)  # its quality is 0.4 * 5/8 = 0.25, and no less (I8)
    assert (tracks[-1].tracks[0].motion, tracks[-1].tracks[0].motion_cause) == (S.APPROACHING, C.NONE)
    state, _, _ = play(growing(0.1, 40, 0.02), PAPER, period_s=0.02)
    assert len(state.tracker.tracks[0].identity.motion.samples) == 24
    state, _, _ = play(growing(0.1, 20), PAPER)
    assert len(state.tracker.tracks[0].identity.motion.samples) == 8


def test_i9_confidence_is_capped() -> None:
    """I9."""
    _, _, tracks = play(growing(0.3, 10))
    assert tracks[-1].tracks[0].motion_confidence == 0.9


@pytest.mark.parametrize(
    ("before", "last", "cause"),
    [
        pytest.param((0.02, 0.44, 0.56, 0.56), box(BUOY, (0.0, 0.44, 0.56, 0.56)), C.CLIPPED_BY_FRAME, id="I10-left"),
        pytest.param((0.44, 0.02, 0.56, 0.56), box(BUOY, (0.44, 0.0, 0.56, 0.56)), C.CLIPPED_BY_FRAME, id="I10-top"),
        pytest.param((0.44, 0.44, 0.98, 0.56), box(BUOY, (0.44, 0.44, 1.0, 0.56)), C.CLIPPED_BY_FRAME, id="I10-right"),
        pytest.param((0.44, 0.44, 0.56, 0.98), box(BUOY, (0.44, 0.44, 0.56, 1.0)), C.CLIPPED_BY_FRAME, id="I10-bottom"),
        pytest.param((0.44, 0.44, 0.56, 0.56), box(BUOY, (0.44, 0.44, 0.56, 0.56), 0.39), C.WEAK_DETECTION, id="I11"),
        pytest.param((0.44, 0.44, 0.56, 0.56), box(BUOY, (0.40, 0.46, 0.60, 0.54)), C.SHAPE_CHANGE, id="I13"),
    ],
)
def test_resets_by_the_box(before: m.BoxXyxy, last: m.Detection, cause: m.MotionCause) -> None:
    """I10, I11, I13: each with its code."""
    _, _, tracks = play([*[seeing(box(BUOY, before))] * 6, seeing(last)], PAPER)
    assert tracks[5].tracks[0].motion_cause is C.NONE
    assert (tracks[6].tracks[0].motion, tracks[6].tracks[0].motion_cause) == (S.UNKNOWN, cause)


def test_i12_ambiguous_association() -> None:
    """I12: a second box that could have been the same object."""
    one = box(BUOY, (0.40, 0.40, 0.60, 0.60))
    two = box(BUOY, (0.46, 0.40, 0.66, 0.60), 0.7)
    _, _, tracks = play([*[seeing(one)] * 6, seeing(one, two)])
    assert tracks[6].tracks[0].motion_cause is C.AMBIGUOUS_ASSOCIATION


def test_i14_reversed_time() -> None:
    """I14: within one epoch the source's time went back; nothing is held for longer because of it."""
    state, _, _ = play([seeing(BUOY_AHEAD)] * 6)
    back = msgspec.structs.replace(seeing(BUOY_AHEAD), frame_seq=6, source_us=T0_US - 5_000_000)
    state, _, tracks = advise(state, back, T0_US - 5_000_000, PAANI)
    assert tracks.tracks[0].motion_cause is C.TIME_REVERSED
    gone = msgspec.structs.replace(CLEAR, frame_seq=7, source_us=T0_US - 1_900_000)
    _, _, tracks = advise(state, gone, T0_US - 1_900_000, PAANI)
    assert tracks.tracks == ()


def test_i16_gap() -> None:
    """I16: more than 0.75 s between sightings begins again."""
    frames = [seeing(BUOY_AHEAD)] * 6 + [CLEAR] * 4 + [seeing(BUOY_AHEAD)]
    _, _, tracks = play(frames)
    assert tracks[10].tracks[0].motion_cause is C.GAP
    assert tracks[10].tracks[0].hits == 7


@pytest.mark.parametrize("time_base", [m.TimeBase.MEDIA, m.TimeBase.FRAME_INDEX])
def test_i17_a_replay_measures_motion_on_its_media_time(time_base: m.TimeBase) -> None:
    """I17: frames played twice as slowly as recorded keep the recorded rate; freshness stays with source_us."""
    state, tracks = AdvisorState(), m.Tracks(source_us=0, frame_seq=0, frame_epoch=0)
    for i, frame in enumerate(growing(0.3, 10)):
        replayed = msgspec.structs.replace(
            frame, frame_seq=i, source_us=T0_US + i * 400_000, media_us=i * 200_000, time_base=time_base
        )
        state, _, tracks = advise(state, replayed, replayed.source_us, PAANI)
    assert tracks.tracks[0].motion_rate_per_s == pytest.approx(0.3)


def test_i22_the_papers_rate_starves_the_estimator() -> None:
    """I22: at 0.5 Hz every state of a whole `paper` session is unknown; `paani` follows the rate and knows."""
    frames = growing(0.06, 15, 2.0)
    _, _, paper = play(frames, PAPER, period_s=2.0)
    assert {t.motion for frame in paper for t in frame.tracks} == {S.UNKNOWN}
    assert paper[-1].tracks[0].motion_cause is C.GAP
    _, _, paani = play(frames, PAANI, period_s=2.0)
    assert paani[-1].tracks[0].motion is S.APPROACHING
