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
Space = Mapping[str, Int | Float | OneOf]  # What tuning may choose from, ends included
Values = Mapping[str, Value]


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
    """Return whether a model that needs no more than the position can be built."""
    return "position_m" in inputs


def needs_raw_pressures(inputs: tuple[str, ...]) -> bool:
    """Return whether both raw pressures are there, besides the position."""
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
    # What is tried first: the source's values or our own best guess, one for each name in ``space``
    defaults: Values = field(default_factory=dict)
    supports: Callable[[tuple[str, ...]], bool] = needs_only_position  # Whether it can be built for given inputs
    trained_on: TrainedOn = "recordings"  # The task's recordings, or the simulated twin's with their true friction
    # Whether it learns the sensors' offset while running. Its training recordings then state their zeros, which the
    # labels show.
    learns_offset: bool = False
    chosen: str = ""  # What was taken where the source leaves a choice

    def __post_init__(self) -> None:
        if set(self.space) != set(self.defaults):
            raise ValueError(
                f"{self.name}: space has {sorted(self.space)}, but defaults have {sorted(self.defaults)}; expected "
                "equal names"
            )

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
    """Return the models of these modules by name, in order.

    Raises:
        ValueError: Two have one name.
    """
    found: dict[str, RegisteredModel] = {}
    for module in modules:
        for model in import_module(module).MODELS:
            if model.name in found:
                raise ValueError(f"registry: two models are called {model.name!r}; the second is in {module}")
            found[model.name] = model
    return found
