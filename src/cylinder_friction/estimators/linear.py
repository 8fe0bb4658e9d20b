"""Estimators that are linear in lagged raw samples: the force balance, its low-pass, and ridge regression.

Every learned estimator is compared with them: pressures times areas already are the label, apart from noise.
"""

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
from scipy.optimize import minimize_scalar

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.unmodelled_force import balance_weights
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals import causal
from cylinder_friction.signals.least_squares import least_squares

PAPER_WINDOW = 10
PAPER_ACCELERATION_WINDOW = 30
FORGOTTEN = 1e-12
"""A low-pass's response is cut once the rest weighs less than this share of its largest value."""


def force_balance_taps(cylinder: Cylinder, inputs: Sequence[str] = SAMPLE_COLUMNS) -> Array:
    """Build the taps, shape ``(1, inputs, 1)``, of P1·A1 - P2·A2 - F_load [N] on raw samples.

    They ignore inertia (about 1 N), and the load if ``load_force_n`` is not among the inputs.

    Raises:
        ValueError: A raw pressure or the position is not among the inputs.

    Example:
        >>> from cylinder_friction.estimators.linear import force_balance_taps
        >>> force_balance_taps(cylinder).shape
        (1, 3, 1)
        >>> float(force_balance_taps(cylinder)[0, 0, 0]) == cylinder.piston_area_m2
        True
    """
    refuse_missing_inputs(inputs)
    return np.array(balance_weights(cylinder, inputs))[None, :, None]


def paper_force_balance_taps(cylinder: Cylinder, sample_time_s: float, inputs: Sequence[str] = SAMPLE_COLUMNS) -> Array:
    """Build the taps, shape ``(1, inputs, length)``, of P1·A1 - P2·A2 - m·a - F_load [N] with the paper's filters.

    A causal moving average of 10 samples smooths forces and position. Acceleration is the second difference of the
    position, smoothed by a moving average of 30 samples.

    Example:
        >>> from cylinder_friction.estimators.linear import paper_force_balance_taps
        >>> paper_force_balance_taps(cylinder, sample_time_s=0.005).shape  # 10 + 1 + 1 + 30 samples, less 3
        (1, 3, 41)
    """
    average = causal.moving_average_taps(PAPER_WINDOW)
    difference = causal.difference_taps(sample_time_s)
    acceleration = causal.cascade_taps(
        average, difference, difference, causal.moving_average_taps(PAPER_ACCELERATION_WINDOW)
    )
    taps = np.zeros((1, len(inputs), len(acceleration)))
    taps[:, :, :PAPER_WINDOW] = force_balance_taps(cylinder, inputs) * average
    taps[0, list(inputs).index("position_m")] = -cylinder.moving_mass_kg * acceleration
    return taps


def low_pass_balance_taps(
    cylinder: Cylinder, recordings: Sequence[Recording], inputs: Sequence[str] = SAMPLE_COLUMNS
) -> Array:
    """Tune the low-pass of ``LowPassForceBalanceEstimator``; return its taps, shape ``(1, inputs, lags)``.

    Example:
        >>> from cylinder_friction.estimators.linear import low_pass_balance_taps
        >>> low_pass_balance_taps(cylinder, train).shape[:2]
        (1, 3)
    """
    taps = force_balance_taps(cylinder, inputs)
    return taps * low_pass_response(_tuned_weight(causal.FirFilter(taps), recordings, inputs))


def low_pass_response(weight: float) -> Array:
    """Compute the impulse response of a first-order low-pass, cut once the rest is negligible (``FORGOTTEN``)."""
    length = 1 if weight >= 1.0 else 1 + int(np.log(FORGOTTEN) / np.log1p(-weight))
    return np.asarray(weight * (1.0 - weight) ** np.arange(length))


def _tuned_weight(balance: causal.FirFilter, recordings: Sequence[Recording], inputs: Sequence[str]) -> float:
    """Find the low-pass weight with the smallest mean absolute error of the balance in usable rows."""
    labels, masks = labelled_rows(recordings)
    forces = [balance.run(recording.samples(inputs)) for recording in recordings]

    def error(weight: float) -> float:
        low_pass = causal.ExponentialLowPass(weight)
        smooth = [low_pass.advance(low_pass.new_state(), force)[:, 0] for force in forces]
        estimates = np.concatenate([values[mask] for values, mask in zip(smooth, masks, strict=True)])
        return float(np.mean(np.abs(estimates - labels)))

    return float(minimize_scalar(error, bounds=(0.01, 1.0), method="bounded", options={"xatol": 1e-3}).x)


def refuse_missing_inputs(inputs: Sequence[str]) -> None:
    """Raise ``ValueError`` if a raw pressure or the position is missing among the inputs.

    Call it in an estimator of your own that computes the force balance from both pressures [Pa, gauge].

    Example:
        >>> from cylinder_friction.estimators.linear import refuse_missing_inputs
        >>> refuse_missing_inputs(("pressure_1_pa", "pressure_2_pa", "position_m", "load_force_n"))  # all there
    """
    if not set(SAMPLE_COLUMNS) <= set(inputs):
        raise ValueError(f"expected {', '.join(SAMPLE_COLUMNS)} among the inputs, but got {tuple(inputs)}")


def labelled_rows(recordings: Sequence[Recording]) -> tuple[Array, list[Any]]:
    """Collect the labels [N] of all usable rows, one after the other, and each recording's mask.

    Use it to fit an estimator of your own by least squares: each mask, shape ``(rows,)``, selects the same rows of the
    recording's features. Recordings must have ``friction_n`` and ``usable``, as ``label`` makes them.

    Example:
        >>> from cylinder_friction.estimators.linear import labelled_rows
        >>> labels_n, masks = labelled_rows(train)
        >>> len(labels_n) == sum(int(mask.sum()) for mask in masks)
        True
    """
    masks = [recording.usable() for recording in recordings]
    labels = [recording.column("friction_n")[mask] for recording, mask in zip(recordings, masks, strict=True)]
    return np.concatenate(labels), masks


class LinearEstimator(FrictionEstimator):
    """Base of estimators that are one FIR filter on raw samples plus a constant [N].

    A subclass sets ``_taps`` and ``_constant_n`` in ``fit``. Estimate, stream, real-time step and exports to C and
    FMU follow from these two. A step costs one multiplication per input and lag, and is exact in every runtime.
    """

    def __init__(self, inputs: Sequence[str]) -> None:
        super().__init__(inputs)
        self._taps, self._constant_n = np.zeros((len(self.inputs), 1)), 0.0

    @property
    def taps(self) -> Array:
        """Taps on raw samples, shape ``(channels, lags)``."""
        self._refuse_unfitted()
        return self._taps

    def multiply_adds(self) -> int:
        return int(np.count_nonzero(self.taps))

    def step_model(self) -> StepModel:
        """Return what one real-time step needs; see ``FrictionEstimator.step_model``."""
        self._refuse_unfitted()
        return self._step_model(base_taps=self.taps, target_mean_n=self._constant_n)


class ForceBalanceEstimator(LinearEstimator):
    """The equation of motion, causally: P1·A1 - P2·A2 - F_load, unfiltered or through the paper's moving averages.

    Args:
        cylinder: Its areas and moving mass.
        filtering: ``none`` takes raw samples; ``paper`` the paper's windows of 10 and 30 samples.
        inputs: Columns of a sample; both raw pressures and the position must be among them, and ``load_force_n``
            for the load.

    Compare every learned estimator with it. It costs two multiplications per sample, and passes on all sensor noise.

    Example:
        >>> from cylinder_friction.estimators.linear import ForceBalanceEstimator
        >>> balance = ForceBalanceEstimator(cylinder, filtering="paper").fit(train)
        >>> balance.estimate(test[0]).shape == (len(test[0]),)
        True
    """

    kind: ClassVar[str] = "force_balance"
    shown: ClassVar[tuple[str, ...]] = ("filtering",)

    def __init__(
        self,
        cylinder: Cylinder,
        filtering: Literal["none", "paper"] = "none",
        inputs: Sequence[str] = SAMPLE_COLUMNS,
    ) -> None:
        super().__init__(inputs)
        if filtering not in ("none", "paper"):
            raise ValueError(f"filtering must be 'none' or 'paper', but got {filtering!r}")
        refuse_missing_inputs(inputs)
        self.cylinder = cylinder
        self.filtering = filtering

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Take the sample time from the recordings; there is nothing else to learn."""
        self._begin_fit(recordings)
        return self

    @property
    def taps(self) -> Array:
        self._refuse_unfitted()
        assert self.sample_time_s is not None
        if self.filtering == "none":
            return force_balance_taps(self.cylinder, self.channels)[0]
        return paper_force_balance_taps(self.cylinder, self.sample_time_s, self.channels)[0]

    def _write(self, folder: Path) -> dict[str, Any]:  # noqa: ARG002 - everything is JSON
        return {"cylinder": self.cylinder.to_dict(), "filtering": self.filtering}

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:  # noqa: ARG003
        return cls(Cylinder(**parameters["cylinder"]), parameters["filtering"])


class LowPassForceBalanceEstimator(FrictionEstimator):
    """P1·A1 - P2·A2 - F_load through a first-order low-pass whose weight is tuned on the training labels.

    Args:
        cylinder: Its areas.
        weight: Share of the new sample, in (0, 1]; None until tuned by ``fit``.
        inputs: Columns of a sample; both raw pressures and the position must be among them, and ``load_force_n``
            for the load.

    Use it if raw pressures are available and time or memory is scarce: no simpler estimator is more accurate.

    Example:
        >>> from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
        >>> low_pass = LowPassForceBalanceEstimator(cylinder).fit(train)
        >>> 0.0 < low_pass.weight <= 1.0
        True
    """

    kind: ClassVar[str] = "low_pass_force_balance"
    shown: ClassVar[tuple[str, ...]] = ("weight",)

    def __init__(self, cylinder: Cylinder, weight: float | None = None, inputs: Sequence[str] = SAMPLE_COLUMNS) -> None:
        super().__init__(inputs)
        refuse_missing_inputs(inputs)
        self.cylinder = cylinder
        self.weight = weight

    @cached_property
    def _balance(self) -> causal.FirFilter:
        return causal.FirFilter(force_balance_taps(self.cylinder, self.channels))

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Choose the weight with the smallest mean absolute error on the usable rows."""
        self.weight = _tuned_weight(self._balance, self._begin_fit(recordings), self.channels)
        return self

    def new_state(self) -> causal.LowPassState:
        return causal.LowPassState()

    def advance(self, state: causal.LowPassState, samples: Array) -> Array:
        assert self.weight is not None
        return causal.ExponentialLowPass(self.weight).advance(state, self._balance.run(samples))[:, 0]

    def multiply_adds(self) -> int:
        return 3

    def step_model(self) -> StepModel:
        """Describe one real-time step, see ``low_pass_response``."""
        self._refuse_unfitted()
        assert self.weight is not None
        return self._step_model(base_taps=self._balance.taps[0] * low_pass_response(self.weight))

    def _write(self, folder: Path) -> dict[str, Any]:  # noqa: ARG002
        return {"cylinder": self.cylinder.to_dict(), "weight": self.weight}

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:  # noqa: ARG003
        return cls(Cylinder(**parameters["cylinder"]), parameters["weight"])


class RidgeEstimator(LinearEstimator):
    """Ridge regression (Hoerl and Kennard 1970) of the label on the last ``lags`` raw samples of every input.

    Args:
        lags: Number of samples that it reads, the present one included.
        penalty: Weight of the squared coefficients, in standardised units.
        inputs: Columns of a sample.

    Use it as the best linear baseline, and if a controller can spare ``lags`` multiplications per input. It needs no
    cylinder, learns the areas from the labels, and fits in seconds. A step costs ``lags * inputs`` multiplications.

    Example:
        >>> ridge = cf.RidgeEstimator(lags=20).fit(train)
        >>> ridge.estimate(test[0]).shape == (len(test[0]),)
        True
    """

    kind: ClassVar[str] = "ridge"
    shown: ClassVar[tuple[str, ...]] = ("lags", "penalty")

    def __init__(self, lags: int = 20, penalty: float = 1.0, inputs: Sequence[str] = SAMPLE_COLUMNS) -> None:
        super().__init__(inputs)
        if lags < 1:
            raise ValueError(f"lags must be at least 1 sample, but got {lags!r}")
        self.lags = lags
        self.penalty = penalty

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Solve the normal equations on all usable rows."""
        recordings = self._begin_fit(recordings)
        labels, masks = labelled_rows(recordings)
        rows = np.concatenate(
            [
                self._lagged(recording.samples(self.channels))[mask]
                for recording, mask in zip(recordings, masks, strict=True)
            ]
        )
        mean, scale = rows.mean(axis=0), rows.std(axis=0)
        scale[scale == 0.0] = 1.0
        mean_n = float(labels.mean())
        coefficients = least_squares((rows - mean) / scale, labels - mean_n, self.penalty) / scale
        self._taps = coefficients.reshape(len(self.channels), self.lags)
        self._constant_n = mean_n - float((coefficients * mean).sum())
        return self

    def _lagged(self, samples: Array) -> Array:
        """Lay out each row's last samples, column by column, newest first; shape ``(n, channels · lags)``."""
        padded = np.concatenate([np.repeat(samples[:1], self.lags - 1, axis=0), samples])
        windows = np.lib.stride_tricks.sliding_window_view(padded, self.lags, axis=0)[:, :, ::-1]
        return windows.reshape(len(samples), -1)

    def _write(self, folder: Path) -> dict[str, Any]:  # noqa: ARG002
        return {
            "lags": self.lags,
            "penalty": self.penalty,
            "taps": self.taps.tolist(),
            "intercept_n": self._constant_n,
        }

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:  # noqa: ARG003
        estimator = cls(parameters["lags"], parameters["penalty"])
        estimator._taps = np.array(parameters["taps"])
        estimator._constant_n = parameters["intercept_n"]
        return estimator
