"""LuGre, and boosted trees for its residual: physics where data are scarce, learning where they are not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cylinder_friction.estimators.analytical import PRESSURE_PAIRS, AnalyticalEstimator, AnalyticalState, scaled_effort
from cylinder_friction.estimators.front_end import FrontEnd, FrontEndBlock, FrontEndState
from cylinder_friction.friction_models.catalogue import model_named
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.gradient_boosting import PAST, BoostingPlan, GradientBoostingEstimator
from friction_benchmark.models.lagged import Past

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from cylinder_friction.arrays import Array
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.models.learned import LearnedState


SETTINGS = ("passive_above_m_s", "identification_effort", "identified_on")


@dataclass
class LugreFeatureState(FrontEndState):
    """State of the features, and of LuGre."""

    lugre: AnalyticalState


class LugreFeatureBlock(FrontEndBlock):
    """Features with LuGre's friction beside them; LuGre is also what is corrected where there is no force balance.

    Args:
        features: The plan of the others.
        lugre: Identified, of the same inputs.
        scale_n: Divides LuGre's friction [N].
    """

    def __init__(self, features: FrontEnd, lugre: AnalyticalEstimator, scale_n: float) -> None:
        super().__init__(features)
        self._lugre, self._scale_n = lugre, scale_n

    def new_state(self) -> LugreFeatureState:
        plain = super().new_state()
        return LugreFeatureState(plain.features, plain.base, plain.motion, self._lugre.new_state())

    def advance(self, state: FrontEndState, samples: Array) -> tuple[Any, Array]:
        assert isinstance(state, LugreFeatureState)
        features, base_n = super().advance(state, samples)
        lugre_n = self._lugre.advance(state.lugre, samples)
        if not self.front_end.has_base:
            return np.column_stack([features, (lugre_n / self._scale_n).astype(np.float32)]), lugre_n
        beside = np.stack([lugre_n, base_n - lugre_n], axis=1) / self._scale_n
        return np.concatenate([features, beside.astype(np.float32)], axis=1), base_n

    def multiply_adds(self) -> int:
        return super().multiply_adds() + self._lugre.multiply_adds()


class LugreResidualEstimator(GradientBoostingEstimator):
    """An identified LuGre and boosted trees on its residual.

    Without raw pressures the trees correct LuGre. With them they correct the force balance, and LuGre, as well as how
    far the force balance is from it, are features. Dry friction grows with pressure where a pair of pressures, raw or
    slow, is among the inputs.

    Args:
        passive_above_m_s: Faster than this an estimate that would feed energy (friction times velocity below zero)
            is replaced by zero [m/s]; 0 for never.
        identification_effort: Share of LuGre's full search.
        identified_on: How many recordings LuGre is identified on, spread evenly over the training recordings.

    Source: LuGre as Canudas de Wit et al. 1995; a learned residual on physics as in hybrid (grey-box) modelling,
    Psichogios and Ungar 1992.
    """

    kind: ClassVar[str] = "lugre_residual"

    def __init__(
        self,
        cylinder: Cylinder,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        plan: BoostingPlan | None = None,
        past: Past = PAST,
        seed: int = 0,
        passive_above_m_s: float = 0.0,
        identification_effort: float = 0.2,
        identified_on: int = 12,
    ) -> None:
        super().__init__(cylinder, inputs, plan, past, seed)
        if not passive_above_m_s >= 0.0:
            raise ValueError(f"passive_above_m_s must be 0 or a positive number, but got {passive_above_m_s!r}")
        self.passive_above_m_s = passive_above_m_s
        self.identification_effort, self.identified_on = identification_effort, identified_on
        scaled = any(set(pair) <= set(self.inputs) for pair in PRESSURE_PAIRS)
        model = model_named("pressure_lugre" if scaled else "lugre")
        self.lugre = AnalyticalEstimator(
            cylinder, model, self.inputs, effort=scaled_effort(identification_effort, seed)
        )
        self.lugre_scale_n = 1.0

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Identify LuGre, then fit the trees to its residual, on the same recordings."""
        self._begin_fit(recordings)
        count = min(self.identified_on, len(recordings))
        self.lugre.fit([recordings[int(number * len(recordings) / count)] for number in range(count)])
        labels = np.concatenate([recording.column("friction_n")[recording.usable()] for recording in recordings])
        self.lugre_scale_n = float(labels.std()) or 1.0
        return super().fit(recordings)

    def advance(self, state: LearnedState, samples: Array) -> Array:
        assert self._block is not None
        assert self.features is not None
        if self.passive_above_m_s == 0.0:
            return super().advance(state, samples)
        features, base_n = self._block.advance(state.features, samples)
        predicted = self.predict(state.memory, features).astype(np.float64)
        friction = np.asarray(base_n + self.target_mean_n + self.target_scale_n * predicted)
        column = self.features.names.index("velocity_m_s")
        front_end = self.features
        velocity = features[:, column].astype(np.float64) * front_end.scale[column] + front_end.mean[column]
        feeds = (np.abs(velocity) > self.passive_above_m_s) & (friction * velocity < 0.0)
        return np.where(feeds, 0.0, friction)

    def _set_features(self, features: FrontEnd) -> None:
        self.features = features
        self._block = LugreFeatureBlock(features, self.lugre, self.lugre_scale_n)

    def write_model(self, folder: Path) -> dict[str, Any]:
        settings = {name: getattr(self, name) for name in (*SETTINGS, "lugre_scale_n")}
        return super().write_model(folder) | settings | {"lugre": self.lugre._write(folder)}

    @classmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:
        settings = {name: content[name] for name in ("seed", *SETTINGS)}
        estimator = cls(cylinder, inputs, BoostingPlan(**content["plan"]), Past(**content["past"]), **settings)
        estimator.lugre = AnalyticalEstimator._read(folder, content["lugre"])
        estimator.lugre_scale_n = content["lugre_scale_n"]
        estimator._read_trees(folder, content)
        return estimator
