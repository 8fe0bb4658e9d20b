"""What a stage did, as a file: the one source from which its MLflow run is logged, now or later."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from typing import Any, Self

Scalar = str | int | float | bool

STAGES = (
    "record",
    "ingest",
    "filter",
    "label",
    "split",
    "offset",
    "search",
    "train",
    "baselines",
    "lugre",
    "compare",
    "register",
)
"""The stages of the pipeline, in its order."""


@dataclass(frozen=True)
class RunRecord:
    """What a stage did. It holds no time of day and no absolute path: equal work gives an equal record.

    Attributes:
        name: The stage, or the trial of a search.
        params: Its parameters.
        metrics: What came out: one number each.
        curves: What came out step by step: a list per name, one value per step (epoch, trial).
        tags: Further words about it.
        artifacts: Files and folders to log, relative to the repository root, each with the hash of its bytes.
        datasets: Recordings it used: a role (train, validation, test) to a hash of all their bytes.
        children: Runs below it, for example the trials of a search.
        code: Hash of the code that ran, of the stage's module and all that it imports; empty where it is not known.
        experiment: Which of the project's MLflow experiments it lies in, empty for the main one; children lie with
            their parent in any case.
    """

    name: str
    params: dict[str, Scalar] = field(default_factory=dict)
    metrics: dict[str, float] = field(default_factory=dict)
    curves: dict[str, list[float]] = field(default_factory=dict)
    tags: dict[str, str] = field(default_factory=dict)
    artifacts: dict[str, str] = field(default_factory=dict)
    datasets: dict[str, str] = field(default_factory=dict)
    children: tuple[RunRecord, ...] = ()
    experiment: str = ""
    code: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the content of its file. What is empty in the last two is not written down: older files lack them."""
        content = {**asdict(self), "children": [child.to_dict() for child in self.children]}
        return {key: value for key, value in content.items() if value or key not in ("experiment", "code")}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        children = tuple(cls.from_dict(child) for child in content.get("children", ()))
        return cls(**{**content, "children": children})

    def key(self) -> str:
        """Return the hash of the content: two records with one key are one run."""
        return hashlib.sha256(json.dumps(self.to_dict(), sort_keys=True).encode()).hexdigest()
