"""Each frame is judged by its own evidence, and what is wrong with it has a name of its own."""

from __future__ import annotations

import math

import msgspec
import pytest

from paani import messages as m
from paani.config import Config
from paani_services.advisor.advise import AdvisorState, advise
from tests.unit.paani_services.advisor.advisor_evidence import CLEAR, PAANI, PAPER, T0_US, play, water


def test_b8_each_frame_is_judged_by_its_own_water() -> None:
    _, advice, _ = play([CLEAR, water(0.2, 0.4, 0.1)])
    assert [each.center.risk for each in advice] == pytest.approx([0.05, 0.4])


def test_b10_advice_carries_what_it_was_made_of() -> None:
    seen = m.LaneEvidence(non_water=0.1, uncertainty=0.3, clear_width=0.9)
    advice = play([msgspec.structs.replace(CLEAR, center=seen)])[1][0]
    assert (advice.center.non_water, advice.center.uncertainty, advice.center.clear_width) == (0.1, 0.3, 0.9)
    assert advice.explanation


def test_b17_what_is_malformed_and_what_is_of_the_future_is_not_called_stale() -> None:
    spoilt = msgspec.structs.replace(CLEAR, left=m.LaneEvidence(non_water=math.nan))
    assert play([CLEAR, spoilt])[1][1].reason is m.Reason.MALFORMED_EVIDENCE
    state, _, _ = advise(AdvisorState(), CLEAR, T0_US, PAANI)
    _, set_back, _ = advise(state, CLEAR, T0_US - 2_000_000, PAANI)
    assert set_back.reason is m.Reason.FUTURE_EVIDENCE


@pytest.mark.parametrize(("config", "share"), [(PAANI, 1.0), (PAPER, 0.5)], ids=["paani", "paper"])
def test_f3_without_a_trusted_mask_both_components_are_the_defaults(config: Config, share: float) -> None:
    """Whatever the mask shows, be it worse."""
    frame = msgspec.structs.replace(water(0.6, 0.65, 0.6), navigation_eligible=False)
    advice = play([frame], config)[1][0]
    for lane in (advice.left, advice.center, advice.right):
        assert (lane.non_water, lane.uncertainty) == (share, share)


def test_x6_advice_and_tracks_are_of_one_observation() -> None:
    _, advice, tracks = play([water(0.4976, 0.5114, 0.4573)] * 8, PAPER, 0.1)
    for one, other in zip(advice, tracks, strict=True):
        assert (one.frame_epoch, one.frame_seq, one.source_us) == (other.frame_epoch, other.frame_seq, other.source_us)
