"""What a stage did, as a file: the one source from which its MLflow run is logged, now or later."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Self

Scalar = str | int | float | bool
Table = dict[str, list[Any]]
"""A table by columns of equal length: texts, numbers, or None."""

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
RUNS_FOLDER = Path("reports/runs")
"""One ``<stage>.json`` each: the stage's ``RunRecord``."""

_ADDED_LATER = ("tables", "note", "experiment", "code", "times")
_BRANCHES = {"search": "hybrid", "train": "hybrid", "baselines": "baselines", "lugre": "lugre"}


def comes_after(later: str, earlier: str) -> bool:
    """Return whether a stage depends on another one, be it through stages between."""
    if earlier not in STAGES or later not in STAGES or STAGES.index(later) <= STAGES.index(earlier):
        return False
    branches = _BRANCHES.get(later), _BRANCHES.get(earlier)
    return None in branches or branches[0] == branches[1]


def records_in(root: Path) -> dict[str, RunRecord]:
    """Return the records of the stages that lie in a repository, by stage; one that cannot be read is left out."""
    records = {}
    for stage in STAGES:
        try:
            content = json.loads((root / RUNS_FOLDER / f"{stage}.json").read_text(encoding="utf-8"))
            records[stage] = RunRecord.from_dict(content)
        except (OSError, ValueError, TypeError, AttributeError, RecursionError):
            continue
    return records


def now_ms() -> int:
    """Return the time of day [ms since 1970]."""
    return time.time_ns() // 1_000_000


def by_columns(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Return rows as a table; None where a row lacks a column or has no finite number in it."""
    rows = list(rows)
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [_finite(row.get(name)) for row in rows] for name in names}


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass(frozen=True)
class Times:
    """When a run went on [ms since 1970]."""

    started_ms: int
    ended_ms: int
    steps_ms: dict[str, list[int]] = field(default_factory=dict)  # Of the last values of a curve, by its name


@dataclass(frozen=True)
class Dataset:
    """A folder of recordings that a stage read or wrote."""

    path: str  # Relative to the repository's root
    sha256: str  # Of all its bytes
    columns: dict[str, str]  # Type of each column, as Arrow names it
    rows: int
    written: bool = False


@dataclass(frozen=True)
class RunRecord:
    """What a stage did. It holds no time of day and no absolute path: equal work gives an equal record.

    Attributes:
        name: The stage, or the trial of a search.
        params: Its parameters.
        metrics: What came out: one number each; what comes before a ``/`` in a name groups them.
        curves: What came out step by step: a list per name, one value per step (epoch, trial).
        tables: What came out by condition, estimator, ...
        note: What came out in words, as Markdown.
        tags: Further words about it.
        artifacts: Files and folders to log, relative to the repository root, each with the hash of its bytes.
        datasets: Recordings it read or wrote, by role (train, validation, test).
        children: Runs below it, for example the trials of a search.
        code: Hash of the code that ran, of the stage's module and all that it imports; empty where it is not known.
        experiment: Which of the project's MLflow experiments it lies in, empty for the main one; children lie with
            their parent in any case.
        times: When it went on, which is no part of the record: neither of its file nor of its key.
    """

    name: str
    params: dict[str, Scalar] = field(default_factory=dict)
    metrics: dict[str, float] = field(default_factory=dict)
    curves: dict[str, list[float]] = field(default_factory=dict)
    tables: dict[str, Table] = field(default_factory=dict)
    note: str = ""
    tags: dict[str, str] = field(default_factory=dict)
    artifacts: dict[str, str] = field(default_factory=dict)
    datasets: dict[str, Dataset] = field(default_factory=dict)
    children: tuple[RunRecord, ...] = ()
    experiment: str = ""
    code: str = ""
    times: Times | None = field(default=None, compare=False)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of its file; of what was added later, what is empty is left out."""
        content = {**asdict(replace(self, times=None)), "children": [child.to_dict() for child in self.children]}
        return {key: value for key, value in content.items() if value or key not in _ADDED_LATER}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        children = tuple(cls.from_dict(child) for child in content.get("children", ()))
        datasets = {role: Dataset(**each) for role, each in content.get("datasets", {}).items()}
        return cls(**{**content, "children": children, "datasets": datasets})

    def key(self) -> str:
        """Return the hash of the content: two records with one key are one run."""
        return hashlib.sha256(json.dumps(self.to_dict(), sort_keys=True).encode()).hexdigest()
