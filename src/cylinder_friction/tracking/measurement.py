"""When a run went on and what it cost the machine: kept on this machine, by the key of the run's record."""

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import psutil
from mlflow.entities import Metric

from cylinder_friction.run_record import RunRecord, Times, now_ms

FOLDER = Path(".cylinder-friction/runs")
"""One ``<key of the record>.json`` each; it differs with every run and machine, so DVC does not track it."""

SYSTEM_PREFIX = "system/"


@dataclass
class Measurement:
    """Processor and memory, sampled while a run goes on, and when it began and ended."""

    started_ms: int = field(default_factory=now_ms)
    ended_ms: int = 0
    samples: list[dict[str, float]] = field(default_factory=list)

    def keep(self, record: RunRecord, root: Path) -> None:
        """Write down what was measured of the run of a record, and the times that the record holds."""
        steps_ms = record.times.steps_ms if record.times else {}
        content = _times(replace(record, times=Times(self.started_ms, self.ended_ms, steps_ms)))
        path = root / FOLDER / f"{record.key()}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({**content, "samples": self.samples}), encoding="utf-8")


@contextmanager
def measured(interval_s: float = 1.0) -> Iterator[Measurement]:
    """Sample this process and its children until the block ends."""
    measurement, stop = Measurement(), threading.Event()
    arguments = (measurement.samples, stop, interval_s)
    thread = threading.Thread(target=_sample, args=arguments, daemon=True, name="resources")
    thread.start()
    try:
        yield measurement
    finally:
        stop.set()
        thread.join()
        measurement.ended_ms = now_ms()


def with_times(record: RunRecord, root: Path) -> tuple[RunRecord, list[Metric]]:
    """Return a record with its times, and its samples as MLflow metrics; neither where it ran on another machine."""
    try:
        content = json.loads((root / FOLDER / f"{record.key()}.json").read_text(encoding="utf-8"))
        samples = [
            Metric(SYSTEM_PREFIX + name, value, int(sample["time_ms"]), step)
            for step, sample in enumerate(content["samples"])
            for name, value in sample.items()
            if name != "time_ms"
        ]
        return _with_times(record, content), samples
    except (OSError, ValueError, KeyError, TypeError):
        return _with_times(record, {"times": asdict(Times(now_ms(), now_ms())), "children": []}), []


def times_of(record: RunRecord) -> Times:
    """Return the times of a record that has been given some."""
    assert record.times is not None
    return record.times


def _times(record: RunRecord) -> dict[str, Any]:
    times = None if record.times is None else asdict(record.times)
    return {"times": times, "children": [_times(child) for child in record.children]}


def _with_times(record: RunRecord, content: dict[str, Any]) -> RunRecord:
    """Return the record and its children with their times; a child without its own has those of its parent."""
    unknown: dict[str, Any] = {"times": {**content["times"], "steps_ms": {}}, "children": []}
    stored = content["children"] or [unknown] * len(record.children)
    children = tuple(
        _with_times(child, each if each["times"] else unknown)
        for child, each in zip(record.children, stored, strict=True)
    )
    return replace(record, times=Times(**content["times"]), children=children)


def _sample(samples: list[dict[str, float]], stop: threading.Event, interval_s: float) -> None:
    process = psutil.Process()
    psutil.cpu_percent()  # the first call only starts the clock
    while True:
        stopping = stop.wait(interval_s if samples else min(0.1, interval_s))
        memory = psutil.virtual_memory()
        samples.append(
            {
                "time_ms": float(now_ms()),
                "cpu_utilization_percentage": psutil.cpu_percent(),
                "system_memory_usage_percentage": memory.percent,
                "system_memory_usage_megabytes": (memory.total - memory.available) / 1e6,
                "stage_memory_megabytes": _resident_bytes(process) / 1e6,
            }
        )
        if stopping:
            return


def _resident_bytes(process: psutil.Process) -> int:
    total = 0
    for one in [process, *process.children(recursive=True)]:
        try:
            total += one.memory_info().rss
        except psutil.Error:
            continue  # it ended while being looked at
    return total
