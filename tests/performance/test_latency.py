"""The claims on measured latencies. Never how fast."""

from __future__ import annotations

from dataclasses import replace

import pytest
from latency import PUBLISHED, bound_lines, claims_on
from lower_bound import LowerBound, Work

from cylinder_friction.deployment.latency.machine import Quiet
from cylinder_friction.deployment.latency.measuring import Effort, Latency, Measured, ModelFigures, RuntimeFigures

BOUND = LowerBound(Work(40_000, 1000, 96, 20_000), 1e10, 1e10)


def measured(**models: dict[str, float]) -> Measured:
    """Return a run with these medians [µs] by runtime; p99.9 of each ten times its median."""
    figures = {
        name: ModelFigures(
            PUBLISHED if name == "paper" else name,
            {
                runtime: RuntimeFigures(runtime, Latency(1, p50, p50, 10.0 * p50, p50, p50, 0), 0.0)
                for runtime, p50 in times.items()
            },
            100,
            100,
        )
        for name, times in models.items()
    }
    return Measured(figures, Effort(), None, Quiet(None, None, None), {})


def test_claims_on_the_papers_size() -> None:
    own_us = 3.0 * BOUND.bandwidth_us
    times = {"c": own_us, "torch_window": 200.0 * own_us, "onnx_step": 3.0 * own_us, "tail": 1.0}
    claims = claims_on(measured(paper=times), {"paper": BOUND})
    assert [(claim.limit, claim.met) for claim in claims] == [
        (100.0, True),
        (600.0, False),
        (4.0, False),
        (5.0, False),
        (4.0, True),
    ]
    assert [claim.measured for claim in claims] == pytest.approx([200.0, 200.0, 3.0, 10.0, 3.0])
    assert claims[1].line().startswith("MISSED  paper: C at least 600 times faster than torch_window")


@pytest.mark.parametrize(("ratio", "met"), [(9.9, True), (10.1, False)])
def test_claim_on_any_other_size(ratio: float, met: bool) -> None:
    (claim,) = claims_on(measured(small={"c": 0.1 * ratio}, lugre={"c": 0.1}), {"small": BOUND})
    assert claim.met == met
    assert claim.measured == pytest.approx(ratio)


def test_the_lower_bound_is_printed_with_what_it_is_made_of() -> None:
    assert "4.110 µs = 41096 bytes at 10.0 GB/s (network 40000, forest 96, filters 1000)" in bound_lines(BOUND)
    assert replace(BOUND, bytes_per_s=2e10).bandwidth_us == pytest.approx(BOUND.bandwidth_us / 2.0)
