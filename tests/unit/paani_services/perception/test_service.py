"""What perception says of a camera that nobody measured, in the log and on the page."""

from __future__ import annotations

import logging

import msgspec
import pytest

from paani import messages as m
from paani.config import calibration_of, load_config
from paani.errors import UserError
from paani_services.perception.service import judge_weights, sight_note, warn_uncalibrated

ASSUMED, PAPER = load_config(), load_config(profile="paper")
MEASURED = msgspec.structs.replace(ASSUMED, calibration=calibration_of(ASSUMED.eye))
SEEN = m.Evidence(
    source_us=1, frame_seq=0, frame_epoch=1, width_px=320, height_px=240, usable=True, models="one, other"
)


def test_the_log_says_what_is_assumed_and_what_measures_it(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        for config in (MEASURED, PAPER):
            warn_uncalibrated(config)
        assert caplog.messages == []
        warn_uncalibrated(ASSUMED)
    assert "everybody in view counts as near" in caplog.messages[0]
    assert "advisor.people.uncalibrated_mps" in caplog.messages[0]
    assert "`paani calibrate RECORDING`" in caplog.messages[0]


@pytest.mark.parametrize("weights", ["open", "paper"])
def test_the_log_and_the_page_say_that_the_weights_are_others(weights: str, caplog: pytest.LogCaptureFixture) -> None:
    chosen = load_config(sets=(f"perception.weights={weights}",))
    with caplog.at_level(logging.WARNING):
        for config in (MEASURED, PAPER):
            judge_weights(config)
        assert caplog.messages == []
        judge_weights(chosen)
    assert "learnt from few pictures" in caplog.messages[0]
    assert "advisor.people.uncalibrated_mps" in caplog.messages[0]
    assert sight_note(SEEN, chosen).endswith(f"; {weights} weights, which miss more, speed limited; one, other")


@pytest.mark.parametrize("weights", ["open", "paper"])
def test_a_hull_is_not_steered_by_a_segmenter_that_has_seen_little_water(
    weights: str, caplog: pytest.LogCaptureFixture
) -> None:
    sets = [f"perception.weights={weights}"]
    with pytest.raises(UserError, match=rf"perception\.weights {weights}: .* perception\.segmenter"):
        judge_weights(load_config(profile="hull", sets=sets))
    with caplog.at_level(logging.WARNING):
        judge_weights(load_config(profile="hull", sets=[*sets, "perception.segmenter=own.onnx"]))
    assert "people" in caplog.messages[0]


def test_the_page_says_whether_distances_are_known() -> None:
    assert sight_note(SEEN, ASSUMED) == "uncalibrated camera, everybody counts as near, speed limited; one, other"
    assert sight_note(SEEN, MEASURED) == sight_note(SEEN, PAPER) == "one, other"
    refused = msgspec.structs.replace(SEEN, usable=False, cause=m.UnusableCause.NO_WATER)
    assert sight_note(refused, ASSUMED) == "unusable: no_water"
