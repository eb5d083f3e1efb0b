"""The service's counters as Prometheus reads them: text, format 0.0.4."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from evplace.serving._hub import Hub
from evplace.serving.service import Service

STATES = ("localised", "ambiguous", "unseen", "lost", "standing", "no-events")


def prometheus(service: Service, hub: Hub) -> str:
    """All metrics, each with its help and type."""
    return "\n".join(_lines(service, hub)) + "\n"


def _lines(service: Service, hub: Hub) -> Iterator[str]:
    counters = service.feed.counters()
    yield from _metric("events_total", "counter", "Good events that came.", counters.events)
    yield from _metric("events_skipped_total", "counter", "Events dropped as too old.", counters.skipped)
    yield from _metric("overflows_total", "counter", "How often events were lost.", counters.overflows)
    yield from _metric("events_recorded_total", "counter", "Events written to the file.", counters.recorded)
    yield from _metric("backlog_events", "gauge", "Events that wait.", counters.backlog)
    yield from _head("events_rejected_total", "counter", "Events that cannot be.")
    for reason, count in counters.rejected.items():
        yield f'evplace_events_rejected_total{{reason="{reason}"}} {count}'
    yield from _head("matches_total", "counter", "Matches by state.")
    for state in STATES:
        yield f'evplace_matches_total{{state="{state}"}} {hub.matches.get(state, 0)}'
    yield from _head("latency_seconds", "summary", "From the arrival of a window's last events to its match.")
    latencies = np.array(hub.latencies_s or [np.nan])
    for quantile in (0.5, 0.99):
        yield f'evplace_latency_seconds{{quantile="{quantile}"}} {np.quantile(latencies, quantile):.6f}'
    yield from _metric("clients", "gauge", "WebSocket clients.", hub.listeners)
    silent = service.source_state()["silent_s"]
    yield from _metric("source_silent_seconds", "gauge", "Seconds since the last events.", silent)
    yield from _metric("healthy", "gauge", "Whether the drive is well.", int(service.healthy()))


def _metric(name: str, kind: str, about: str, value: float) -> Iterator[str]:
    yield from _head(name, kind, about)
    yield f"evplace_{name} {value}"


def _head(name: str, kind: str, about: str) -> Iterator[str]:
    yield f"# HELP evplace_{name} {about}"
    yield f"# TYPE evplace_{name} {kind}"
