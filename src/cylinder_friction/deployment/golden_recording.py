"""Recording of a golden trajectory. The check is in another module, as the live service runs it without Numba."""

from typing import Any

import numpy as np

from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream

ROWS, PERIOD_ROWS = 800, 400


def golden_content(model: StepModel) -> dict[str, Any]:
    """Make samples that sweep the training range, and the outputs of the compiled step for them, for JSON."""
    lower, upper = model.trained_readings
    phases = 2.0 * np.pi * np.arange(ROWS)[:, None] / PERIOD_ROWS + np.arange(len(model.inputs))
    samples = 0.5 * (lower + upper) + 0.3 * (upper - lower) * np.sin(phases)
    newtons, flags = RealTimeStream(model).run(samples)
    return {"samples": samples.tolist(), "newtons": newtons.tolist(), "flags": flags.tolist()}
