"""The figures of a run, from messages with known stamps."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import keys
from paani import messages as m
from paani_tools.up.run_summary import STAGES, Report, Summary, percentiles

S = 1_000_000
RESTARTS = dict.fromkeys(keys.SERVICES, 0)


def report(summary: Summary, now_us: int = 10 * S) -> Report:
    return summary.report(now_us, "paani", "river", RESTARTS)


def begun() -> Summary:
    summary = Summary()
    summary.begin(0)
    return summary


def chain(summary: Summary, captured_us: int, seq: int) -> None:
    """One picture through the chain: 10, 20, 30 and 40 ms between the steps, 100 ms before the evidence."""
    evidence_us = captured_us + 100_000
    advisory_us, command_us = evidence_us + 10_000, evidence_us + 30_000
    thrust_us, applied_us = evidence_us + 60_000, evidence_us + 100_000
    timing = m.InferenceTiming(inference_ms=50.0, total_ms=70.0)
    summary.feed(
        m.Evidence(
            source_us=captured_us, sent_us=evidence_us, seq=seq, frame_seq=seq, frame_epoch=1,
            width_px=320, height_px=240, usable=True, timing=timing,
        )
    )  # fmt: skip
    advice = m.Advisory(
        source_us=captured_us, sent_us=advisory_us, seq=2 * seq, evidence_sent_us=evidence_us,
        direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR,
    )  # fmt: skip
    summary.feed(advice)
    order = m.NavCommand(
        source_us=captured_us, sent_us=command_us, seq=2 * seq, enable=True, heading_rad=0.0, speed_mps=0.6,
        advisory_sent_us=advisory_us, waypoints_reached=3,
    )  # fmt: skip
    summary.feed(order)
    thrust = m.Thrust(
        source_us=captured_us, sent_us=thrust_us, seq=seq, left=0.1, right=0.1, enabled=True, command_sent_us=command_us
    )
    summary.feed(thrust)
    for repeat in range(2):
        summary.feed(
            m.ThrustApplied(
                source_us=applied_us + 20_000 + repeat * 50_000, since_us=applied_us,
                producer="plant", seq=2 * seq + repeat, left=0.1, right=0.1, left_n=7.5,
                right_n=7.5, zero_cause=m.ZeroCause.NONE, command_sent_us=thrust_us, command_source_us=captured_us,
            )
        )  # fmt: skip
    republished_us = advisory_us + 200_000
    summary.feed(
        m.Advisory(
            source_us=captured_us, sent_us=republished_us, seq=2 * seq + 1, evidence_sent_us=evidence_us,
            direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR,
        )
    )  # fmt: skip
    summary.feed(
        m.NavCommand(
            source_us=captured_us, sent_us=republished_us + 5_000, seq=2 * seq + 1, enable=True, heading_rad=0.0,
            speed_mps=0.6, advisory_sent_us=republished_us, waypoints_reached=3,
        )
    )  # fmt: skip


def health(service: str, *, epoch: int = 1, seq: int = 0, drops: int = 0, rss_mib: float = 40.0) -> m.Health:
    seen = m.InputHealth(
        topic="sensors/imu", alive=True, fresh=True, rate_ok=True, rate_hz=100.0, age_s=0.0, received=500,
        superseded=drops,
    )  # fmt: skip
    state = m.InputHealth(
        topic="plant/clock", alive=True, fresh=True, rate_ok=True, rate_hz=20.0, age_s=0.0, received=90, superseded=7
    )  # fmt: skip
    return m.Health(
        source_us=0, service=service, epoch=epoch, seq=seq, producer=service, ready=True, uptime_s=1.0, cpu_cores=0.25,
        rss_mib=rss_mib, inputs=(seen, state), drops=(m.DropCount(cause="replayed", count=drops),) if drops else (),
    )  # fmt: skip


def pose(*, epoch: int, distance_m: float, collisions: int) -> m.TruePose:
    return m.TruePose(
        source_us=0, sim_us=0, epoch=epoch, seq=round(distance_m), x_m=0.0, y_m=0.0, z_m=0.0, roll_rad=0.0,
        pitch_rad=0.0, yaw_rad=0.0, surge_mps=0.0, sway_mps=0.0, yaw_rate_radps=0.0, distance_m=distance_m,
        collisions=collisions,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("stage", "expected_ms"),
    [
        ("perception", 70.0),
        ("inference", 50.0),
        ("advisor", 10.0),
        ("navigator", 20.0),
        ("controller", 30.0),
        ("adapter", 40.0),
        ("capture_to_thrust", 200.0),
        ("transport", 150.0),
    ],
)
def test_each_stage_is_the_difference_of_its_stamps(stage: str, expected_ms: float) -> None:
    """Republished advice, and orders from it, are no samples."""
    summary = begun()
    for seq in range(4):
        chain(summary, captured_us=S + seq * 250_000, seq=seq)
    figures = report(summary).latency_ms[stage]
    assert (figures.p50, figures.p95, figures.p99, figures.samples) == (expected_ms, expected_ms, expected_ms, 4)


def test_rates_decisions_and_reasons_are_counted_since_all_were_alive() -> None:
    summary = Summary()
    chain(summary, captured_us=0, seq=0)
    for seq in (0, 5):
        summary.feed(m.Arming(source_us=0, armed=True, seq=seq, producer="operator"))
    summary.begin(5 * S)
    chain(summary, captured_us=6 * S, seq=1)
    summary.count_output("eye", 20)
    got = report(summary)
    assert got.duration_s == 5.0
    assert got.services["perception"].rate_hz == 0.2
    assert got.services["plant"].rate_hz == 0.4
    assert got.services["eye"].rate_hz == 4.0
    assert got.decisions == {d.value: 2 * (d is m.Direction.STRAIGHT) for d in m.Direction}
    assert got.reasons == {r.value: 2 * (r is m.Reason.CENTER_CLEAR) for r in m.Reason}
    assert got.latency_ms["advisor"].samples == 1
    assert got.drops == {}


def test_what_was_promised_is_there_even_when_nothing_happened() -> None:
    got = report(Summary())
    assert set(got.services) == set(keys.SERVICES)
    assert set(got.latency_ms) == set(STAGES)
    assert got.latency_ms["transport"].p50 is None
    assert set(got.decisions) == {d.value for d in m.Direction}
    assert (got.duration_s, got.distance_m, got.collisions, got.drops) == (0.0, 0.0, 0, {})


def test_counters_add_up_over_the_lives_of_a_process() -> None:
    summary = begun()
    for epoch, seq, drops in ((1, 0, 2), (1, 1, 5), (9, 0, 1)):
        summary.feed(health("localization", epoch=epoch, seq=seq, drops=drops))
    for epoch, distance_m, collisions in ((1, 4.0, 1), (1, 10.0, 1), (9, 2.5, 2)):
        summary.feed(pose(epoch=epoch, distance_m=distance_m, collisions=collisions))
    got = report(summary)
    assert got.drops["replayed"] == 6
    assert got.drops["overflow_sensors/imu"] == 6
    assert got.superseded == {"plant/clock": 14}
    assert (got.distance_m, got.collisions) == (12.5, 3)


def test_board_memory_is_the_sum_of_the_board_processes() -> None:
    summary = begun()
    for service in keys.SERVICES:
        summary.feed(health(service, rss_mib=30.0))
        summary.feed(health(service, seq=1, rss_mib=20.0))
    got = report(summary)
    assert got.board_rss_mib == 30.0 * len(keys.BOARD_SERVICES)
    assert got.services["plant"].cpu_cores == 0.25


def test_a_gap_in_the_numbers_is_a_loss_and_a_new_epoch_is_not() -> None:
    summary = begun()
    for epoch, seq in ((1, 0), (1, 1), (1, 4), (2, 0), (2, 1)):
        summary.feed(m.Arming(source_us=0, armed=True, epoch=epoch, seq=seq, producer="operator"))
    assert report(summary).drops == {"lost_Arming": 2}


def test_nearest_rank_is_a_sample() -> None:
    figures = percentiles([float(n) for n in range(1, 101)])
    assert (figures.p50, figures.p95, figures.p99) == (50.0, 95.0, 99.0)
    assert percentiles([3.0, 1.0, 2.0]).p50 == 2.0
    assert percentiles([7.0]).p99 == 7.0


@given(st.lists(st.floats(0, 1e6).map(lambda x: round(x, 3)), min_size=1))
def test_percentiles_are_ordered_samples(samples: list[float]) -> None:
    figures = percentiles(samples)
    assert figures.p50 is not None
    assert figures.p95 is not None
    assert figures.p99 is not None
    assert figures.p50 <= figures.p95 <= figures.p99
    assert {figures.p50, figures.p95, figures.p99} <= set(samples)
