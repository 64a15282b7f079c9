"""Views that no boat has are unusable by their cause, and a swimmer's close-up is usable."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from paani.arrays import F32, U8
from paani.clock import stopwatch_ms
from paani.config import PerceptionConfig, load_config
from paani.messages import BoxXyxy, CandidateKind, Detection, Evidence, Label, PictureHeader, UnusableCause
from paani.picture_faults import apply_fault
from paani_services.perception.pipeline import Perceiver
from paani_services.perception.view import judge_view
from tests.pictures import river

PICTURES = Path(__file__).parents[4] / "examples" / "pictures"
CONFIG = load_config().perception
DOUBTING = msgspec.structs.replace(CONFIG.image_quality, min_fitness=1.0, sure_fitness=1.0)  # every picture
ROWS, COLUMNS = 64, 80
VISIBLE = np.ones((ROWS, COLUMNS), np.float32)
NONE, UNFIT = UnusableCause.NONE, UnusableCause.UNFIT
WATER, OBSTACLE, SKY = 0, 1, 2
SWIMMER = (0.45, 0.45, 0.55, 0.60)


def view(
    mask: U8,
    cause: UnusableCause = NONE,
    box: BoxXyxy | None = None,
    sure: float = 0.9,
    visible: F32 = VISIBLE,
    *,
    was_filled: bool = False,
) -> UnusableCause:
    people = () if box is None else (Detection(label=Label.PERSON, confidence=0.6, box_xyxy=box),)
    confidence = np.full(mask.shape, sure, np.float32)
    quality = CONFIG.image_quality
    return judge_view(cause, mask, confidence, visible, people, CONFIG.corridors, quality, was_filled=was_filled)


def below(row: int) -> U8:
    """Water below a row of the mask, obstacle above."""
    mask = np.full((ROWS, COLUMNS), OBSTACLE, np.uint8)
    mask[row:] = WATER
    return mask


@pytest.mark.parametrize("row", [1, 20, 40, 62])
def test_water_below_something_is_a_boat_s_view(row: int) -> None:
    assert view(below(row)) is NONE


def test_land_that_fills_the_picture_is_named() -> None:
    assert view(below(ROWS)) is UnusableCause.NO_WATER
    puddle = below(ROWS)
    puddle[60:63, 40:55] = WATER  # 45 cells of 5,120
    assert view(puddle) is UnusableCause.NO_WATER
    puddle[60:64, 40:55] = WATER
    assert view(puddle) is NONE
    hidden = VISIBLE.copy()
    hidden[60:, 40:55] = 0.0  # what shows there is the own hull
    assert view(puddle, visible=hidden) is UnusableCause.NO_WATER


def test_water_to_the_top_is_seen_from_above_or_has_no_horizon() -> None:
    endless = below(0)
    assert view(endless) is UnusableCause.NO_HORIZON
    endless[0, :5] = OBSTACLE
    assert view(endless) is NONE


def test_a_swimmer_near_in_the_centre_wins_over_doubt_and_over_the_view() -> None:
    pool = below(0)
    assert view(below(20), UNFIT) is UNFIT
    assert view(below(20), UNFIT, SWIMMER) is NONE
    assert view(pool, UNFIT, SWIMMER) is NONE
    assert view(pool, NONE, SWIMMER) is NONE


@pytest.mark.parametrize(
    ("box", "sure", "row"),
    [
        (SWIMMER, 0.7, 20),  # the mask is not sure of the water
        ((0.45, 0.45, 0.55, 0.54), 0.9, 20),  # small
        ((0.05, 0.45, 0.15, 0.60), 0.9, 20),  # beside the way, which would be straight on
        (SWIMMER, 0.9, 40),  # on the bank
        (SWIMMER, 0.9, ROWS),  # ashore
        ((0.45, 0.10, 0.55, 0.29), 0.9, 0),  # above the corridors
    ],
)
def test_doubt_stays_without_a_near_swimmer_in_water_that_is_sure(box: BoxXyxy, sure: float, row: int) -> None:
    assert view(below(row), UNFIT, box, sure) is UNFIT


@pytest.mark.parametrize(("lost_rows", "cause"), [(1, NONE), (2, UNFIT)])
def test_four_fifths_of_what_is_beside_a_swimmer_must_be_water(lost_rows: int, cause: UnusableCause) -> None:
    """Of the five rows beside the lower half of somebody, one may be foam and no more."""
    mask = below(20)
    rows = slice(math.ceil(SWIMMER[3] * ROWS) - 5, math.ceil(SWIMMER[3] * ROWS) - 5 + lost_rows)
    mask[rows, math.ceil(SWIMMER[2] * COLUMNS) :] = OBSTACLE
    assert view(mask, UNFIT, (SWIMMER[0], 29 / ROWS, *SWIMMER[2:])) is cause


@example(COLUMNS // 2, 1, UNFIT, True)
@given(st.integers(0, COLUMNS), st.integers(1, ROWS), st.sampled_from(UnusableCause), st.booleans())
def test_an_unfit_picture_that_an_obstacle_fills_as_the_one_before_is_named_and_counts_for_nothing(
    columns: int, row: int, cause: UnusableCause, was_filled: bool
) -> None:
    """Up to the upper edge in half of its columns and more; whatever else is wrong with a picture stays its cause."""
    hull = below(row)
    hull[0, columns:] = SKY
    judged = view(hull, cause, was_filled=was_filled)
    if cause is not NONE:
        is_named = cause is UNFIT and was_filled and columns >= COLUMNS / 2
        assert judged is (UnusableCause.FILLED if is_named else cause)
    assert (judged is NONE) <= (cause is NONE)


def perceive(
    config: PerceptionConfig, *pictures: U8, epochs: tuple[int, ...] = (), age_s: float = 0.0
) -> list[tuple[Evidence, U8 | None]]:
    """What one pipeline makes of pictures that come one after the other, by default all of one epoch."""
    perceiver, found = Perceiver(config, stopwatch_ms), []
    try:
        for seq, (picture, epoch) in enumerate(zip(pictures, epochs or (1,) * len(pictures), strict=True)):
            header = PictureHeader(source_us=1 + seq, frame_seq=seq, frame_epoch=epoch, width_px=320, height_px=240)
            found.append(perceiver.perceive(picture, header, age_s))
    finally:
        perceiver.close()
    return found


def causes_of(config: PerceptionConfig, *pictures: U8, epochs: tuple[int, ...] = ()) -> list[UnusableCause]:
    return [evidence.cause for evidence, _ in perceive(config, *pictures, epochs=epochs)]


@pytest.mark.slow
def test_the_pipeline_names_the_view_and_gives_no_mask() -> None:
    """A limit that no picture meets makes any view one without water."""
    quality = msgspec.structs.replace(CONFIG.image_quality, min_water=1.0)
    [(evidence, mask)] = perceive(msgspec.structs.replace(CONFIG, image_quality=quality), river())
    assert (evidence.usable, evidence.cause, mask) == (False, UnusableCause.NO_WATER, None)
    assert evidence.detections == ()
    assert evidence.center.non_water == 1.0


@pytest.mark.slow
def test_a_doubted_picture_without_a_swimmer_stays_refused_and_one_that_repeats_itself_is_frozen() -> None:
    causes = causes_of(msgspec.structs.replace(CONFIG, image_quality=DOUBTING), *[river()] * 4)
    assert causes == [UNFIT, UNFIT, UnusableCause.FROZEN, UnusableCause.FROZEN]


@pytest.mark.slow
def test_a_picture_is_filled_only_where_the_one_before_was() -> None:
    """A pontoon fills a fit picture, and then one that is unfit; beside a camera that breaks from one to the next."""
    hull, river_view = read_picture("pontoon"), read_picture("clear_water")
    unfit = apply_fault("blur", hull, np.zeros(hull.shape[:2], np.uint8), 3, np.random.default_rng(0))[0]
    black = np.zeros_like(hull)
    filled, broken = UnusableCause.FILLED, UnusableCause.BLACK
    assert causes_of(CONFIG, hull, unfit, unfit, hull, unfit) == [NONE, filled, filled, NONE, filled]
    assert causes_of(CONFIG, unfit, unfit, epochs=(1, 2)) == [UNFIT, UNFIT]
    assert causes_of(CONFIG, hull, unfit, epochs=(1, 2)) == [NONE, UNFIT]
    assert causes_of(CONFIG, hull, river_view, unfit) == [NONE, NONE, UNFIT]
    assert causes_of(CONFIG, hull, black, unfit) == [NONE, broken, UNFIT]


@pytest.mark.parametrize("asks", [True, False])
@pytest.mark.slow
def test_a_doubted_picture_is_looked_at_for_people_and_no_other_unusable_one_is(asks: bool) -> None:
    """A detector's person is a candidate of it, the vessel beside is none; whoever asks for none is told of none."""
    looks = msgspec.structs.replace(CONFIG, candidates=msgspec.structs.replace(CONFIG.candidates, use=asks))
    doubting, picture = msgspec.structs.replace(looks, image_quality=DOUBTING), read_picture("boat_ahead")
    [(fit, _)], [(doubted, _)] = perceive(looks, picture), perceive(doubting, picture)
    [(stale, _)] = perceive(doubting, picture, age_s=9.0)
    people = [each for each in fit.detections if each.label is Label.PERSON]
    assert people
    assert len(people) < len(fit.detections)
    assert (doubted.cause, doubted.detections) == (UNFIT, ())
    assert (stale.cause, stale.candidates) == (UnusableCause.STALE, msgspec.UNSET)
    if not asks:
        assert doubted.candidates is msgspec.UNSET
        return
    assert not isinstance(doubted.candidates, msgspec.UnsetType)
    assert not isinstance(fit.candidates, msgspec.UnsetType)
    boxes = [each.box_xyxy for each in people] + [each.box_xyxy for each in fit.candidates]
    assert [each.box_xyxy for each in doubted.candidates] == boxes
    assert {each.kind for each in doubted.candidates[: len(people)]} == {CandidateKind.UNSURE_BOX}


def read_picture(name: str) -> U8:
    return np.asarray(cv2.imread(str(PICTURES / f"{name}.jpg")), np.uint8)
