"""Which models there are, in the order of tables."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from friction_benchmark.registry.model import RegisteredModel

_ESTIMATORS = (
    "baselines", "analytical",
    "machado", "elman", "han",
    "ridge", "narx", "gradient_boosting", "lugre_residual", "disturbance_observer",
    "hybrid", "lstm", "gru", "tcn", "paper_hybrid",
    "learned_gain",
)  # fmt: skip
MODULES = tuple(f"friction_benchmark.registry.{name}" for name in _ESTIMATORS)
"""Modules that each hold their ``MODELS``."""


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
