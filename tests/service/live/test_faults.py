"""Frames that are repeated, swapped, delayed, lost, cut or garbage: no crash, no silent wrong number, all counted."""

import pytest
from hypothesis import HealthCheck, given, settings

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.service.live.engine import Engine
from cylinder_friction.service.live.journal import Journal
from wire_faults import Frame, Outcome, frames, run_faulty


def as_the_rules_have_it(outcome: Outcome) -> None:
    assert outcome.refused == outcome.expected_refused
    for got, counts, expected in zip(outcome.got, outcome.counts, outcome.expected, strict=True):
        assert got == expected.estimates
        assert {name: counts[name] for name in expected.counts} == dict(expected.counts)


def test_estimates_and_counts_are_those_of_the_rules(
    engine: Engine, small_hybrid: HybridEstimator, samples: Array, tmp_path_factory: pytest.TempPathFactory
) -> None:
    journal = Journal(tmp_path_factory.mktemp("faults") / "journal.db")

    @settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
    @given(frames(20, 100))
    def check(sent: list[Frame]) -> None:
        as_the_rules_have_it(run_faulty(sent, engine, journal, small_hybrid.real_time, samples))

    check()
    journal.close()
