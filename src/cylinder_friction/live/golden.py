"""The golden trajectory of a registered model, which the engine must meet before the service begins."""

from pathlib import Path

from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE, difference_n
from cylinder_friction.live.engine import Engine, Job
from cylinder_friction.recordings.files import read_json


def golden_difference_n(engine: Engine, estimator: Path) -> float | None:
    """Return how far an engine is from its model's golden trajectory at most [N]; None where there is none.

    Args:
        engine: Of that model.
        estimator: The saved estimator's folder; a registered model has its trajectory beside it.

    Raises:
        GoldenError: It is too far.
    """
    golden = estimator.with_name(GOLDEN_FILE)
    if not golden.is_file():
        return None
    slot = engine.add()
    try:
        return difference_n(lambda samples: engine.run([Job(slot, samples)])[0], read_json(golden))
    finally:
        engine.remove(slot)
