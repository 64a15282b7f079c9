"""Clear width is written down and decides nothing."""

from __future__ import annotations

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.config import load_config
from paani_services.advisor.advise import AdvisorState, advise

CONFIG = load_config()
SHARE = st.floats(0.0, 1.0)
LANE = st.builds(m.LaneEvidence, non_water=SHARE, uncertainty=SHARE, clear_width=SHARE)


@given(st.tuples(LANE, LANE, LANE), st.tuples(SHARE, SHARE, SHARE))
def test_e7_clear_width_never_gates(
    lanes: tuple[m.LaneEvidence, m.LaneEvidence, m.LaneEvidence], widths: tuple[float, float, float]
) -> None:
    """E7: two pictures that differ in nothing but clear width get the same advice; the advisory states the width."""

    def advised(given_lanes: tuple[m.LaneEvidence, ...]) -> m.Advisory:
        left, center, right = given_lanes
        evidence = m.Evidence(
            source_us=1_000_000, frame_seq=1, frame_epoch=1, width_px=320, height_px=240, usable=True,
            left=left, center=center, right=right, navigation_eligible=True,
            segmentation=m.SegmentationSource.LEARNED,
        )  # fmt: skip
        return advise(AdvisorState(), evidence, 1_100_000, CONFIG)[1]

    other = tuple(msgspec.structs.replace(lane, clear_width=width) for lane, width in zip(lanes, widths, strict=True))
    one, two = advised(lanes), advised(other)
    assert (one.direction, one.reason, one.center.risk, one.counterfactual) == (
        two.direction, two.reason, two.center.risk, two.counterfactual,
    )  # fmt: skip
    assert (two.left.clear_width, two.center.clear_width, two.right.clear_width) == widths
