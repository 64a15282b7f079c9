"""The ratio that the chain's bench prints of one run."""

import pytest

from paani.statistics.measured import Machine
from paani_tools.bench.chain import chain_bench, chain_text
from paani_tools.up.run_summary import STAGES, Percentiles, Report, ServiceFigures

IDLE = ServiceFigures(rate_hz=5.0, cpu_cores=0.5, rss_mib=100.0, restarts=0)


@pytest.mark.parametrize(
    ("inference_ms", "ratio", "text"),
    [(40.0, 0.25, "transport is 0.25 times"), (None, None, "transport is not measured")],
)
def test_transport_is_told_as_a_share_of_the_inference(
    inference_ms: float | None, ratio: float | None, text: str
) -> None:
    latency_ms = dict.fromkeys(STAGES, Percentiles()) | {
        "transport": Percentiles(p50=10.0, samples=3),
        "inference": Percentiles(p50=inference_ms, samples=3),
    }
    run = Report(
        duration_s=30.0, profile="paani", world="river", services={"perception": IDLE}, board_rss_mib=100.0,
        latency_ms=latency_ms, decisions={}, reasons={}, distance_m=1.0, waypoints_reached=0, collisions=0, drops={},
        superseded={},
    )  # fmt: skip
    bench = chain_bench(run, Machine(cores=2, load_before=0.0, load_after=0.0))
    assert bench.transport_over_inference == ratio
    assert text in chain_text(bench)
