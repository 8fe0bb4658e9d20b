"""Figures of the server for Prometheus, over all workers."""

import os
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from cylinder_friction.service.scoring.model_source import ModelSource
from cylinder_friction.service.scoring.settings import ServeSettings

SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0)


class Metrics:
    """Counters of one worker; ``text`` sums up those of all that share ``settings.metrics_folder``."""

    def __init__(self, settings: ServeSettings, source: ModelSource) -> None:
        if settings.metrics_folder is not None:  # prometheus_client reads it when imported
            os.environ["PROMETHEUS_MULTIPROC_DIR"] = str(settings.metrics_folder)
        from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, disable_created_metrics

        disable_created_metrics()  # one more gauge for each of them

        self._source, self._folder = source, settings.metrics_folder
        self._registry = CollectorRegistry()
        here: dict[str, Any] = {"namespace": "cylinder_friction", "registry": self._registry}
        self.requests = Counter("requests", "Requests by route and status", ["route", "status"], **here)
        self.seconds = Histogram("request_seconds", "Time of a request [s]", ["route"], buckets=SECONDS, **here)
        self.active = Gauge("active_requests", "Requests being served", multiprocess_mode="livesum", **here)
        self.rows = Counter("rows", "Rows scored", **here)
        self.outside = Counter("rows_outside_training_range", "Rows whose estimate is an extrapolation", **here)
        self.flagged = Counter("rows_flagged", "Rows by flag", ["flag"], **here)
        self._refused = Gauge(
            "model_refused",
            "Workers whose registry names a model that they refused",
            multiprocess_mode="livesum",
            **here,
        )
        self._exchanges = Gauge(
            "model_exchanges", "Models exchanged since the start", multiprocess_mode="livemax", **here
        )

    def count_rows(self, flags: NDArray[np.int64], in_range: NDArray[np.bool_]) -> None:
        """Count the rows of one response."""
        self.rows.inc(len(flags))
        self.outside.inc(len(flags) - int(in_range.sum()))
        values, counts = np.unique(flags, return_counts=True)
        for value, number in zip(values.tolist(), counts.tolist(), strict=True):  # a few, also of a long recording
            for bit, name in self._source.now.graph.flags.items():
                if value & bit:
                    self.flagged.labels(name).inc(number)

    def observe_model(self) -> None:
        """Take over how models were exchanged."""
        self._refused.set(bool(self._source.problem))
        self._exchanges.set(self._source.exchanges)

    def text(self) -> tuple[bytes, str]:
        """Return the figures in Prometheus' text form, and its media type."""
        from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
        from prometheus_client.multiprocess import MultiProcessCollector

        registry = self._registry
        if self._folder is not None:
            registry = CollectorRegistry()
            MultiProcessCollector(registry, str(self._folder))
        model = self._source.now.model
        labels = b"name=%s,version=%s" % (orjson.dumps(model.name), orjson.dumps(model.version))
        info = b"# HELP {0} Model in service\n# TYPE {0} gauge\n{0}{%s} 1.0\n".replace(
            b"{0}", b"cylinder_friction_model"
        )
        return generate_latest(registry) + info % labels, CONTENT_TYPE_LATEST
