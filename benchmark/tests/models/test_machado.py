"""The network of Machado: what its plan refuses."""

from __future__ import annotations

import pytest

from friction_benchmark.models.machado import MachadoPlan


def test_an_impossible_plan_is_refused() -> None:
    with pytest.raises(ValueError, match="expected nodes, delay and iterations of at least 1"):
        MachadoPlan(nodes=0)
