"""The model registry: how each model is built, what may be tuned in it, and where it comes from."""

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Literal, Protocol, Self

from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording

Value = float | int | str
Family = Literal["baseline", "analytical", "related work", "modern"]
TrainedOn = Literal["recordings", "twin"]


class Estimator(Protocol):
    """What the benchmark needs of a model: its own (``models.base.Model``) and the product's estimators have it."""

    inputs: tuple[str, ...]

    @abstractmethod
    def fit(self, recordings: Sequence[Recording], /) -> Self:
        """Learn from the usable rows of labelled recordings, and return the model itself."""

    @abstractmethod
    def estimate(self, recording: Recording, /) -> Array:
        """Return friction [N] at each sample, shape ``(n,)``; each value depends on samples until then alone."""

    @abstractmethod
    def multiply_adds(self) -> int:
        """Return the multiply-adds of one sample, the usual measure of a network's cost."""


Float = FloatDistribution
Int = IntDistribution
OneOf = CategoricalDistribution
Values = Mapping[str, Value]
Space = Mapping[str, tuple[Int | Float | OneOf, Value]]
"""What tuning may choose from, ends included, and what it tries first: the source's value or our own best guess."""


@dataclass(frozen=True)
class BuildConfiguration:
    """What an estimator is built from."""

    cylinder: Cylinder  # Its areas and moving mass
    inputs: tuple[str, ...]  # The columns that the task shows
    seed: int  # Seeds everything random in it
    effort: float  # Share of the full training it may spend, in (0, 1]; each model states what it cuts
    hyperparameters: Values  # One value for each name in the model's ``space``

    def share(self, full: float, least: int = 1) -> int:
        """Return this effort's share of what full training spends, at least ``least``."""
        return max(least, round(self.effort * full))

    def number(self, name: str) -> float:
        return float(self.hyperparameters[name])

    def whole(self, name: str) -> int:
        return int(self.hyperparameters[name])


def needs_only_position(inputs: tuple[str, ...]) -> bool:
    return "position_m" in inputs


def needs_raw_pressures(inputs: tuple[str, ...]) -> bool:
    return set(SAMPLE_COLUMNS) <= set(inputs)


@dataclass(frozen=True)
class RegisteredModel:
    """One model of the benchmark."""

    name: str  # In files and tables
    title: str  # In words
    family: Family  # Where it stands in the leaderboard's legend
    source: str  # Author and year
    # Returns the estimator, not yet fitted. Importable, because worker processes receive it by name.
    build: Callable[[BuildConfiguration], Estimator]
    space: Space = field(default_factory=dict)  # What is tuned, and where
    supports: Callable[[tuple[str, ...]], bool] = needs_only_position  # Whether it can be built for given inputs
    trained_on: TrainedOn = "recordings"  # The task's recordings, or the simulated twin's with their true friction
    # Whether it learns the sensors' offset while running. Its training recordings then state the zeros in their labels.
    learns_offset: bool = False
    chosen: str = ""  # What was taken where the source leaves a choice

    @property
    def defaults(self) -> Values:
        return {name: first for name, (_, first) in self.space.items()}

    @property
    def module(self) -> str:
        """The module that builds it; with all that this imports, it decides what the model does."""
        return str(getattr(self.build, "func", self.build).__module__)


_IN_ORDER = (
    "baselines", "analytical",
    "machado", "elman", "han",
    "narx", "gradient_boosting", "lugre_residual", "disturbance_observer",
    "product_estimators", "gru", "tcn",
    "learned_gain",
)  # fmt: skip
MODULES = tuple(f"friction_benchmark.models.{name}" for name in _IN_ORDER)
"""Modules that each hold their ``MODELS``, in the order of tables."""


def registered_models(modules: Sequence[str] = MODULES) -> dict[str, RegisteredModel]:
    """Return the models of these modules by name, in order; raises ``ValueError`` if two have one name."""
    found: dict[str, RegisteredModel] = {}
    for module in modules:
        for model in import_module(module).MODELS:
            if model.name in found:
                raise ValueError(f"registry: two models are called {model.name!r}; the second is in {module}")
            found[model.name] = model
    return found
