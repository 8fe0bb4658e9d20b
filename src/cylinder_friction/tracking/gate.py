"""The promotion gate: decide from the errors whether a candidate replaces the champion, and record the decision."""

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
"""Error by condition [percent of mean |friction|]; a file holds null for an error that is not finite."""


@dataclass(frozen=True)
class Candidate:
    """A trained estimator that may replace the champion, with the gate's decision once it is made."""

    model_name: str  # Name in the registry
    folder: str  # Folder of the saved estimator, relative to the repository's root
    model_md5: str  # DVC's hash of that folder
    errors_percent: Errors  # Error in each condition on the held-out recordings
    reference: Reference  # Reference of the errors: true friction or the label
    tolerance_percent: float  # Excess of an error in one condition that still counts as not worse [percentage points]
    data: dict[str, str]  # DVC's hash of each folder of its data, from the raw to the held-out data
    params: dict[str, Any]  # The parameters that shaped the model
    example: dict[str, list[float]]  # A few rows of raw samples, by column
    pipeline: dict[str, Any]  # Parameters of the pipeline's run: recipe, seeds, differences from the default recipe
    card: str = ""  # Model card for users, as Markdown
    # The decision, without time and version numbers: equal work gives equal bytes.
    promote: bool = False
    reason: str = "being decided"
    incumbent: Errors | None = None  # The champion's errors at the decision; None without a champion

    def to_dict(self) -> dict[str, Any]:
        return dict(TypeAdapter(Candidate).dump_python(self))

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        return TypeAdapter(cls).validate_python(content)

    def key(self) -> str:
        """Hash the model, its errors and its data; the hash identifies the candidate's version."""
        return json_hash([self.model_md5, self.reference, self.errors_percent, self.data])


def decide(
    candidate: Mapping[str, float], incumbent: Mapping[str, float] | None, tolerance_percent: float
) -> tuple[bool, str]:
    """Decide whether a candidate is promoted; also return the reason as a sentence for the registry.

    The gate promotes a candidate if there is no incumbent, or if its mean error over the conditions is smaller and no
    single condition is worse. One worse condition is enough to refuse: a controller works in one condition at a time,
    not in their average.

    Args:
        candidate: Error by condition [percent of mean |friction|], measured on the held-out recordings.
        incumbent: The champion's errors on the same recordings; None without a champion.
        tolerance_percent: Excess of an error in one condition that still counts as not worse [percentage points].
    """
    for who, errors in (("candidate", candidate), ("incumbent", incumbent or {})):
        for condition, error in sorted(errors.items()):
            if not math.isfinite(error):
                return False, f"refused: the {who}'s error in condition {condition} is {error}, but expected a number"
    if incumbent is None:
        return True, f"promoted: there is no incumbent; mean error {_mean(candidate):.3f} %"
    new, old = _mean(candidate), _mean(incumbent)
    means = f"mean error {new:.3f} % against the incumbent's {old:.3f} %"
    if not new < old:
        return False, f"refused: not better overall, {means}"
    excess = {name: candidate[name] - incumbent[name] for name in sorted(candidate)}
    worse = [
        f"condition {name}: {candidate[name]:.3f} % against {incumbent[name]:.3f} %"
        for name in excess
        if candidate[name] > incumbent[name] + tolerance_percent
    ]
    if worse:
        tolerance = f"(tolerance {tolerance_percent:g} percentage points)"
        return False, f"refused: worse in {'; '.join(worse)} {tolerance}, although better overall, {means}"
    tolerated = "".join(
        f"; worse in condition {name} by {points:.3f} percentage points, within the tolerance of {tolerance_percent:g}"
        for name, points in excess.items()
        if points > 0.0
    )
    return True, f"promoted: better overall, {means}{tolerated or '; worse in no condition'}"


def _mean(errors: Mapping[str, float]) -> float:
    return math.fsum(errors.values()) / len(errors)
