"""Parameters of the stages that learn, compare and register."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import Field, field_validator

from cylinder_friction.params.section import Count, Fraction, NotNegative, Positive, Section, Seed
from cylinder_friction.tuning.space import SearchSpace


class HybridParams(Section):
    """Hyperparameters of one LSTM + random forest hybrid, which the paper's Table I tunes."""

    layers: Count
    nodes: Count
    dropout: Fraction
    learning_rate: Positive
    forest_trees: Count
    forest_depth: Count


class TrainingParams(Section):
    """How a hybrid is trained."""

    epochs: Count
    patience: Count | None
    sequence_length: Count
    burn_in: Annotated[int, Field(ge=0)]
    batch_size: Count
    schedule: Literal["constant", "cosine"]
    forest_rows: Count
    forest_leaf: Count


class LearningParams(Section):
    """Parameters of every stage that trains a hybrid."""

    seed: Seed
    device: Literal["auto", "cpu", "cuda"]
    training: TrainingParams


class SearchParams(LearningParams):
    """Optuna's search over a hybrid's hyperparameters."""

    hybrid: Literal["force_balance", "paper"]
    trials: Count
    startup_trials: Count
    batch: Count
    maximum_multiply_adds: Count
    finalists: Count
    final_epochs: Count
    final_seeds: Count
    space: SearchSpace


class TrainParams(LearningParams):
    """The final training of the hybrid, with the best hyperparameters of the search or with the ones stated here."""

    use_search: bool
    design: Literal["force_balance", "paper"]
    lag_s: NotNegative
    hybrid: HybridParams


class BaselinesParams(LearningParams):
    """The paper's hybrid with the published hyperparameters; the random forest by itself uses the same ones."""

    hybrid: HybridParams


class LugreParams(Section):
    """Identification of LuGre, once in one condition and once in all conditions."""

    seed: Seed
    condition: str
    population: Count
    generations: Count
    simulated_recordings: Count
    velocity_dead_band_m_s: NotNegative
    damping_ratio: Positive
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)]


class CompareParams(Section):
    """The comparison on held-out recordings."""

    main: Literal["hybrid", "paper_hybrid"]
    figure_duration_s: Positive
    autocorrelation_lags: Count
    timing_repeats: Count
    standstill_velocity_m_s: Positive
    reversal_window_s: Positive
    maximum_lag_s: Positive


class RegisterParams(Section):
    """The promotion gate; ``candidate`` names any estimator of the comparison that has a real-time step."""

    model_name: str
    candidate: str
    tolerance_percent: NotNegative

    @field_validator("model_name")
    @classmethod
    def _mlflow_takes_the_name(cls, name: str) -> str:
        if not re.fullmatch(r"[\w.-]+", name):
            raise ValueError("expected letters, digits, '_', '-' and '.', which is what MLflow and its URIs take")
        return name
