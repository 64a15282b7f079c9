"""The figures of `paani bench deck`: what keeps the bars, and what is told."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from paani import messages as m
from paani.errors import UserError
from paani_tools.bench.deck.command import deck_config, deck_parser, main, silence_text
from paani_tools.bench.deck.loads import PageLoad
from paani_tools.bench.deck.measuring import is_stopped
from paani_tools.bench.deck.page_probe import page_moments
from paani_tools.bench.deck.picture_path import STAGES, BoatMoments, PageMoments, spread_of_stages, stage_durations_ms
from paani_tools.bench.deck.report import (
    Crowd,
    DeckReport,
    Ratio,
    decision_ratio,
    deck_text,
    heap_slope,
    keeps_bars,
    ratio_of_medians,
)
from paani_tools.up.run_summary import Percentiles, percentiles

FEW, MANY = (Crowd(clients=count, cpu_cores=0.03 * count, decisions_hz=5.0) for count in (1, 10))
BOAT = BoatMoments(
    captured_us=0.0,
    encoded_us=30e3,
    published_us=32e3,
    begun_us=35e3,
    inferred_us=55e3,
    evidence_us=56e3,
    heard_us=58e3,
)
PAGE = PageMoments(frame_seq=7, evidence_us=61e3, mask_us=65e3, decoded_us=67e3, drawn_us=75e3, shown_us=90e3)
KEPT = DeckReport(
    camera_hz=10.0,
    received_hz=9.8,
    loads=(PageLoad(load_ms=410.0, files=40, bytes=204_800), PageLoad(load_ms=390.0, files=40, bytes=204_800)),
    received_ms=percentiles([20.0, 30.0]),
    drawn_ms=percentiles([120.0, 130.0]),
    stage_ms=spread_of_stages([stage_durations_ms(BOAT, PAGE, jpeg_ms=1.0)]),
    beyond_ms=percentiles([40.0, 60.0]),
    alone_ms=percentiles([30.0]),
    crowds=(FEW, MANY),
    stop_ratio=Ratio(1.05, 0.9, 1.2),
    stop_ms={"on this machine": percentiles([40.0, 150.0]), "over a link of 50 ms": percentiles([150.0, 299.0])},
    stick_ms=percentiles([60.0]),
    unanswered=0,
    heap_s=1800.0,
    heap_slope_mib_h=1.25,
    load_average=(0.5, 2.0),
)


def test_what_keeps_the_bars_keeps_them() -> None:
    assert keeps_bars(KEPT)


@pytest.mark.parametrize(
    "missed",
    [
        replace(KEPT, stop_ms={**KEPT.stop_ms, "on this machine": percentiles([151.0])}),
        replace(KEPT, stop_ms={**KEPT.stop_ms, "over a link of 50 ms": percentiles([301.0])}),
        replace(KEPT, stop_ms={**KEPT.stop_ms, "with 10 clients": Percentiles()}),
        replace(KEPT, unanswered=1),
        replace(KEPT, beyond_ms=percentiles([61.0])),
        replace(KEPT, alone_ms=Percentiles()),
        replace(KEPT, crowds=(FEW, replace(MANY, decisions_hz=4.74))),
        replace(KEPT, crowds=(FEW,)),
        replace(KEPT, stop_ratio=Ratio(1.06, 1.0, 1.1)),
        replace(KEPT, stop_ratio=None),
    ],
)
def test_each_bar_can_be_missed(missed: DeckReport) -> None:
    assert not keeps_bars(missed)


def test_many_clients_are_compared_with_one_over_all_rounds() -> None:
    assert decision_ratio((FEW, replace(MANY, decisions_hz=4.0), replace(FEW, decisions_hz=3.0), MANY)) == 4.5 / 4.0
    assert decision_ratio((MANY,)) is None


def test_medians_are_compared_with_how_far_the_same_samples_spread() -> None:
    assert ratio_of_medians([], [1.0]) is None
    assert ratio_of_medians([1.0], []) is None
    assert ratio_of_medians([30.0] * 9, [20.0] * 9) == Ratio(1.5, 1.5, 1.5)
    found = ratio_of_medians([12.0, 14.0, 16.0, 18.0, 90.0] * 4, [11.0, 13.0, 15.0, 17.0, 19.0] * 4)
    assert found is not None
    assert found.value == 16.0 / 15.0
    assert 0.8 < found.low < 1.0 < found.value < found.high < 1.5


@pytest.mark.parametrize(("cause", "is_it"), [(m.ZeroCause.NOT_ARMED, True), (m.ZeroCause.TIMEOUT, False)])
def test_a_stop_is_thrust_that_ended_because_of_it(cause: m.ZeroCause, is_it: bool) -> None:
    report = m.ThrustApplied(source_us=1, left=0.0, right=0.0, left_n=0.0, right_n=0.0, zero_cause=cause)
    assert is_stopped(report) is is_it


def test_a_slope_is_that_of_the_line_through_the_samples() -> None:
    assert heap_slope([(0.0, 10.0), (1800.0, 11.0), (3600.0, 12.0)]) == pytest.approx(2.0)
    assert heap_slope([(0.0, 10.0), (1.0, 11.0)]) is None


def test_stages_add_up_to_the_time_from_the_stamp_to_the_screen() -> None:
    stages = stage_durations_ms(BOAT, PAGE, jpeg_ms=1.0)
    assert list(stages) == list(STAGES)
    assert list(stages.values()) == pytest.approx([29, 1, 2, 3, 20, 1, 2, 3, 4, 2, 8, 15])
    assert sum(stages.values()) == pytest.approx(90.0)


@pytest.mark.parametrize(("mask_us", "decoded_us"), [(50e3, 61e3), (61e3, 40e3)])
def test_what_came_before_the_evidence_is_not_waited_for(mask_us: float, decoded_us: float) -> None:
    stages = stage_durations_ms(BOAT, replace(PAGE, mask_us=mask_us, decoded_us=decoded_us), jpeg_ms=1.0)
    assert (stages["mask"], stages["decoding"]) == (0.0, 0.0)
    assert sum(stages.values()) == pytest.approx(90.0)


def test_a_picture_that_was_drawn_before_its_mask_has_no_stages() -> None:
    noted = {"seq": 7, "picture": 1.0, "evidence": 61e3, "mask": 65e3, "decoded_picture": 60e3, "decoded_mask": 67e3,
             "drawn": 75e3, "shown": 90e3}  # fmt: skip
    assert page_moments(noted) == PAGE
    for late in ("evidence", "mask", "decoded_mask"):
        assert page_moments({name: at for name, at in noted.items() if name != late}) is None


def test_every_figure_is_told_with_its_count() -> None:
    text = deck_text(KEPT)
    for words in ("390 to 410 ms (n = 2)", "of the camera and to a client | 10 and 9.8",
                  "40, 200 KiB", "p99 150 ms (n = 2)", "with 10 clients | 30.0 % of a core",
                  "+1.2 MiB/h over 1800 s", "without answer: 0; load 0.50 before, 2.00 after",
                  "of which inference | p50 20, p95 20",
                  "with evidence | p50 40, p95 60, p99 60 ms (n = 2); bar p95 60 ms: kept",
                  "many clients over one | 1.000; bar 0.95 or more: kept",
                  "many clients over one | 1.05 (95 % of draws 0.90 to 1.20); bar 1.05 or less: kept"):  # fmt: skip
        assert words in text, words
    assert "-; bar 1.05 or less: NOT KEPT" in deck_text(replace(KEPT, stop_ratio=None))
    assert "not measured" in deck_text(replace(KEPT, heap_slope_mib_h=None))


@pytest.mark.parametrize(
    ("error", "end"),
    [
        (TimeoutError(), ": in time"),
        (TimeoutError("the page heard nothing of the boat within 30 s"), "nothing of the boat within 30 s"),
        (OSError("Page.goto: Timeout 30000ms exceeded.\nCall log:\n  - navigating"), "Timeout 30000ms exceeded."),
    ],
)
def test_what_did_not_answer_is_told_in_one_line(error: Exception, end: str) -> None:
    text = silence_text(error)
    assert text.startswith("the page or the boat did not answer: ")
    assert text.endswith(end)
    assert "\n" not in text


@pytest.mark.parametrize(
    ("words", "rate_hz"), [([], 10.0), (["--rate", "5"], 5.0), (["--rate", "5", "--set", "camera.rate_hz=4"], 4.0)]
)
def test_the_camera_gives_ten_pictures_a_second_or_as_many_as_asked(words: list[str], rate_hz: float) -> None:
    config = deck_config(deck_parser().parse_args(words))
    assert config.camera.rate_hz == rate_hz
    assert config.eye.rate_hz == config.perception.rate_hz == max(rate_hz, 5.0)
    assert config.dashboard.picture_rate_hz >= rate_hz


def test_options_that_are_none_end_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (
        ["--stops", "0"],
        ["--for", "-1"],
        ["--heap", "nan"],
        ["--heap", "0"],
        ["--rate", "11"],
        ["--rate", "0"],
    ):
        with pytest.raises(SystemExit) as ended:
            main(words)
        assert ended.value.code == 2
        assert words[0] in capsys.readouterr().err


def test_a_page_that_others_reach_is_refused_before_anything_starts() -> None:
    with pytest.raises(UserError, match=r"dashboard\.host 0\.0\.0\.0"):
        main(["--set", "dashboard.host=0.0.0.0"])
