"""What may be a person: unsure boxes that stand in water, and obstacles that the water surrounds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.arrays import F32, U8
from paani.config import CandidateConfig, DetectorConfig
from paani.messages import BoxXyxy, CandidateKind, Detection, Label
from paani_services.perception.box_decoding import decode_people
from paani_services.perception.candidates import (
    find_candidates,
    find_lone_obstacles,
    is_large_enough,
    is_reflection,
    stands_in_water,
)
from paani_services.perception.preprocessing import LetterboxTransform

RULES = CandidateConfig()
ROWS, COLUMNS = 64, 80
VISIBLE = np.ones((ROWS, COLUMNS), np.float32)
SURE = np.full((ROWS, COLUMNS), 0.9, np.float32)
WATER, OBSTACLE, SKY = 0, 1, 2
SHORE_ROW = 24


def lake(*things: tuple[int, int, int, int]) -> U8:
    """Sky, shore, and water with obstacles at rows and columns (top, left, bottom, right)."""
    mask = np.full((ROWS, COLUMNS), WATER, np.uint8)
    mask[:16], mask[16:SHORE_ROW] = SKY, OBSTACLE
    for top, left, bottom, right in things:
        mask[top:bottom, left:right] = OBSTACLE
    return mask


def person(box: BoxXyxy, confidence: float = 0.3) -> Detection:
    return Detection(label=Label.PERSON, confidence=confidence, box_xyxy=box)


def lone(mask: U8, visible: F32 = VISIBLE) -> list[BoxXyxy]:
    return [found.box_xyxy for found in find_lone_obstacles(mask, SURE, visible, RULES.min_cells)]


@given(st.integers(SHORE_ROW + 1, 56), st.integers(0, 70), st.integers(2, 7), st.integers(2, 9))
def test_what_the_water_surrounds_is_found_where_it_is(top: int, left: int, height: int, width: int) -> None:
    found = find_lone_obstacles(lake((top, left, top + height, left + width)), SURE, VISIBLE, RULES.min_cells)
    assert [c.kind for c in found] == [CandidateKind.LONE_OBSTACLE]
    box = (left / COLUMNS, top / ROWS, (left + width) / COLUMNS, (top + height) / ROWS)
    assert found[0].box_xyxy == pytest.approx(box)
    assert found[0].confidence == pytest.approx(0.9)


@pytest.mark.parametrize(
    "thing",
    [
        (SHORE_ROW, 30, 40, 36),  # a jetty from the shore
        (50, 30, ROWS, 50),  # what the boat itself carries
        (40, 0, 42, COLUMNS),  # from side to side
        (40, 30, 41, 33),  # three cells
    ],
)
def test_what_belongs_to_the_shore_or_the_boat_and_specks_are_nothing(thing: tuple[int, int, int, int]) -> None:
    assert lone(lake(thing)) == []


def test_what_hangs_from_the_top_of_the_picture_does_not_stand_alone() -> None:
    mask = np.full((ROWS, COLUMNS), WATER, np.uint8)
    mask[:20, 30:36] = OBSTACLE
    assert lone(mask) == []
    mask[0] = WATER
    assert len(lone(mask)) == 1


def test_own_hull_is_no_obstacle() -> None:
    visible = VISIBLE.copy()
    visible[44:50, 36:44] = 0.0
    assert lone(lake((44, 36, 50, 44)), visible) == []
    assert lone(lake((44, 36, 50, 44))) != []


def test_an_unsure_box_counts_where_it_stands_in_water() -> None:
    mask = lake((36, 36, 42, 40))
    in_water, on_shore = (0.45, 0.55, 0.52, 0.68), (0.45, 0.20, 0.52, 0.36)
    assert stands_in_water(mask, in_water, RULES.water_share)
    assert not stands_in_water(mask, on_shore, RULES.water_share)
    found = find_candidates(mask, SURE, VISIBLE, (person(in_water), person(on_shore)), (), RULES)
    assert [(c.kind, c.box_xyxy) for c in found] == [(CandidateKind.UNSURE_BOX, in_water)]


@pytest.mark.parametrize(("gap", "is_in_water"), [(0, False), (2, False), (3, True)])
def test_water_is_looked_for_three_cells_beside_and_below_a_box(gap: int, *, is_in_water: bool) -> None:
    box, above = (40 / COLUMNS, 32 / ROWS, 44 / COLUMNS, 40 / ROWS), (SHORE_ROW + 2, 36)
    for pier in ((above[0], 44 + gap, ROWS, 70), (above[0], 10, ROWS, 40 - gap), (40 + gap, 20, ROWS, 60)):
        assert stands_in_water(lake(pier), box, RULES.water_share) is is_in_water


@pytest.mark.parametrize(
    ("box", "may_be_somebody"),
    [
        ((0.4, 0.79, 0.5, 0.799), True),  # farther off, somebody may be as small as that
        ((0.4, 0.79, 0.5, 0.80), False),
        ((0.4, 0.74, 0.5, 0.80), False),
        ((0.4, 0.73, 0.5, 0.80), True),
        ((0.4, 0.94, 0.5, 1.0), False),
    ],
)
def test_before_the_bow_nobody_is_smaller_than_a_head(box: BoxXyxy, *, may_be_somebody: bool) -> None:
    assert is_large_enough(box) is may_be_somebody


def test_who_is_detected_is_no_candidate_as_well() -> None:
    mask, box = lake((36, 36, 42, 40)), (0.44, 0.55, 0.51, 0.68)
    detected = (person(box, 0.8),)
    assert find_candidates(mask, SURE, VISIBLE, (person(box, 0.8),), detected, RULES) == ()
    vessel = (Detection(label=Label.VESSEL, confidence=0.8, box_xyxy=box),)
    assert len(find_candidates(mask, SURE, VISIBLE, (), vessel, RULES)) == 1


def test_small_things_before_the_bow_are_glints() -> None:
    glint, swimmer = (55, 30, 58, 33), (52, 30, 58, 36)
    assert find_candidates(lake(glint), SURE, VISIBLE, (), (), RULES) == ()
    assert len(find_candidates(lake(swimmer), SURE, VISIBLE, (), (), RULES)) == 1
    assert len(find_candidates(lake((40, 30, 43, 33)), SURE, VISIBLE, (), (), RULES)) == 1


def test_the_most_confident_are_handed_on() -> None:
    mask = lake(*((30, left, 33, left + 2) for left in range(2, 78, 4)))
    confidence = SURE * np.linspace(0.5, 1.0, COLUMNS, dtype=np.float32)
    found = find_candidates(mask, confidence, VISIBLE, (), (), RULES)
    assert len(found) == RULES.max_count
    assert [c.confidence for c in found] == sorted((c.confidence for c in found), reverse=True)
    assert min(c.box_xyxy[0] for c in found) > 0.3


def test_no_number_of_lone_obstacles_hides_who_may_be_a_person() -> None:
    """However sure the mask is of them: it says that they are no water, not that they are somebody."""
    mask = lake(*((30, left, 33, left + 2) for left in range(2, 78, 4)))
    unsure = person((0.45, 0.72, 0.52, 0.85), 0.16)
    found = find_candidates(mask, SURE, VISIBLE, (unsure,), (), RULES)
    assert len(found) == RULES.max_count
    assert found[0].box_xyxy == unsure.box_xyxy


def test_people_are_decoded_by_their_own_score_with_their_own_threshold() -> None:
    rows = np.array([[100, 100, 40, 40, 0.2, 0.7, 0, 0], [200, 100, 40, 40, 0.1, 0, 0, 0]], np.float32).T[None]
    place = LetterboxTransform(1.0, 1.0, 0, 0, 320, 256)
    found = decode_people(rows, place, DetectorConfig(), 0.15)
    assert [(d.label, round(d.confidence, 3), round(d.box_xyxy[0] * 320)) for d in found] == [(Label.PERSON, 0.2, 80)]
    assert decode_people(rows, place, DetectorConfig(), 0.15, ("vessel", "person")) != found
    assert decode_people(rows, place, DetectorConfig(), 0.15, ("vessel", "pier", "buoy", "raft")) == ()


BOX = (0.30, 0.60, 0.45, 0.75)


@pytest.mark.parametrize(
    ("detection", "things", "is_it"),
    [
        (person(BOX, 0.69), (), True),
        (person(BOX, 0.70), (), False),  # as sure as the detector is of people in water that the mask missed
        (person(BOX, 0.69), ((44, 30, 45, 31),), False),  # the mask shows a single cell of somebody
        (person((0.30, 0.60, 0.45, 0.699), 0.69), (), False),  # so small that the mask may miss them
        (person((0.30, 0.30, 0.45, 0.45), 0.69), (), False),  # partly before the shore
        (Detection(label=Label.VESSEL, confidence=0.5, box_xyxy=BOX), (), False),
    ],
)
def test_somebody_large_and_unsure_whom_the_mask_does_not_show_at_all_is_a_reflection(
    detection: Detection, things: tuple[tuple[int, int, int, int], ...], *, is_it: bool
) -> None:
    assert is_reflection(lake(*things), detection, RULES) is is_it


@given(
    st.floats(0.0, 0.9),
    st.floats(0.4, 0.85),
    st.floats(0.02, 0.5),
    st.floats(0.1, 0.5),
    st.integers(0, ROWS * COLUMNS - 1),
)
def test_whoever_has_a_cell_of_the_mask_is_no_reflection(
    left: float, top: float, width: float, height: float, cell: int
) -> None:
    box = (left, top, min(1.0, left + width), min(1.0, top + height))
    mask = np.full((ROWS, COLUMNS), WATER, np.uint8)
    mask[cell // COLUMNS, cell % COLUMNS] = OBSTACLE
    row, column = cell // COLUMNS + 0.5, cell % COLUMNS + 0.5
    is_inside = box[0] * COLUMNS < column < box[2] * COLUMNS and box[1] * ROWS < row < box[3] * ROWS
    assert not (is_inside and is_reflection(mask, person(box, 0.5), RULES))
