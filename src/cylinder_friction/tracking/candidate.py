"""Who asks for the champion's place, who held it, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Self

from cylinder_friction.tracking.versions import Origin

Errors = dict[str, float]  # Error by condition [percent of mean |friction|], against the candidate's ``reference``


@dataclass(frozen=True)
class Candidate:
    """A trained estimator that asks for the champion's place."""

    model_name: str  # Name in the registry
    folder: str  # Folder of the saved estimator, relative to the repository's root
    model_key: str  # Hash of that folder's content
    errors_percent: Errors  # Its error in each condition on the held-out recordings
    test_data_md5: str  # Hash of these recordings
    origin: Origin  # What it was made from
    example: dict[str, list[float]]  # A few rows of raw samples, by column
    reference: Literal["label", "truth"] = "label"  # What its errors are measured against


@dataclass(frozen=True)
class Incumbent:
    """The model in use when the gate decided."""

    model_key: str
    errors_percent: Errors


@dataclass(frozen=True)
class Registered:
    """What a registration came to, without time and version numbers: equal work gives equal bytes."""

    candidate: Candidate
    alias: str
    promote: bool
    reason: str
    tolerance_percent: float
    incumbent: Incumbent | None

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        stored = content["candidate"]
        candidate = Candidate(**{**stored, "origin": Origin(**stored["origin"])})
        incumbent = None if content["incumbent"] is None else Incumbent(**content["incumbent"])
        return cls(**{**content, "candidate": candidate, "incumbent": incumbent})
