"""Metrics for Prometheus: sessions, samples by outcome, flags, waiting rows, delay of the event loop."""

from collections.abc import Iterator, Mapping, Sequence

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from cylinder_friction_live.connection import Peers
from cylinder_friction_live.links.link import Link
from cylinder_friction_live.service import LiveService

_GAUGES = {
    "sessions": "Open sessions.",
    "held_rows": "Samples that wait for ones before them.",
    "noisy_sessions": "Open sessions whose pressures are noisier than their model's bounds hold.",
    "unkept_rows": "Estimates that are not kept yet.",
}


def metrics_text(service: LiveService, peers: Peers, links: Sequence[Link]) -> str:
    """Write the metrics in Prometheus's text format."""
    registry = CollectorRegistry()
    registry.register(_Live(service, peers, links))
    return generate_latest(registry).decode()


class _Live(Collector):
    def __init__(self, service: LiveService, peers: Peers, links: Sequence[Link]) -> None:
        self._service, self._peers, self._links = service, peers, links

    def collect(self) -> Iterator[Metric]:
        yield _counter("samples", "Samples by outcome since the start.", "outcome", self._service.outcomes())
        yield _counter("refused", "Messages and connections refused.", "kind", self._peers.refused)
        events = CounterMetricFamily("cylinder_friction_live_link", "Events of links.", labels=["link", "event"])
        for link in self._links:
            for event, count in link.counts.items():
                events.add_metric([link.name, event], count)
        yield events
        estimates, with_flag = self._service.flags.totals()
        yield CounterMetricFamily("cylinder_friction_live_estimates", "Estimates given.", estimates)
        yield _counter("flags", "Estimates with a flag.", "flag", with_flag)
        buckets, sum_s = self._peers.delays.buckets()
        described = "From a message's arrival until its estimates were sent."
        yield HistogramMetricFamily("cylinder_friction_live_delay_seconds", described, buckets, sum_s)
        age = "Since estimates were kept last, where some wait."
        yield GaugeMetricFamily("cylinder_friction_live_kept_age_seconds", age, self._service.kept_age_s)
        for name, value in self._service.load().items():
            yield GaugeMetricFamily(f"cylinder_friction_live_{name}", _GAUGES[name], value)
        yield GaugeMetricFamily("cylinder_friction_live_connections", "Clients.", len(self._peers.connected))
        yield GaugeMetricFamily(
            "cylinder_friction_live_loop_lag_seconds", "Worst of the last second.", self._service.loop_lag_s
        )


def _counter(name: str, described: str, label: str, counts: Mapping[str, int]) -> Metric:
    counter = CounterMetricFamily(f"cylinder_friction_live_{name}", described, labels=[label])
    for value, count in counts.items():
        counter.add_metric([value], count)
    return counter
