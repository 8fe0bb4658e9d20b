"""Loading of a saved estimator of whichever kind."""

from pathlib import Path

from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.forest import ForestEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import ForceBalanceEstimator, LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator

KINDS = (
    AnalyticalEstimator,
    ForceBalanceEstimator,
    ForestEstimator,
    HybridEstimator,
    LowPassForceBalanceEstimator,
    LugreEstimator,
    PressureLugreEstimator,
    RidgeEstimator,
)
"""Every kind of estimator of this package; importing a class makes its kind known to ``FrictionEstimator.load``."""


def load_estimator(folder: str | Path) -> FrictionEstimator:
    """Return the estimator saved in ``folder``, of whichever kind it is.

    Raises:
        FileNotFoundError: The folder holds no saved estimator.
        ValueError: The kind is not known.

    Example:
        >>> hybrid.save("hybrid")
        >>> loaded = cf.load("hybrid")
        >>> loaded.estimate(test[0]).tolist() == hybrid.estimate(test[0]).tolist()
        True
    """
    return FrictionEstimator.load(folder)
