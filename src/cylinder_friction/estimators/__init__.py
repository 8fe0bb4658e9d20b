"""Everything that estimates friction from a recording, behind one protocol.

Every kind is imported here, so that ``FrictionEstimator.load`` knows it.
"""

from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.estimators.base import (
    EstimatorStream,
    FrictionEstimator,
    NotFittedError,
)
from cylinder_friction.estimators.by_direction import ConstantByDirectionEstimator, CoulombViscousLineEstimator
from cylinder_friction.estimators.checkpoint import Checkpoint
from cylinder_friction.estimators.disturbance_observer import DisturbanceObserver
from cylinder_friction.estimators.elman import ElmanEstimator
from cylinder_friction.estimators.forest_alone import ForestEstimator
from cylinder_friction.estimators.gradient_boosting import GradientBoostingEstimator
from cylinder_friction.estimators.gru import GruEstimator
from cylinder_friction.estimators.han import HanEstimator
from cylinder_friction.estimators.hybrid import ForestPlan, HybridEstimator
from cylinder_friction.estimators.learned_gain import LearnedGainEstimator
from cylinder_friction.estimators.linear import (
    ForceBalanceEstimator,
    LowPassForceBalanceEstimator,
    RidgeEstimator,
)
from cylinder_friction.estimators.lstm import lstm_multiply_adds
from cylinder_friction.estimators.lstm_correction import LstmEstimator, LstmForestEstimator
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator
from cylinder_friction.estimators.lugre_residual import LugreResidualEstimator
from cylinder_friction.estimators.machado import MachadoEstimator
from cylinder_friction.estimators.narx import NarxEstimator
from cylinder_friction.estimators.tcn import TcnEstimator
from cylinder_friction.estimators.training_plan import Architecture, LearningCurve, TrainingPlan
from cylinder_friction.estimators.training_range import TrainingRange

__all__ = [
    "AnalyticalEstimator",
    "Architecture",
    "Checkpoint",
    "ConstantByDirectionEstimator",
    "CoulombViscousLineEstimator",
    "DisturbanceObserver",
    "ElmanEstimator",
    "EstimatorStream",
    "ForceBalanceEstimator",
    "ForestEstimator",
    "ForestPlan",
    "FrictionEstimator",
    "GradientBoostingEstimator",
    "GruEstimator",
    "HanEstimator",
    "HybridEstimator",
    "LearnedGainEstimator",
    "LearningCurve",
    "LowPassForceBalanceEstimator",
    "LstmEstimator",
    "LstmForestEstimator",
    "LugreEstimator",
    "LugreResidualEstimator",
    "MachadoEstimator",
    "NarxEstimator",
    "NotFittedError",
    "PressureLugreEstimator",
    "RidgeEstimator",
    "TcnEstimator",
    "TrainingPlan",
    "TrainingRange",
    "lstm_multiply_adds",
]
