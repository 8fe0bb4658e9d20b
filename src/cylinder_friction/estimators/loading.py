"""Loading a saved estimator of any kind."""

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
"""The modules of all estimators of this package. Importing a class registers its kind."""


def load_estimator(folder: str | Path) -> FrictionEstimator:
    """Load the estimator saved in a folder, of any kind, registered kinds of other packages included.

    The folder holds plain files only: JSON, ONNX and NumPy arrays, never a pickle. Hashes of all files are checked. A
    loaded estimator estimates bit for bit as before ``save``; it cannot be fitted further without its cylinder.

    Raises:
        FileNotFoundError: The folder holds no saved estimator.
        SavedModelError: A file was changed or is damaged.
        ValueError: The kind is not known.

    Example:
        >>> hybrid.save("hybrid")
        >>> loaded = cf.load("hybrid")
        >>> loaded.estimate(test[0]).tolist() == hybrid.estimate(test[0]).tolist()
        True
    """
    return FrictionEstimator.load(folder)
