"""The record of a stage as a file: the only source of its MLflow run, whether it is logged now or later."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

from cylinder_friction.execution.measuring import Took, now_ms
from cylinder_friction.files.whole_files import json_hash, read_json

Scalar = str | int | float | bool
Table = dict[str, list[Any]]  # Columns of equal length, with text, numbers or None

STAGES = (
    "record", "ingest", "filter", "label", "split", "offset",
    "search", "train", "baselines", "lugre", "compare", "register",
)  # fmt: skip
"""The stages of the pipeline, in its order."""
RUNS_FOLDER = Path("reports/runs")  # Folder with the ``RunRecord`` of each stage as ``<stage>.json``
_CIRCUMSTANCES = ("took", "commit", "pipeline")
"""Fields that are ignored in comparisons of records: equal results at another commit are the same run."""


def records_in(root: Path) -> dict[str, RunRecord]:
    """Read the records of the stages in a repository, by stage; leave out records that cannot be read."""
    records = {}
    for stage in STAGES:
        with suppress(OSError, ValueError, TypeError, AttributeError):  # missing, or cut off
            records[stage] = RunRecord.from_dict(read_json(root / RUNS_FOLDER / f"{stage}.json"))
    return records


def by_columns(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Turn rows into a table; a missing or non-finite value becomes None."""
    rows = list(rows)
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [_finite(row.get(name)) for row in rows] for name in names}


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass(frozen=True)
class Dataset:
    """A folder of recordings that a stage read."""

    path: str  # Relative to the repository's root
    md5: str  # DVC's hash of the folder
    columns: dict[str, str]  # Type of each column, as Arrow names it
    rows: int


@dataclass(frozen=True)
class RunRecord:
    """What a stage did. Equal work gives records with equal keys."""

    name: str  # Name of the stage, or of the trial of a search
    params: dict[str, Scalar] = field(default_factory=dict)  # Parameters of the stage
    metrics: dict[str, float] = field(default_factory=dict)  # Results; the part of a name before ``/`` groups them
    curves: dict[str, list[float]] = field(default_factory=dict)  # Results by step (epoch or trial)
    tables: dict[str, Table] = field(default_factory=dict)  # Results as tables, for example by condition or estimator
    note: str = ""  # Results in words, as Markdown
    tags: dict[str, str] = field(default_factory=dict)  # Further tags of the run
    artifacts: tuple[str, ...] = ()  # Files and folders to log, relative to the repository root
    datasets: dict[str, Dataset] = field(default_factory=dict)  # Recordings that the stage read, by role (train, ...)
    children: tuple[RunRecord, ...] = ()  # Runs below this one, for example the trials of a search
    experiment: str = ""  # MLflow experiment: the recipe's name, or empty for the default recipe
    # The key leaves out the circumstances: when the stage ran and what it cost, its commit as tags of the run, and from
    # ``compare`` and ``register`` the parameters of the pipeline's run: recipe, seeds, differences from the default.
    took: Took = field(default_factory=lambda: Took(now_ms(), now_ms()), compare=False)
    commit: dict[str, str] = field(default_factory=dict)
    pipeline: dict[str, Scalar] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Collect the content of the record's file, without empty fields."""
        content = {**asdict(self), "children": [child.to_dict() for child in self.children]}
        return {key: value for key, value in content.items() if value}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        given = dict(content)
        given["children"] = tuple(cls.from_dict(child) for child in given.get("children", ()))
        given["datasets"] = {role: Dataset(**each) for role, each in given.get("datasets", {}).items()}
        given["artifacts"] = tuple(given.get("artifacts", ()))
        return cls(**given | ({"took": Took(**given["took"])} if "took" in given else {}))

    def key(self) -> str:
        """Hash the work that was done: two records with equal keys are the same run."""
        work = {name: value for name, value in self.to_dict().items() if name not in _CIRCUMSTANCES}
        return json_hash({**work, "children": [child.key() for child in self.children]})
