"""The promotion gate: may a candidate take the incumbent's place? A pure function of their figures, and its record."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, PlainSerializer, TypeAdapter

from cylinder_friction.evaluation.reported import Reference
from cylinder_friction.files.whole_files import json_hash

_Error = Annotated[
    float,
    BeforeValidator(lambda value: math.nan if value is None else value),
    PlainSerializer(lambda value: value if math.isfinite(value) else None),
]
Errors = dict[str, _Error]
"""Error by condition [percent of mean |friction|], against the candidate's ``reference``; null in a file if it is no
number."""


@dataclass(frozen=True)
class Candidate:
    """A trained estimator that asks for the champion's place."""

    model_name: str  # Name in the registry
    folder: str  # Folder of the saved estimator, relative to the repository's root
    model_md5: str  # DVC's hash of that folder
    errors_percent: Errors  # Its error in each condition on the held-out recordings
    reference: Reference  # What its errors are measured against
    tolerance_percent: float  # Of the gate: how many percentage points worse in one condition count as not worse
    data: dict[str, str]  # DVC's hash of each folder of its data, from the raw one to the held-out one
    params: dict[str, Any]  # The parameters that shaped it
    example: dict[str, list[float]]  # A few rows of raw samples, by column
    recipe: str = "default"
    card: str = ""  # What a user of the model has to know, as Markdown

    def key(self) -> str:
        """Return the hash by which a candidate's version is recognised: of the model, its errors and its data."""
        return json_hash([self.model_md5, self.reference, self.errors_percent, self.data])

    def error_words(self) -> str:
        """Return the mean error and what it is measured against."""
        return f"{_mean(self.errors_percent):.3f} against {self.reference}"


@dataclass(frozen=True)
class Incumbent:
    """The model in use when the gate decided."""

    model_md5: str
    errors_percent: Errors


@dataclass(frozen=True)
class Registered:
    """What a registration came to, without time and version numbers: equal work gives equal bytes."""

    candidate: Candidate
    alias: str
    promote: bool
    reason: str
    incumbent: Incumbent | None

    def to_dict(self) -> dict[str, Any]:
        """Return the content of its file."""
        content: dict[str, Any] = TypeAdapter(Registered).dump_python(self)
        return content

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        return TypeAdapter(cls).validate_python(content)


@dataclass(frozen=True)
class Decision:
    """What the gate decided, and why, in words that stand in the registry."""

    promote: bool
    reason: str


def decide(candidate: Mapping[str, float], incumbent: Mapping[str, float] | None, tolerance_percent: float) -> Decision:
    """Decide whether a candidate is promoted.

    A candidate is promoted when there is no incumbent, or when it is better overall (mean over the conditions) and in
    no single one worse. A regression in one refuses it however good the mean: a controller works in one
    operating condition at a time, not in their average.

    Args:
        candidate: Error by condition [percent of mean |friction|], measured on the held-out recordings.
        incumbent: The same of the model in use, on the same recordings; None where there is none.
        tolerance_percent: How many percentage points worse in one condition still count as not worse.

    Raises:
        ValueError: The tolerance is negative or not finite.
    """
    if not (math.isfinite(tolerance_percent) and tolerance_percent >= 0.0):
        raise ValueError(f"tolerance_percent must be a number not below 0, but got {tolerance_percent!r}")
    problem = _problem(
        {"candidate": candidate} if incumbent is None else {"candidate": candidate, "incumbent": incumbent}
    )
    if problem is not None:
        return Decision(False, f"refused: {problem}")
    if incumbent is None:
        return Decision(True, f"promoted: there is no incumbent; mean error {_mean(candidate):.3f} %")
    new, old = _mean(candidate), _mean(incumbent)
    means = f"mean error {new:.3f} % against the incumbent's {old:.3f} %"
    worse = [
        f"condition {condition}: {candidate[condition]:.3f} % against {incumbent[condition]:.3f} %"
        for condition in sorted(candidate)
        if candidate[condition] > incumbent[condition] + tolerance_percent
    ]
    if not new < old:
        return Decision(False, f"refused: not better overall, {means}")
    if worse:
        return Decision(
            False,
            f"refused: worse in {'; '.join(worse)} (tolerance {tolerance_percent:g} percentage points), "
            f"although better overall, {means}",
        )
    tolerated = "".join(
        f"; worse in condition {condition} by {candidate[condition] - incumbent[condition]:.3f} percentage points, "
        f"within the tolerance of {tolerance_percent:g}"
        for condition in sorted(candidate)
        if candidate[condition] > incumbent[condition]
    )
    return Decision(True, f"promoted: better overall, {means}{tolerated or '; worse in no condition'}")


def _problem(compared: Mapping[str, Mapping[str, float]]) -> str | None:
    """Return why these errors, by model and condition, cannot be compared."""
    for who, errors in compared.items():
        if not errors:
            return f"the {who} has no error in any condition; run the compare stage"
        for condition, error in sorted(errors.items()):
            if not (math.isfinite(error) and error >= 0.0):
                return f"the {who}'s error in condition {condition} is {error}, but expected a number not below 0"
    for who, errors in compared.items():
        missing = sorted(set().union(*compared.values()) - set(errors))
        if missing:
            return f"the {who} has no error in condition {', '.join(missing)}; both need the same conditions"
    return None


def _mean(errors: Mapping[str, float]) -> float:
    return math.fsum(errors.values()) / len(errors)
