"""Severity, overlap, combination and the risk equation."""

from __future__ import annotations

import math

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import CalibrationConfig, Config, EyeConfig, RiskConfig, calibration_of, load_config
from paani.messages import BoxXyxy
from paani_services.advisor.risk import (
    corridor_risk,
    foot_by_mask,
    noisy_or,
    overlap,
    range_weight,
    severity,
    stands_ashore,
)
from tests.unit.paani_services.advisor.advisor_evidence import BUOY_AHEAD, CLEAR, PAANI, PAPER, box, play, seeing

UNIT = st.floats(0.0, 1.0)
BOX = st.tuples(UNIT, UNIT, UNIT, UNIT).map(
    lambda v: (min(v[0], v[2]), min(v[1], v[3]), max(v[0], v[2]), max(v[1], v[3]))
)


def test_j4_by_hand() -> None:
    """J4: 0.55*0.2 + 0.65*0.3 + 0.20*0.4 + 0.15*0.5 = 0.11 + 0.195 + 0.08 + 0.075 = 0.46."""
    assert corridor_risk(0.2, 0.3, 0.4, 0.5, RiskConfig()) == pytest.approx(0.46, abs=1e-12)
    assert corridor_risk(1.0, 1.0, 1.0, 1.0, RiskConfig()) == 1.0
    assert corridor_risk(0.0, 0.0, 0.0, 0.0, RiskConfig()) == 0.0


@pytest.mark.parametrize(
    ("confidence", "xyxy", "expected"),
    [
        (1.0, (0.4, 0.5, 0.6, 1.0), 1.0),  # bottom at the bottom, half the picture tall
        (0.5, (0.4, 0.5, 0.6, 1.0), 0.5),
        (1.0, (0.4, 0.2, 0.6, 0.3), 0.08),  # far: 0.4 * 0.1/0.5
        (0.8, (0.4, 0.45, 0.6, 0.65), 0.8 * (0.6 * 0.5 + 0.4 * 0.4)),  # J1 by hand: 0.368
        (0.0, (0.4, 0.5, 0.6, 1.0), 0.0),
    ],
)
def test_j1_severity(confidence: float, xyxy: m.BoxXyxy, expected: float) -> None:
    assert severity(confidence, xyxy) == pytest.approx(expected)


@given(UNIT, UNIT, BOX, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_severity_is_monotone(low: float, high: float, xyxy: m.BoxXyxy, drop: float, lift: float) -> None:
    """J1: more confidence, a lower bottom or a taller box is never less severe, and severity stays in [0, 1]."""
    x1, y1, x2, y2 = xyxy
    low, high = sorted((low, high))
    assert 0.0 <= severity(low, xyxy) <= severity(high, xyxy) <= 1.0
    lower = min(1.0, y2 + drop)
    assert severity(high, (x1, y1 + (lower - y2), x2, lower)) >= severity(high, xyxy) - 1e-12
    assert severity(high, (x1, max(0.0, y1 - lift), x2, y2)) >= severity(high, xyxy)


def test_j2_overlap_is_the_share_of_the_box() -> None:
    assert overlap((0.30, 0.4, 0.40, 0.6), (0.31, 0.69)) == pytest.approx(0.9)
    assert overlap((0.30, 0.4, 0.40, 0.6), (0.03, 0.39)) == pytest.approx(0.9)  # both lanes count it
    assert overlap((0.70, 0.4, 0.80, 0.6), (0.31, 0.69)) == 0.0
    assert overlap((0.0, 0.0, 1.0, 1.0), (0.31, 0.69)) == pytest.approx(0.38)


def test_j3_combination() -> None:
    """J3: E(0.5, 0.4) = 1 - 0.5*0.6 = 0.7."""
    assert noisy_or([0.5, 0.4]) == pytest.approx(0.7)
    assert noisy_or([]) == 0.0


@given(st.lists(UNIT, max_size=8), UNIT)
def test_combination_is_bounded_and_only_grows(values: list[float], more: float) -> None:
    assert 0.0 <= noisy_or(values) <= noisy_or([*values, more]) + 1e-12 <= 1.0 + 1e-12


def test_a_detection_reaches_only_the_lanes_it_overlaps() -> None:
    """J2, J3, J13: a confirmed buoy straight ahead adds O to the centre and nothing to the sides."""
    _, advice, tracks = play([seeing(BUOY_AHEAD)] * 2)
    assert advice[0].center.obstacle == 0.0  # G4: one sighting is not accepted
    expected = severity(0.8, BUOY_AHEAD.box_xyxy)
    assert advice[1].center.obstacle == pytest.approx(expected)
    assert advice[1].center.risk == pytest.approx(0.05 + 0.65 * expected)
    assert (advice[1].left.obstacle, advice[1].right.obstacle) == (0.0, 0.0)
    assert advice[1].contributing_track_ids == (tracks[1].tracks[0].id,) == advice[1].center.track_ids
    assert advice[1].left.track_ids == advice[1].right.track_ids == ()


def test_a_box_above_the_corridors_is_in_none() -> None:
    """J2, E2: a bridge over the corridor's top is tracked and weighs nothing."""
    _, advice, tracks = play([seeing(box(m.Label.VESSEL, (0.30, 0.02, 0.70, 0.30)))] * 4)
    assert tracks[3].tracks[0].accepted
    assert advice[3].contributing_track_ids == ()
    assert advice[3].center.risk == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("config", "risk", "direction"),
    [(PAANI, 0.70, m.Direction.STOP), (PAPER, 0.35, m.Direction.STRAIGHT)],
)
@pytest.mark.parametrize(
    "mask",
    [
        {"segmentation": m.SegmentationSource.FALLBACK, "navigation_eligible": False},
        {"segmentation": m.SegmentationSource.FALLBACK},
        {"navigation_eligible": False},
        {"segmentation": m.SegmentationSource.NONE, "navigation_eligible": False},
    ],
)
def test_f3_an_ineligible_mask_never_counts(
    mask: dict[str, object], config: Config, risk: float, direction: m.Direction
) -> None:
    """F2, F3: default water components replace it; F4: the paper's default still goes straight, ours stops."""
    _, advice, _ = play([msgspec.structs.replace(CLEAR, **mask)], config)
    assert advice[0].center.risk == pytest.approx(risk)
    assert advice[0].direction is direction


def box_at(range_m: float) -> BoxXyxy:
    """A vessel whose foot is so far ahead of the simulator's camera, at rest on level water."""
    eye = EyeConfig()
    focal = 0.5 * eye.width_px / math.tan(0.5 * math.radians(eye.hfov_deg)) / eye.height_px
    down = math.atan2(eye.camera_height_m, range_m) - math.radians(eye.pitch_down_deg)
    foot = 0.5 + focal * math.tan(down)
    return (0.4, foot - 0.1, 0.6, foot)


def test_what_is_far_counts_less_and_only_where_the_camera_is_calibrated() -> None:
    """A harbour's worth of moored boats on the horizon is no reason to stop; without a calibration it still is."""
    weights, known = RiskConfig(), calibration_of(EyeConfig())
    aspect = EyeConfig().width_px / EyeConfig().height_px
    weigh = [
        range_weight(box_at(range_m), aspect, known, weights) for range_m in (2.0, 5.0, 9.0, 12.0, 15.0, 19.0, 25.0)
    ]
    assert weigh == sorted(weigh, reverse=True)
    assert weigh[:3] == [1.0, 1.0, 1.0]
    assert 0.0 < weigh[4] < 1.0
    assert weigh[-1] == 0.0
    assert range_weight(box_at(25.0), aspect, CalibrationConfig(), weights) == 1.0
    assert range_weight(box_at(25.0), aspect, known, RiskConfig(far_m=0.0)) == 1.0


def test_what_is_left_out_cannot_be_reached_before_the_next_advice() -> None:
    """Safety: at full speed, within the lifetime of an advisory, the boat does not get half way to what counts less."""
    config = load_config()
    assert config.advisor.lifetime_s * config.controller.max_speed_mps < 0.5 * config.advisor.risk.near_m


CENTER = PAANI.perception.corridors.center
QUAY = (0.0, 0.45, 0.45, 0.80)  # along the boat's port side: nearest at the picture's left


def water_up_to(quay: float, rest: float = 0.4) -> tuple[float, ...]:
    """The water's edge of a picture whose left half shows a quay that ends there in the centre, lower on the left."""
    first = int(CENTER[0] * 80)
    return tuple(0.79 if x < first else quay if x < 36 else rest for x in range(80))


def test_a_quay_along_the_boat_occupies_the_way_ahead_only_where_the_mask_shows_it_there() -> None:
    """A box reaches as low as the quay's nearest end, beside the boat; the quay ends higher in the way ahead."""

    def direction(label: m.Label, edge: tuple[float, ...], config: Config = PAANI) -> m.Direction:
        frame = msgspec.structs.replace(seeing(box(label, QUAY, 0.41)), water_edge=edge)
        return play([frame] * 3, config)[1][-1].direction

    assert direction(m.Label.PIER, water_up_to(0.6)) is m.Direction.STRAIGHT
    assert direction(m.Label.PIER, water_up_to(0.65)) is m.Direction.RIGHT  # as low as what occupies a lane
    assert direction(m.Label.PIER, water_up_to(0.45)) is m.Direction.RIGHT  # the mask does not see it there
    assert direction(m.Label.PIER, water_up_to(0.80)) is m.Direction.RIGHT
    assert direction(m.Label.PIER, ()) is m.Direction.RIGHT
    slanting = tuple(max(y - 0.02 * max(0, x - 24), 0.5) for x, y in enumerate(water_up_to(0.7)))
    assert direction(m.Label.PIER, slanting) is m.Direction.RIGHT  # by its lowest part in the way ahead
    for label in (m.Label.VESSEL, m.Label.BUOY, m.Label.PERSON):  # a hull may be dark as water
        assert direction(label, water_up_to(0.6)) is m.Direction.RIGHT
    assert direction(m.Label.PIER, water_up_to(0.6), PAPER) is m.Direction.RIGHT


def test_where_a_held_quay_ends_is_not_asked_of_a_later_mask() -> None:
    frame = msgspec.structs.replace(seeing(box(m.Label.PIER, QUAY, 0.41)), water_edge=water_up_to(0.8))
    gone = msgspec.structs.replace(CLEAR, water_edge=water_up_to(0.6))
    assert play([frame] * 3 + [gone])[1][-1].reason is m.Reason.CENTER_OCCUPIED


@given(BOX, st.lists(UNIT, min_size=1, max_size=80))
def test_the_mask_ends_a_thing_inside_its_box_and_only_one_that_the_side_cuts(xyxy: BoxXyxy, edge: list[float]) -> None:
    foot = foot_by_mask(xyxy, CENTER, tuple(edge))
    if foot is not None:
        assert xyxy[1] < foot < xyxy[3]
        assert foot in edge
        assert min(xyxy[0], 1.0 - xyxy[2]) <= 0.01
        assert foot_by_mask(xyxy, CENTER, tuple(min(y, xyxy[1]) for y in edge)) is None  # water to above the thing
    assert foot_by_mask((0.02, xyxy[1], 0.98, xyxy[3]), CENTER, tuple(edge)) is None


@pytest.mark.parametrize(("rows_below", "is_ashore"), [(0, False), (2, False), (3, True), (8, True)])
def test_an_error_of_the_mask_s_edge_puts_nobody_ashore(rows_below: int, *, is_ashore: bool) -> None:
    """The edge is seldom off by more than two of its 64 rows: who stands so near to it may be in the water."""
    somebody = (0.48, 0.40, 0.52, 0.50)
    assert stands_ashore(somebody, ((32 + rows_below) / 64,) * 80) is is_ashore
