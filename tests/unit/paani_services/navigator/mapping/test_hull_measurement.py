"""Where a hull is: by its waterline, and by a box of its size."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from paani.messages import Detection, Label
from paani_services.navigator.mapping.box_measurement import measure_positions
from paani_services.navigator.mapping.dynamic_obstacles import find_dynamic_obstacles
from paani_services.navigator.mapping.observation import ObservationMemory
from tests.synthetic_water import AT_REST, CAMERA, PLANNER, START_US, detection_of, observe_from, water_edge_of

BOW_HALF_M, HIGH_M = 1.0, 1.8


def bow_at(ahead_m: float, label: Label = Label.VESSEL, wider: float = 0.0, lower: float = 0.0) -> Detection:
    """The box of a bow that far ahead, wider on each side and lower by these shares of its size."""
    box = detection_of((ahead_m, -BOW_HALF_M, ahead_m + 0.3, BOW_HALF_M), HIGH_M, label)
    x1, y1, x2, y2 = box.box_xyxy
    aside, below = wider * (x2 - x1), lower * (y2 - y1)
    return msgspec.structs.replace(box, box_xyxy=(x1 - aside, y1, x2 + aside, y2 + below))


def seen_at(
    ahead_m: float, box: Detection, at_us: int = START_US, memory: ObservationMemory | None = None
) -> ObservationMemory:
    """The memory with a picture of a long hull that far ahead, which this box is around."""
    hull = (ahead_m, -BOW_HALF_M, ahead_m + 10.0, BOW_HALF_M)
    edge = water_edge_of(AT_REST, (hull,))
    return observe_from(edge=edge, at_us=at_us, memory=memory or ObservationMemory(), detections=(box,))


def measured_m(memory: ObservationMemory) -> list[float]:
    """How far ahead the boxes of the newest picture are measured."""
    picture = measure_positions(memory.observations[-1], CAMERA, PLANNER.mover_range_m)
    return [each.position_m[0] for each in picture.measurements]


@pytest.mark.parametrize("ahead_m", [5.0, 7.0, 9.0])
def test_a_box_that_is_wider_than_its_hull_is_measured_at_the_hull(ahead_m: float) -> None:
    """At its ends the mask shows the water beside the hull, as far as the horizon."""
    (found_m,) = measured_m(seen_at(ahead_m, bow_at(ahead_m, wider=0.1, lower=0.1)))
    assert found_m == pytest.approx(ahead_m, abs=0.1 * ahead_m)


def test_the_end_of_a_hull_that_the_picture_cuts_stays_where_it_is() -> None:
    """Its motion is that of the end in sight: one that is taken to be nearer in some pictures would move."""
    hull = bow_at(6.0, wider=0.1)
    x1, y1, x2, y2 = hull.box_xyxy
    low = msgspec.structs.replace(hull, box_xyxy=(x1, y1, x2, y2 + 0.1))
    cut = msgspec.structs.replace(low, box_xyxy=(0.0, *low.box_xyxy[1:]))
    ends_m, beside = [], 0.5 * (y1 + y2 + 0.1) + 0.01
    for box in (low, cut):
        edge = tuple(beside if u > x2 - 0.15 * (x2 - x1) else y2 for u in (np.arange(80) + 0.5) / 80)
        memory = observe_from(edge=edge, detections=(box,))
        (picture,) = measure_positions(memory.observations[-1], CAMERA, 60.0).measurements
        ends_m.append(float(picture.outline[0][-1]) - float(picture.outline[0][-2]))
    assert ends_m[0] == pytest.approx(0.0, abs=0.1)
    assert ends_m[1] > 2.0


def test_what_is_as_wide_as_a_hull_stands_where_the_mask_ends_the_water() -> None:
    """Its box reaches down its reflection; the mask is not asked about people, and about what is narrow."""
    for label, is_by_mask in ((Label.VESSEL, True), (Label.BUOY, True), (Label.PERSON, False)):
        (found_m,) = measured_m(seen_at(8.0, bow_at(8.0, label, lower=0.3)))
        assert (found_m > 7.0) is is_by_mask, label
    narrow = detection_of((8.0, -0.15, 8.3, 0.15), HIGH_M, Label.BUOY)
    x1, y1, x2, y2 = narrow.box_xyxy
    low = msgspec.structs.replace(narrow, box_xyxy=(x1, y1, x2, y2 + 0.3 * (y2 - y1)))
    assert measured_m(seen_at(8.0, low))[0] < 7.0


def test_what_is_twice_as_wide_is_another_obstacle() -> None:
    """A buoy comes and is lost from sight where a wider thing comes into it: no obstacle is both."""
    memory, at_us, halves_m = ObservationMemory(), START_US, (0.3,) * 6 + (0.7,) * 6
    for number, half_m in enumerate(halves_m):
        at_us, ahead_m = START_US + 200_000 * number, 6.0 - 0.15 * number
        box = detection_of((ahead_m, -half_m, ahead_m + 0.3, half_m), 1.0, Label.BUOY)
        memory = observe_from(at_us=at_us, memory=memory, detections=(box,))
    found = find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)
    for each in found:
        assert len({halves_m[(stamp_us - START_US) // 200_000] for stamp_us, _ in each.vacated_boxes}) == 1
    assert len(found) == 2


@pytest.mark.parametrize("speed_mps", [2.2, 3.0])
def test_a_barge_is_known_to_come_before_it_is_near(speed_mps: float) -> None:
    """From 18 m off, by boxes whose lower end is up to a tenth of their height too low, at random, within 2.4 s."""
    memory, at_us, rng = ObservationMemory(), START_US, np.random.default_rng(4)
    for number in range(13):
        at_us, ahead_m = START_US + 200_000 * number, 18.0 - 0.2 * speed_mps * number
        box = bow_at(ahead_m, wider=0.05, lower=float(rng.uniform(0.0, 0.1)))
        memory = seen_at(ahead_m, box, at_us, memory)
    (found,) = find_dynamic_obstacles(memory.observations, at_us, CAMERA, PLANNER)
    assert found.velocity.east_mps == pytest.approx(-speed_mps, rel=0.3)
