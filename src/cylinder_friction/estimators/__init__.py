"""Everything that estimates friction from a recording, behind one protocol."""

from cylinder_friction.estimators.base import (
    EstimatorStream,
    FrictionEstimator,
    NotFittedError,
    TrainingRange,
)
from cylinder_friction.estimators.checkpoint import Checkpoint
from cylinder_friction.estimators.forest_alone import ForestEstimator
from cylinder_friction.estimators.hybrid import ForestPlan, HybridEstimator
from cylinder_friction.estimators.linear import (
    ForceBalanceEstimator,
    LowPassForceBalanceEstimator,
    RidgeEstimator,
)
from cylinder_friction.estimators.lstm import lstm_multiply_adds
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator
from cylinder_friction.estimators.training_plan import Architecture, LearningCurve, TrainingPlan

__all__ = [
    "Architecture",
    "Checkpoint",
    "EstimatorStream",
    "ForceBalanceEstimator",
    "ForestEstimator",
    "ForestPlan",
    "FrictionEstimator",
    "HybridEstimator",
    "LearningCurve",
    "LowPassForceBalanceEstimator",
    "LugreEstimator",
    "NotFittedError",
    "PressureLugreEstimator",
    "RidgeEstimator",
    "TrainingPlan",
    "TrainingRange",
    "lstm_multiply_adds",
]
