"""What a stage cost the machine: processor and memory, sampled while it runs, for MLflow's system metrics."""

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
from mlflow.entities import Metric

from cylinder_friction.run_record import RunRecord

RESOURCES_FOLDER = Path(".cylinder-friction/resources")
"""One ``<stage>.json`` each; it differs with every run and machine, so DVC does not track it."""

_PREFIX = "system/"


@contextmanager
def sampled_resources(stage: str, root: Path, interval_s: float = 1.0) -> Iterator[None]:
    """Sample this process and its children until the block ends, then write ``<root>/.cylinder-friction/resources``.

    The file has the name of the stage.
    """
    samples: list[dict[str, float]] = []
    stop = threading.Event()
    started_ms = int(time.time() * 1000)
    thread = threading.Thread(target=_sample, args=(samples, stop, interval_s), daemon=True, name="resources")
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()
        path = root / RESOURCES_FOLDER / f"{stage}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps({"started_ms": started_ms, "record_key": None, "samples": samples}))


def resource_metrics(root: Path, record: RunRecord) -> list[Metric]:
    """Return the samples of the stage that made ``record`` as MLflow metrics; none where it was not sampled.

    The first record that asks after a stage has run owns the samples; a record that came from a cache has none.
    """
    path = root / RESOURCES_FOLDER / f"{record.name}.json"
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        samples, started_ms, owner = content["samples"], content["started_ms"], content["record_key"]
    except (OSError, ValueError, KeyError):
        return []
    if owner not in (None, record.key()):
        return []
    if owner is None:
        path.write_text(json.dumps({**content, "record_key": record.key()}))
    return [
        Metric(_PREFIX + name, value, started_ms + int(1000 * sample["time_s"]), step)
        for step, sample in enumerate(samples)
        for name, value in sample.items()
        if name != "time_s"
    ]


def _sample(samples: list[dict[str, float]], stop: threading.Event, interval_s: float) -> None:
    started = time.monotonic()
    process = psutil.Process()
    psutil.cpu_percent()  # the first call only starts the clock
    while True:
        stopping = stop.wait(interval_s if samples else min(0.1, interval_s))
        memory = psutil.virtual_memory()
        samples.append(
            {
                "time_s": time.monotonic() - started,
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
