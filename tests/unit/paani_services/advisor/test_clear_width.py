"""Clear width is written down and decides nothing, but where the planner's map knows better than a quay's box."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import Config
from tests.unit.paani_services.advisor.advisor_evidence import CALIBRATED, CLEAR, PAANI, PAPER, box, play

SHARE = st.floats(0.0, 1.0)
LANE = st.builds(
    m.LaneEvidence, non_water=SHARE, uncertainty=SHARE, clear_width=SHARE, open_width=SHARE | st.just(msgspec.UNSET)
)
LANES = st.tuples(LANE, LANE, LANE)
LANE_NAMES = ("left", "center", "right")
PIER = box(m.Label.PIER, (0.30, 0.45, 0.72, 0.80))
VESSEL, BUOY = box(m.Label.VESSEL, (0.30, 0.45, 0.72, 0.80)), box(m.Label.BUOY, (0.45, 0.40, 0.55, 0.60))
PERSON = box(m.Label.PERSON, (0.30, 0.45, 0.72, 0.80))


def advised(lanes: tuple[m.LaneEvidence, ...], detections: tuple[m.Detection, ...], config: Config) -> m.Advisory:
    """The advice on the third of three such pictures."""
    left, center, right = lanes
    frame = msgspec.structs.replace(CLEAR, left=left, center=center, right=right, detections=detections)
    return play([frame] * 3, config)[1][-1]


def without_width(advisory: m.Advisory) -> m.Advisory:
    """The same advice, whatever the clear widths."""
    lanes = {lane: msgspec.structs.replace(getattr(advisory, lane), clear_width=0.0) for lane in LANE_NAMES}
    return msgspec.structs.replace(advisory, **lanes)


@pytest.mark.parametrize(
    ("config", "boxes"),
    [
        (PAPER, (PIER, VESSEL, BUOY, PERSON)),
        (PAANI, (PIER, VESSEL, BUOY, PERSON)),
        (CALIBRATED, (VESSEL, BUOY, PERSON)),
    ],
    ids=["paper", "uncalibrated", "planned"],
)
@given(lanes=LANES, widths=st.tuples(SHARE, SHARE, SHARE), data=st.data())
@pytest.mark.slow
def test_e7_clear_width_never_gates(
    config: Config,
    boxes: tuple[m.Detection, ...],
    lanes: tuple[m.LaneEvidence, ...],
    widths: tuple[float, float, float],
    data: st.DataObject,
) -> None:
    """E7: pictures that differ in nothing but clear width get the same advice; the advisory states the width."""
    detections = tuple(data.draw(st.lists(st.sampled_from(boxes), max_size=2, unique=True)))
    other = tuple(msgspec.structs.replace(lane, clear_width=width) for lane, width in zip(lanes, widths, strict=True))
    one, two = advised(lanes, detections, config), advised(other, detections, config)
    assert without_width(one) == without_width(two)
    assert (two.left.clear_width, two.center.clear_width, two.right.clear_width) == widths


def test_where_the_planner_acts_a_quay_occupies_no_lane_that_the_mask_shows_clear() -> None:
    """Its box covers the water before a quay that runs obliquely; the map knows where the quay is."""
    clear, half = (msgspec.structs.replace(CLEAR.center, clear_width=width) for width in (1.0, 0.5))
    found = [advised((CLEAR.left, center, CLEAR.right), (PIER,), CALIBRATED).center for center in (clear, half)]
    assert [lane.occupied for lane in found] == [False, True]
