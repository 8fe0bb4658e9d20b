"""The finals of a search: the best trials of each size of network are trained longer, from several seeds."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from cylinder_friction.tuning.search import Trial, Values


@dataclass(frozen=True)
class Final:
    """A candidate of the finals."""

    params: Values  # The hyperparameters
    errors_n: tuple[float, ...]  # Validation mean absolute error of the whole hybrid [N], one per seed
    multiply_adds: int  # Of one step

    @property
    def error_n(self) -> float:
        """Mean over the seeds [N]."""
        return sum(self.errors_n) / len(self.errors_n)

    def to_dict(self) -> dict[str, Any]:
        """Collect the content as JSON-compatible values."""
        return asdict(self)


def finalists(trials: Sequence[Trial], count: int) -> list[Trial]:
    """Choose the best complete trial of each size of network, at most ``count``, best first.

    A search trains briefly, so that small networks, which learn faster, look as good as larger ones.

    Raises:
        ValueError: No trial was completed.
    """
    complete = [each for each in trials if each.value is not None]
    if not complete:
        states = sorted({trial.state for trial in trials})
        raise ValueError(
            f"search: none of {len(trials)} trials was completed (states {states}); raise maximum_multiply_adds "
            "or narrow the space"
        )
    of_size: dict[tuple[float, float], Trial] = {}
    for trial in sorted(complete, key=lambda each: each.value or 0.0):
        of_size.setdefault((trial.params["layers"], trial.params["nodes"]), trial)
    return list(of_size.values())[:count]


def best_final(finals: Sequence[Final]) -> Final:
    """Choose the final with the smallest error, the earliest of equals."""
    return min(finals, key=lambda final: final.error_n)
