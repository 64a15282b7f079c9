"""The boat's own turning: sizes as angles, places after a turn, tracks that stay in their direction."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import keys
from paani import messages as m
from paani.config import Config, load_config
from paani.decider import Input
from paani.geometry import wrap_rad
from paani_services.advisor.advise import AdvisorState, advise
from paani_services.advisor.decide import DECIDER
from paani_services.advisor.rotation import (
    MAX_ATTITUDES,
    Attitude,
    CameraView,
    append_attitude,
    attitude_at,
    camera_lens,
    camera_view,
    log_angular_size,
    predict_boxes,
)
from paani_sim.eye.camera import BoatPose, Camera, project
from tests.unit.paani_services.advisor.advisor_evidence import BUOY_AHEAD, CLEAR, PAANI, PAPER, T0_US, box, seeing

U = m.RotationUse
OFF = load_config(sets=["advisor.motion.compensate_rotation=false"])
LENS = camera_lens(CLEAR, PAANI)
BUOY_M = np.array([[x, y, z] for x in (-0.3, 0.3) for y in (-0.3, 0.3) for z in (0.0, 0.9)])


def odometry(source_us: int, yaw_rad: float, rate_radps: float = 0.0, **fields: float) -> m.Odometry:
    return m.Odometry(
        source_us=source_us, x_m=0.0, y_m=0.0, yaw_rad=yaw_rad, surge_mps=0.0, yaw_rate_radps=rate_radps,
        **{"healthy": True} | fields,  # type: ignore[arg-type]
    )  # fmt: skip


def attitude(yaw_rad: float = 0.0, roll_rad: float = 0.0, pitch_rad: float = 0.0, epoch: int = 0) -> Attitude:
    return Attitude(0, epoch, yaw_rad, 0.0, roll_rad, pitch_rad)


def seen_box(pose: BoatPose, at_m: tuple[float, float], scale: float = 1.0, camera: Camera | None = None) -> m.BoxXyxy:
    """Where the simulator's camera sees a buoy."""
    pixels = project(scale * BUOY_M + [*at_m, 0.0], pose, camera or Camera()) / (320.0, 240.0)
    (x1, y1), (x2, y2) = pixels.min(axis=0).tolist(), pixels.max(axis=0).tolist()
    return (x1, y1, x2, y2)


def test_the_eye_states_the_lens_of_simulated_pictures_alone() -> None:
    """A user's camera says its own field of view; unknown, or too wide for a pinhole, is no lens."""
    assert LENS is not None
    assert LENS.focal_x == pytest.approx(0.5 / math.tan(math.radians(35.0)))
    assert LENS.focal_y == pytest.approx(LENS.focal_x * 320 / 240)
    recording = msgspec.structs.replace(CLEAR, time_base=m.TimeBase.MEDIA)
    webcam, known = (
        load_config(sets=["camera.source=webcam"]),
        load_config(sets=["camera.source=webcam", "calibration.hfov_deg=60"]),
    )
    assert camera_lens(recording, PAANI) is None
    assert camera_lens(CLEAR, webcam) is None
    found = camera_lens(CLEAR, known)
    assert found is not None
    assert found.focal_x == pytest.approx(0.5 / math.tan(math.radians(30.0)))
    assert camera_lens(CLEAR, load_config(sets=["eye.hfov_deg=200"])) is None
    assert camera_lens(msgspec.structs.replace(CLEAR, height_px=0), PAANI) is None


@pytest.mark.parametrize("yaw_rad", [-0.5, -0.25, 0.0, 0.25, 0.5])
@pytest.mark.parametrize(("down_deg", "off"), [(0.0, 0.005), (6.0, 0.045)])
def test_a_turn_does_not_change_the_size(yaw_rad: float, down_deg: float, off: float) -> None:
    """A turn is not an approach: 25 % in the flat picture at half a radian is less than 5 % in angle.

    What is left is the box around things that seem to lean, in a camera that looks down.
    """
    lens = camera_lens(CLEAR, load_config(sets=[f"eye.pitch_down_deg={down_deg}"]))
    camera = Camera(down_deg=down_deg)
    ahead, aside = (seen_box(BoatPose(0.0, 0.0, yaw), (80.0, 0.0), 3.0, camera) for yaw in (0.0, yaw_rad))
    assert log_angular_size(aside, lens) == pytest.approx(log_angular_size(ahead, lens), abs=off)
    if abs(yaw_rad) == 0.5:
        assert log_angular_size(aside, None) > log_angular_size(ahead, None) + 0.19


def test_the_size_follows_the_range() -> None:
    """Half as far is twice the angle."""
    far, near = (seen_box(BoatPose(0.0, 0.0, 0.0), (x_m, 0.0)) for x_m in (16.55, 8.55))
    assert log_angular_size(near, LENS) - log_angular_size(far, LENS) == pytest.approx(math.log(2.0), abs=0.03)


@settings(max_examples=100, deadline=None)
@given(
    st.floats(-0.25, 0.25), st.floats(-0.3, 0.3), st.floats(-0.1, 0.1), st.floats(-0.06, 0.06), st.floats(-0.06, 0.06)
)
@pytest.mark.slow
def test_turned_boxes_lie_where_the_camera_sees_them(
    bearing: float, yaw_rad: float, before_roll: float, now_roll: float, pitch_rad: float
) -> None:
    """Far things, any small yaw, roll and pitch: within a pixel and a half of the simulator's own projection.

    Half of what is left is the boat's origin, which is not the camera; the rest is the box around rolled corners.
    """
    at_m = (200.0 * math.cos(bearing), 200.0 * math.sin(bearing))
    then = seen_box(BoatPose(0.0, 0.0, 0.0, roll_rad=before_roll), at_m, 10.0)
    truth = seen_box(BoatPose(0.0, 0.0, yaw_rad, roll_rad=now_roll, pitch_rad=pitch_rad), at_m, 10.0)
    view = CameraView(U.KNOWN, LENS, attitude(yaw_rad, now_roll, pitch_rad))
    (found,) = predict_boxes([(then, attitude(0.0, before_roll))], view)
    if not all(0.02 < value < 0.98 for value in truth):
        return
    assert found is not None
    assert found == pytest.approx(truth, abs=1.5 / 240)


def test_what_turns_out_of_the_picture_has_no_place() -> None:
    view = CameraView(U.KNOWN, LENS, attitude(1.2))
    ahead, behind = ((0.4, 0.4, 0.5, 0.5), attitude()), ((0.4, 0.4, 0.5, 0.5), attitude(math.pi))
    assert predict_boxes([ahead, behind], view) == [None, None]


def test_attitudes_of_different_epochs_do_not_compare() -> None:
    view = CameraView(U.KNOWN, LENS, attitude(0.3))
    seen = (0.4, 0.4, 0.5, 0.5)
    assert predict_boxes([(seen, attitude(epoch=1)), (seen, None)], view) == [seen, seen]
    assert predict_boxes([(seen, attitude())], CameraView(U.NO_ODOMETRY, LENS)) == [seen]


def test_yaw_is_carried_to_the_capture_stamp() -> None:
    """The nearest odometry, at its rate; none within the limit is none."""
    attitudes: tuple[Attitude, ...] = ()
    for k in range(10):
        attitudes = append_attitude(attitudes, odometry(T0_US + k * 100_000, 0.05 * k, 0.5))
    found = attitude_at(attitudes, T0_US + 430_000, 0.3)
    assert found is not None
    assert found.at_us == T0_US + 430_000
    assert found.yaw_rad == pytest.approx(0.215)
    ahead = attitude_at(attitudes, T0_US + 1_100_000, 0.3)
    assert ahead is not None
    assert ahead.yaw_rad == pytest.approx(0.55)
    assert attitude_at(attitudes, T0_US + 1_200_001, 0.3) is None
    assert attitude_at((), T0_US, 0.3) is None


def test_only_new_and_healthy_odometry_is_kept() -> None:
    first = append_attitude((), odometry(T0_US, 0.1))
    assert len(first) == 1
    for unfit in (
        None,
        odometry(T0_US, 0.2),
        odometry(T0_US + 1, 0.2, healthy=False),
        odometry(T0_US + 1, math.nan),
        odometry(T0_US + 1, 0.2, math.inf),
    ):
        assert append_attitude(first, unfit) is first
    again = append_attitude(first, odometry(T0_US - 5, 0.2, epoch=1))
    assert [a.epoch for a in again] == [1]
    set_back = append_attitude(first, odometry(T0_US - 1, 0.2))
    assert [a.at_us for a in set_back] == [T0_US - 1]
    many: tuple[Attitude, ...] = first
    for k in range(100):
        many = append_attitude(many, odometry(T0_US + 1 + k, 0.1))
    assert len(many) == MAX_ATTITUDES


@pytest.mark.parametrize(
    ("config", "time_base", "age_s", "use"),
    [
        (PAANI, m.TimeBase.CAPTURE, 0.1, U.KNOWN),
        (PAANI, m.TimeBase.CAPTURE, 0.31, U.NO_ODOMETRY),
        (PAPER, m.TimeBase.CAPTURE, 0.1, U.OFF),
        (load_config(sets=["camera.source=webcam"]), m.TimeBase.CAPTURE, 0.1, U.UNKNOWN_LENS),
        (PAANI, m.TimeBase.MEDIA, 0.1, U.UNKNOWN_LENS),
        (load_config(sets=["camera.source=x.mp4", "calibration.hfov_deg=60"]), m.TimeBase.MEDIA, 0.1, U.RECORDING),
    ],
)
def test_the_tracks_say_what_was_known_of_the_turning(
    config: Config, time_base: m.TimeBase, age_s: float, use: m.RotationUse
) -> None:
    """I19: `paper` has it off; without lens, odometry or a live camera it is off by itself and says so."""
    frame = msgspec.structs.replace(CLEAR, time_base=time_base)
    _, _, tracks = advise(AdvisorState(), frame, T0_US, config, odometry(T0_US - round(age_s * 1e6), 0.0))
    assert tracks.rotation is use
    state = append_attitude((), odometry(T0_US - round(age_s * 1e6), 0.0))
    assert (camera_view(state, frame, config).attitude is not None) == (use is U.KNOWN)
    assert (camera_view(state, frame, config).lens is None) == (use in {U.OFF, U.UNKNOWN_LENS})  # of sizes as angles


def test_odometry_is_an_input_of_the_decider() -> None:
    """A replay gives the step the odometry that it was given."""
    assert keys.ODOMETRY in DECIDER.inputs
    heard_now = {topic.name: Input() for topic in DECIDER.inputs} | {keys.EVIDENCE.name: Input(CLEAR, T0_US)}
    for odometry_now, use in ((None, U.NO_ODOMETRY), (odometry(T0_US, 0.0), U.KNOWN)):
        given_now = heard_now | {keys.ODOMETRY.name: Input(odometry_now, T0_US)}
        _, outputs = DECIDER.decide(DECIDER.state(), given_now, T0_US + 100_000, PAANI)
        tracks = outputs[keys.TRACKS.name]
        assert isinstance(tracks, m.Tracks)
        assert tracks.rotation is use


def sweep(config: Config, rate_radps: float, period_s: float, count: int = 2) -> list[m.Tracks]:
    """Tracks while the boat turns in place before `count` buoys in a row; frames a period apart, odometry at 10 Hz."""
    state, found = AdvisorState(), []
    frames = round(1.0 / abs(rate_radps) / period_s)
    for k in range(frames):
        t_s = k * period_s
        yaw_rad = rate_radps * (t_s - 0.5 * frames * period_s)
        pose = BoatPose(0.0, 0.0, yaw_rad)
        boxes = [seen_box(pose, (10.0, 1.5 * i)) for i in range(count)]
        whole = [b for b in boxes if min(b) >= 0.0 and max(b) <= 1.0]
        stamp_us = T0_US + round(t_s * 1e6)
        frame = msgspec.structs.replace(seeing(*(box(m.Label.BUOY, b) for b in whole)), source_us=stamp_us, frame_seq=k)
        for late in range(max(1, round(period_s * 10))):
            heard_us = stamp_us + 50_000 + 100_000 * late
            yaw = yaw_rad + rate_radps * (heard_us - stamp_us) * 1e-6
            state, _, tracks = advise(state, frame, heard_us, config, odometry(heard_us, wrap_rad(yaw), rate_radps))
            if late == 0:
                found.append(tracks)
    return found


@pytest.mark.parametrize("rate_radps", [0.5, -0.5])
@pytest.mark.parametrize("period_s", [0.2, 0.5, 1.0])
def test_a_fast_turn_loses_no_identity(rate_radps: float, period_s: float) -> None:
    """Two like buoys in a row keep their numbers, and neither seems to approach."""
    found = sweep(PAANI, rate_radps, period_s)
    seen = [[t for t in frame.tracks if not t.held] for frame in found]
    assert len({t.id for tracks in seen for t in tracks}) == 2
    assert not {t.motion for tracks in seen for t in tracks} & {m.MotionState.APPROACHING, m.MotionState.RECEDING}
    lost = sweep(OFF, rate_radps, period_s)
    assert len({t.id for frame in lost for t in frame.tracks if not t.held}) > 2


SPOT = st.builds(
    lambda x, y, w, h, c: box(m.Label.VESSEL, (x, y, min(x + w, 1.0), min(y + h, 1.0)), c),
    st.floats(0.0, 0.9), st.floats(0.2, 0.8), st.floats(0.03, 0.4), st.floats(0.03, 0.4), st.floats(0.41, 1.0),
)  # fmt: skip
STEP = st.tuples(
    st.lists(SPOT, max_size=4),
    st.integers(20_000, 900_000),
    st.floats(-4.0, 4.0),
    st.floats(-3.0, 3.0),
    st.floats(-1.0, 1.0),
    st.integers(0, 1),
    st.booleans(),
)
FEW = ["advisor.tracker.max_tracks=5"]


@settings(max_examples=80, deadline=None)
@given(st.lists(STEP, min_size=1, max_size=10), st.booleans())
@pytest.mark.slow
def test_what_a_picture_shows_counts_whatever_the_odometry_claims(
    steps: list[tuple[list[m.Detection], int, float, float, float, int, bool]], few: bool
) -> None:
    """True or not, odometry moves what is not seen alone: each box of the picture is a track, there, by its label."""
    known = load_config(sets=FEW) if few else PAANI
    unknown = load_config(sets=[*FEW, "advisor.motion.compensate_rotation=false"]) if few else OFF
    with_it, without, at_us = AdvisorState(), AdvisorState(), T0_US
    for seq, (spots, later_us, yaw_rad, rate_radps, roll_rad, epoch, healthy) in enumerate(steps):
        at_us += later_us
        frame = msgspec.structs.replace(seeing(*spots), source_us=at_us, frame_seq=seq)
        lying = odometry(at_us, yaw_rad, rate_radps, roll_rad=roll_rad, epoch=epoch, healthy=healthy)
        with_it, _, _ = advise(with_it, frame, at_us, known, lying)
        without, _, _ = advise(without, frame, at_us, unknown, lying)
        pictured, flat = (
            sorted((track.box, track.label) for track in state.tracker.tracks if not track.held)
            for state in (with_it, without)
        )
        assert pictured == flat
        assert len({track.id for track in with_it.tracker.tracks}) == len(with_it.tracker.tracks)


def turn_away_and_back(config: Config, until_rad: float) -> list[tuple[m.BoxXyxy, m.Tracks, m.Advisory]]:
    """Where somebody is in each picture, 0.2 s apart, and what the advisor makes of it.

    Two pictures show somebody tall and far ahead, then none does, while the boat turns by `until_rad` and back within
    the hold.
    """
    state, found = AdvisorState(), []
    yaws_rad = (0.0, 0.0, *np.linspace(0.0, until_rad, 6), *np.linspace(until_rad, 0.0, 6))
    for k, yaw_rad in enumerate(yaws_rad):
        at_us, true = T0_US + 200_000 * k, seen_box(BoatPose(0.0, 0.0, float(yaw_rad)), (100.0, 0.0), 10.0)
        pictured = [box(m.Label.PERSON, true)] if k < 2 else []
        frame = msgspec.structs.replace(seeing(*pictured), source_us=at_us, frame_seq=k)
        state, advisory, tracks = advise(state, frame, at_us, config, odometry(at_us, float(yaw_rad)))
        found.append((true, tracks, advisory))
    return found


@pytest.mark.parametrize("until_rad", [0.4, -0.4, 0.9])
def test_whoever_is_not_seen_stays_in_their_direction_while_the_boat_turns(until_rad: float) -> None:
    for true, tracks, advisory in turn_away_and_back(PAANI, until_rad):
        assert tracks.rotation is U.KNOWN
        if true[2] <= 0.0 or true[0] >= 1.0:
            assert (tracks.tracks, advisory.people_ahead) == ((), ())
        elif min(true) >= 0.0 and max(true) <= 1.0:
            (held,) = tracks.tracks
            assert np.abs(np.subtract(held.box_xyxy, true)).max() < 0.01
            if true[2] < 0.2 or true[0] > 0.8 or (true[0] > 0.31 and true[2] < 0.69):  # E3
                assert bool(advisory.people_ahead) == (true[2] > 0.2 and true[0] < 0.8)


def test_without_a_known_rotation_a_held_box_stays_in_the_picture() -> None:
    places = [[track.box_xyxy for track in tracks.tracks] for _, tracks, _ in turn_away_and_back(OFF, 0.9)]
    assert np.ptp(np.array(places), axis=0).max() < 1e-12


def test_whoever_the_boat_turned_away_from_counts_again_when_the_rotation_is_not_known_any_more() -> None:
    somebody, state, counted = box(m.Label.PERSON, (0.45, 0.4, 0.55, 0.6)), AdvisorState(), []
    for k, (yaw_rad, later_s) in enumerate(((0.0, 0.0), (0.0, 0.2), (1.5, 0.4), (1.5, 1.5))):
        at_us = T0_US + round(later_s * 1e6)
        frame = msgspec.structs.replace(seeing(*[somebody] * (k < 2)), source_us=at_us, frame_seq=k)
        heard = odometry(min(at_us, T0_US + 400_000), yaw_rad)  # nothing after that
        state, advisory, tracks = advise(state, frame, at_us, PAANI, heard)
        counted.append((tracks.rotation is U.KNOWN, len(tracks.tracks), bool(advisory.people_ahead)))
    assert counted[1:] == [(True, 1, True), (True, 0, False), (False, 1, True)]


@pytest.mark.parametrize("rate_radps", [0.5, -0.5])
@pytest.mark.parametrize("period_s", [0.2, 0.5])
def test_one_thing_is_one_obstacle_while_the_boat_turns(rate_radps: float, period_s: float) -> None:
    """Seen or held; left in the picture, each leaves an obstacle at every place that it was seen at."""
    assert max(len(frame.tracks) for frame in sweep(PAANI, rate_radps, period_s)) == 2
    assert max(len(frame.tracks) for frame in sweep(OFF, rate_radps, period_s)) > 2


@pytest.mark.parametrize("config", [PAANI, OFF])
def test_whoever_stands_ashore_stays_ashore_while_a_picture_misses_them_and_the_turn_is_known(config: Config) -> None:
    """Where they are in the picture is known then; unknown, whoever is held may be in the water."""
    angler = box(m.Label.PERSON, (0.47, 0.32, 0.52, 0.45))
    state, ahead = AdvisorState(), []
    for k, pictured in enumerate(((angler,), (angler,), ())):
        at_us = T0_US + 200_000 * k
        frame = msgspec.structs.replace(seeing(*pictured), water_edge=(0.55,) * 80, source_us=at_us, frame_seq=k)
        state, advisory, _ = advise(state, frame, at_us, config, odometry(at_us, 0.0))
        ahead.append(bool(advisory.people_ahead))
    assert ahead == [False, False, config is OFF]


@pytest.mark.parametrize("rate_radps", [0.5, -0.5])
def test_a_turn_of_the_boat_is_no_urgency(rate_radps: float) -> None:
    """H1 and H2 tell of the thing, not of the turn that brings it to the middle."""
    found = sweep(PAANI, rate_radps, 0.2, 1)
    assert max(track.urgency for frame in found for track in frame.tracks) < 0.2


def test_a_box_that_stays_where_the_odometry_says_that_it_left_keeps_its_identity_ambiguously() -> None:
    state, found = AdvisorState(), []
    for k, yaw_rad in enumerate((0.0, 0.5)):
        at_us = T0_US + 200_000 * k
        frame = msgspec.structs.replace(seeing(box(m.Label.BUOY, (0.4, 0.4, 0.5, 0.6))), source_us=at_us, frame_seq=k)
        state, _, tracks = advise(state, frame, at_us, PAANI, odometry(at_us, yaw_rad))
        found.append(tracks.tracks)
    assert [[track.id for track in tracks] for tracks in found] == [[1], [1]]
    assert found[1][0].motion_cause is m.MotionCause.AMBIGUOUS_ASSOCIATION


def test_g11_a_track_that_is_only_predicted_keeps_its_score_while_the_boat_turns() -> None:
    state, confidences = AdvisorState(), []
    for number, detections in enumerate(((BUOY_AHEAD,), (BUOY_AHEAD,), (), ())):
        at_us = T0_US + number * 200_000
        frame = msgspec.structs.replace(CLEAR, source_us=at_us, frame_seq=number, detections=detections)
        state, _, tracks = advise(state, frame, at_us, PAANI, odometry(at_us, 0.01 * number, 0.05))
        assert tracks.rotation is U.KNOWN
        confidences += [(track.held, track.confidence) for track in tracks.tracks]
    assert confidences == [(False, 0.8), (False, 0.8), (True, 0.8), (True, 0.8)]
