"""The golden trajectory of a served model: samples, and what the estimator made of them when it was registered.

It lies beside the graph, which must meet it wherever it is served.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array

    # numba and what it compiles take 200 MB, and a server needs neither
    from cylinder_friction.deployment.scoring import ServedGraph
    from cylinder_friction.realtime.model import StepModel

GOLDEN_FILE = "golden.json"
ROWS, PERIOD_ROWS = 800, 400
TOLERANCE_N = 0.1
"""Other processors round single precision otherwise."""


class GoldenError(ValueError):
    """A runtime does not give what was recorded with its model."""


def recorded(graph: ServedGraph, model: StepModel) -> dict[str, Any]:
    """Return samples that sweep the training range, and the outputs of the compiled step: not those of the graph."""
    from cylinder_friction.realtime.stream import RealTimeStream

    phases = 2.0 * np.pi * np.arange(ROWS)[:, None] / PERIOD_ROWS + np.arange(len(graph.inputs))
    samples = 0.5 * (graph.lower + graph.upper) + 0.3 * (graph.upper - graph.lower) * np.sin(phases)
    newtons, flags = RealTimeStream(model).run(samples)
    return {"samples": samples.tolist(), "newtons": newtons.tolist(), "flags": flags.tolist()}


def difference_n(run: Callable[[Array], tuple[Array, NDArray[np.integer[Any]]]], golden: dict[str, Any]) -> float:
    """Return how far what ``run`` makes of the samples is from the golden trajectory at most [N].

    Raises:
        GoldenError: It is farther than ``TOLERANCE_N``, or flags differ.
    """
    newtons, flags = run(np.array(golden["samples"], dtype=np.float64))
    found_n = float(np.abs(newtons[:, :3] - np.array(golden["newtons"])).max())
    changed = int((flags != np.array(golden["flags"])).sum())
    if changed or not found_n <= TOLERANCE_N:
        raise GoldenError(
            f"on its golden trajectory it is {found_n:.3g} N from what was recorded with it, and {changed} flags "
            f"differ; expected at most {TOLERANCE_N} N and the same flags"
        )
    return found_n
