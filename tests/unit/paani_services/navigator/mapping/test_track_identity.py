"""A dynamic obstacle carries the advisor's track id, and neither its motion nor the plan depends on it."""

from __future__ import annotations

import msgspec
import pytest

from paani import messages as m
from paani_services.advisor.advise import AdvisorState, advise
from paani_services.navigator.avoidance.replanning import PlannerState, observe, replan
from paani_services.navigator.avoidance.rollout import GuidanceSetpoint
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle, find_dynamic_obstacles
from paani_services.navigator.mapping.observation import ObservationMemory, add_track_ids
from tests.synthetic_water import (
    AT_REST,
    CAMERA,
    CONFIG,
    PLANNER,
    START_US,
    detection_of,
    evidence,
    observe_from,
    odometry,
    water_edge_of,
)

PERIOD_US = 200_000
QUAY = m.Detection(label=m.Label.PIER, confidence=0.95, box_xyxy=(0.02, 0.30, 0.2, 0.42))
EMPTY = m.Detection(label=m.Label.PIER, confidence=0.99, box_xyxy=(0.5, 0.5, 0.5, 0.5))  # malformed: of no track


def swimmer(seconds: float) -> m.Detection:
    """One who swims across the bow from starboard, 5 m off."""
    y_m = -1.0 + 0.5 * seconds
    return detection_of((4.9, y_m - 0.25, 5.1, y_m + 0.25), 0.4)


def watch(frames: int, *, with_tracks: bool) -> tuple[PlannerState, m.Tracks, int]:
    """The planner's state of a boat at rest that watched a swimmer, the last tracks, and when that was."""
    advisor, planner, at_us = AdvisorState(), PlannerState(), START_US
    tracks = m.Tracks(source_us=0, frame_seq=0, frame_epoch=0)
    for k in range(frames):
        at_us = START_US + PERIOD_US * k
        for pose_us in (at_us - PERIOD_US // 2, at_us):
            planner = observe(planner, odometry(pose_us, AT_REST), None, PLANNER)
        measurements = evidence(at_us, water_edge_of(AT_REST), detections=(EMPTY, QUAY, swimmer(k * PERIOD_US * 1e-6)))
        planner = observe(
            planner, None, measurements, PLANNER, tracks if with_tracks else None
        )  # those of the frame before
        advisor, _, tracks = advise(advisor, measurements, at_us, CONFIG)
        planner = observe(planner, None, measurements, PLANNER, tracks if with_tracks else None)
    return planner, tracks, at_us


def person_of(tracks: m.Tracks) -> m.Track:
    (person,) = (track for track in tracks.tracks if track.label is m.Label.PERSON)
    return person


def obstacles_of(state: PlannerState, now_us: int) -> tuple[DynamicObstacle, ...]:
    return find_dynamic_obstacles(state.memory.observations, now_us, CAMERA, PLANNER)


def test_an_obstacle_carries_the_id_of_the_advisors_track() -> None:
    state, tracks, now_us = watch(16, with_tracks=True)
    person = person_of(tracks)
    assert person.detection_number == 3  # of the evidence, malformed boxes counted
    (obstacle,) = obstacles_of(state, now_us)
    assert obstacle.is_moving
    assert obstacle.track_id == person.id > 0


@pytest.mark.slow
def test_the_planner_reports_the_tracks_that_it_planned_for() -> None:
    with_ids, tracks, now_us = watch(16, with_tracks=True)
    without, _, _ = watch(16, with_tracks=False)
    setpoint, here = GuidanceSetpoint(0.0, 0.6), odometry(now_us, AT_REST)
    with_ids, plan = replan(with_ids, here, setpoint, now_us, CAMERA, PLANNER)
    without, same_plan = replan(without, here, setpoint, now_us, CAMERA, PLANNER)
    assert (with_ids.obstacle_track_ids, without.obstacle_track_ids) == ((person_of(tracks).id,), ())
    assert plan == same_plan


def test_motion_does_not_depend_on_the_id() -> None:
    state, _, now_us = watch(16, with_tracks=True)
    unlabelled, _, _ = watch(16, with_tracks=False)
    (one,), (other,) = obstacles_of(state, now_us), obstacles_of(unlabelled, now_us)
    assert (one.velocity, one.age_s, one.vacated_boxes) == (other.velocity, other.age_s, other.vacated_boxes)
    assert other.track_id == 0


@pytest.mark.parametrize(
    "changes", [{"frame_seq": 1}, {"frame_epoch": 2}, {"tracks": ()}], ids=["other-frame", "other-epoch", "no-tracks"]
)
def test_tracks_of_another_frame_label_nothing(changes: dict[str, object]) -> None:
    measurements = evidence(START_US, water_edge_of(AT_REST), detections=(swimmer(0.0),))
    memory = observe_from(at_us=START_US, memory=ObservationMemory(), detections=measurements.detections)
    _, _, tracks = advise(AdvisorState(), measurements, START_US, CONFIG)
    assert add_track_ids(memory, measurements, tracks).observations[-1].box_track_ids == (tracks.tracks[0].id,)
    labelled = add_track_ids(memory, measurements, msgspec.structs.replace(tracks, **changes)).observations[-1]
    assert not any(labelled.box_track_ids)
    assert add_track_ids(memory, None, tracks) is memory
    assert add_track_ids(memory, measurements, None) is memory


def test_a_held_track_names_no_detection() -> None:
    """Its number would be that of whatever is detected there."""
    measurements = evidence(START_US, water_edge_of(AT_REST), detections=(swimmer(0.0),))
    state, _, _ = advise(AdvisorState(), measurements, START_US, CONFIG)
    clear = msgspec.structs.replace(
        measurements, source_us=START_US + PERIOD_US, frame_seq=measurements.frame_seq + 1, detections=()
    )
    _, _, tracks = advise(state, clear, START_US + PERIOD_US, CONFIG)
    assert [(track.held, track.detection_number) for track in tracks.tracks] == [(True, 0)]
