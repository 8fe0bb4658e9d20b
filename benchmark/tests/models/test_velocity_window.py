"""The window of past velocities."""

from __future__ import annotations

import itertools

import numpy as np

from friction_benchmark.models.velocity_window import EVERY, SPANS, advance_window, new_window


def test_the_window_holds_means_over_growing_spans() -> None:
    velocity = 0.05 * np.arange(1.0, EVERY * int(SPANS.sum()) + 1.0)
    window, stepped = advance_window(new_window(), velocity)
    assert stepped.sum() == SPANS.sum()
    seen = velocity[stepped][::-1]
    edges = np.concatenate([[0], np.cumsum(SPANS)])
    means = [seen[start:end].mean() / 0.05 for start, end in itertools.pairwise(edges)]
    np.testing.assert_allclose(window[-1, : len(SPANS)], means, rtol=1e-6)
