"""Whoever was seen to be a person stays one, wherever the boat looks and whatever the detector calls them next."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani_services.advisor.advise import AdvisorState, advise, is_well_formed
from paani_services.advisor.risk import foot_range_m, nearest_range_m
from tests.unit.paani_services.advisor.advisor_evidence import CALIBRATED, CLEAR, PAANI, T0_US, box, play, seeing

AHEAD = (0.47, 0.42, 0.53, 0.50)
LAND = m.LaneEvidence(non_water=1.0, uncertainty=0.8, clear_width=0.0)
ASHORE = msgspec.structs.replace(CLEAR, left=LAND, center=LAND, right=LAND)
FRAME_US = 200_000


@given(st.sampled_from([m.Label.BUOY, m.Label.VESSEL, m.Label.PIER]), st.floats(0.41, 1.0), st.integers(1, 5))
def test_a_person_who_is_taken_for_something_else_blocks_the_way_as_one_who_is_not_seen(
    label: m.Label, confidence: float, pictures: int
) -> None:
    seen = [seeing(box(m.Label.PERSON, AHEAD, 0.9))] * 5
    other, unseen = (
        play([*seen, *[frame] * pictures], CALIBRATED)[1][-1]
        for frame in (seeing(box(label, AHEAD, confidence)), seeing())
    )
    assert unseen.people_ahead == other.people_ahead != ()
    assert other.direction is not m.Direction.STRAIGHT
    assert not isinstance(other.speed_limit_mps, msgspec.UnsetType)
    assert not isinstance(unseen.speed_limit_mps, msgspec.UnsetType)
    assert other.speed_limit_mps <= unseen.speed_limit_mps


def test_a_person_who_is_called_nothing_but_a_buoy_becomes_one() -> None:
    hold = round(CALIBRATED.advisor.tracker.hold_s * 1e6 / FRAME_US)
    frames = [seeing(box(m.Label.PERSON, AHEAD, 0.9))] * 2 + [seeing(box(m.Label.BUOY, AHEAD, 0.9))] * (hold + 1)
    advice = play(frames, CALIBRATED)[1]
    assert advice[-3].people_ahead
    assert not advice[-1].people_ahead


@pytest.mark.parametrize("height_m", [0.9, 0.95, 1.5, 5.0])
def test_somebody_cut_by_the_lower_edge_may_be_anywhere_nearer(height_m: float) -> None:
    """Whatever the camera's height: near fans nothing is kept, and the boat stops for who is before the bow."""
    calibration = msgspec.structs.replace(CALIBRATED.calibration, height_m=height_m)
    config = msgspec.structs.replace(CALIBRATED, calibration=calibration)
    swimmer = box(m.Label.PERSON, (0.3, 0.6, 0.7, 1.0), 0.9)
    frames = [msgspec.structs.replace(ASHORE, detections=(swimmer,))] * 3
    advisory = play(frames, config)[1][-1]
    assert (advisory.direction, advisory.may_keep_station) == (m.Direction.STOP, msgspec.UNSET)
    assert "swimmer ahead close by" in advisory.explanation
    assert play([seeing(swimmer)] * 3, config)[1][-1].direction is m.Direction.STOP


@given(st.floats(0.0, 1.0))
def test_no_foot_is_farther_than_where_it_is_seen(bottom: float) -> None:
    at = (0.4, 0.0, 0.6, bottom)
    seen_m, nearest_m = (
        foot_range_m(at, 4 / 3, CALIBRATED.calibration),
        nearest_range_m(at, 4 / 3, CALIBRATED.calibration),
    )
    assert seen_m is not None
    assert nearest_m is not None
    assert 0.0 <= nearest_m <= seen_m
    assert (nearest_m == 0.0) is (bottom >= 0.99)


def test_somebody_whom_the_boat_has_turned_away_from_is_still_near() -> None:
    swimmer = box(m.Label.PERSON, (0.80, 0.6, 0.98, 0.985), 0.9)
    state, keeps = AdvisorState(), []
    for number in range(5):
        at_us = T0_US + number * FRAME_US
        odometry = m.Odometry(
            source_us=at_us, x_m=0.0, y_m=0.0, yaw_rad=0.0 if number < 2 else 0.7, surge_mps=0.0, healthy=True
        )
        detections = (swimmer,) if number < 2 else ()
        frame = msgspec.structs.replace(ASHORE, source_us=at_us, frame_seq=number, detections=detections)
        state, advisory, _ = advise(state, frame, at_us + 50_000, CALIBRATED, odometry)
        keeps.append(advisory.may_keep_station)
    assert any(track.is_out_of_view for track in state.tracker.tracks)
    assert keeps == [msgspec.UNSET] * 5


def test_a_person_of_the_first_instant_is_remembered_as_any_other() -> None:
    state, seen = AdvisorState(), []
    for number, label in enumerate((m.Label.PERSON, m.Label.BUOY, m.Label.BUOY)):
        frame = msgspec.structs.replace(seeing(box(label, AHEAD, 0.9)), source_us=number * FRAME_US, frame_seq=number)
        state, advisory, _ = advise(state, frame, frame.source_us, PAANI)
        seen.append(advisory.people_ahead)
    assert seen == [(1,)] * 3


def test_nobody_is_forgotten_for_more_boxes_than_are_kept() -> None:
    """Neither somebody seen a moment ago, nor the least sure box of a picture."""
    kept = PAANI.advisor.tracker.max_tracks
    things = [(0.01 + 0.04 * (i % 24), 0.52 + 0.1 * (i // 24)) for i in range(kept)]
    crowd = [box(m.Label.BUOY, (x, y, x + 0.01, y + 0.02), 0.9) for x, y in things]
    swimmer = box(m.Label.PERSON, AHEAD, 0.5)
    for frames in ([seeing(swimmer)] * 2 + [seeing(*crowd)], [seeing(*crowd, swimmer)]):
        _, advice, tracks = play(frames)
        assert advice[-1].people_ahead
        assert len(tracks[-1].tracks) == kept


@pytest.mark.parametrize(("width_px", "height_px"), [(0, 240), (320, 0)])
def test_a_picture_without_a_size_tells_no_distance_and_stops_the_boat(width_px: int, height_px: int) -> None:
    frame = msgspec.structs.replace(CLEAR, width_px=width_px, height_px=height_px)
    advisory = play([CLEAR, frame], CALIBRATED)[1][-1]
    assert (advisory.direction, advisory.reason) == (m.Direction.STOP, m.Reason.MALFORMED_EVIDENCE)


@pytest.mark.parametrize("spoilt", [float("nan"), 1.5, -0.1])
def test_every_fraction_of_the_evidence_is_asked_for(spoilt: float) -> None:
    assert is_well_formed(CLEAR)
    narrow = msgspec.structs.replace(CLEAR.center, open_width=spoilt)
    assert not is_well_formed(msgspec.structs.replace(CLEAR, center=narrow))
    assert not is_well_formed(msgspec.structs.replace(CLEAR, water_edge=(0.5, spoilt)))
