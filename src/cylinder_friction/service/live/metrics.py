"""What Prometheus scrapes: sessions, samples by outcome, flags, what waits, how late the loop is."""

from collections.abc import Iterator, Sequence

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.registry import Collector

from cylinder_friction.service.links.link import Link
from cylinder_friction.service.live.connection import Peers
from cylinder_friction.service.live.service import LiveService

_GAUGES = {
    "sessions": "Open sessions.",
    "held_rows": "Samples that wait for ones before them.",
    "unkept_rows": "Estimates that are not kept yet.",
}


def metrics_text(service: LiveService, peers: Peers, links: Sequence[Link]) -> str:
    """Return the metrics in Prometheus's text format."""
    registry = CollectorRegistry()
    registry.register(_Live(service, peers, links))
    return generate_latest(registry).decode()


class _Live(Collector):
    def __init__(self, service: LiveService, peers: Peers, links: Sequence[Link]) -> None:
        self._service, self._peers, self._links = service, peers, links

    def collect(self) -> Iterator[Metric]:
        by_outcome = CounterMetricFamily(
            "cylinder_friction_live_samples", "Samples by outcome since the start.", labels=["outcome"]
        )
        for outcome, count in self._service.outcomes().items():
            by_outcome.add_metric([outcome], count)
        yield by_outcome
        refused = CounterMetricFamily(
            "cylinder_friction_live_refused", "Messages and connections refused.", labels=["kind"]
        )
        for kind, count in self._peers.refused.items():
            refused.add_metric([kind], count)
        yield refused
        events = CounterMetricFamily("cylinder_friction_live_link", "Events of links.", labels=["link", "event"])
        for link in self._links:
            for event, count in link.counts.items():
                events.add_metric([link.name, event], count)
        yield events
        estimates, with_flag = self._service.flags.totals()
        yield CounterMetricFamily("cylinder_friction_live_estimates", "Estimates given.", estimates)
        flags = CounterMetricFamily("cylinder_friction_live_flags", "Estimates with a flag.", labels=["flag"])
        for flag, count in with_flag.items():
            flags.add_metric([flag], count)
        yield flags
        buckets, sum_s = self._peers.delays.buckets()
        described = "From a message's arrival until its estimates were sent."
        yield HistogramMetricFamily("cylinder_friction_live_delay_seconds", described, buckets, sum_s)
        age = "Since estimates were kept last, where some wait."
        yield GaugeMetricFamily("cylinder_friction_live_kept_age_seconds", age, self._service.kept_age_s)
        for name, value in self._service.load().items():
            yield GaugeMetricFamily(f"cylinder_friction_live_{name}", _GAUGES[name], value)
        yield GaugeMetricFamily("cylinder_friction_live_connections", "Clients.", self._peers.connections)
        yield GaugeMetricFamily(
            "cylinder_friction_live_loop_lag_seconds", "Worst of the last second.", self._service.loop_lag_s
        )
