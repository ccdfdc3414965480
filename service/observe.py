"""What is told of each request: one JSON line in the log, and Prometheus metrics."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from typing import TextIO

import structlog
from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from lobefit.service.edge import Seen
from lobefit.service.rows import StoreError
from lobefit.service.store import Store

__all__ = ["Metrics", "logged"]

# Asked every few seconds by machines; that all is well is not worth a line each time.
_PROBED = {"/healthz", "/readyz", "/metrics"}
_BUCKETS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 60.0)


def logged(stream: TextIO | None = None) -> Callable[[Seen], None]:
    """Give an observer that writes one JSON line for each request.

    Parameters
    ----------
    stream : file, optional
        Where to; standard error where left out.
    """
    log = structlog.wrap_logger(
        structlog.WriteLogger(stream or sys.stderr),
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.dict_tracebacks,
            structlog.processors.JSONRenderer(),
        ],
    )

    def observe(seen: Seen) -> None:
        scope = seen.scope
        if scope["path"] in _PROBED and seen.status < 400:
            return
        client = scope.get("client")
        fields = {
            "request_id": seen.request_id,
            "method": seen.method,
            "path": scope["path"],
            "status": seen.status,
            "ms": round(1e3 * seen.seconds, 1),
            "received": seen.received,
            "sent": seen.sent,
            "client": client[0] if client else None,
            "token": scope.get("lobefit.owner") or None,
        }
        if seen.error is not None:
            log.error("request", exc_info=seen.error, **fields)
        else:
            log.info("request", **fields)

    return observe


class Metrics:
    """Counts requests, and asks the store when somebody reads the numbers.

    Parameters
    ----------
    store : Store
        Whose queue and workers are told of.
    """

    def __init__(self, store: Store) -> None:
        self._registry = CollectorRegistry()
        self._requests = Counter(
            "lobefit_http_requests",
            "Requests answered.",
            ("method", "route", "status"),
            registry=self._registry,
        )
        self._seconds = Histogram(
            "lobefit_http_request_seconds",
            "Time from a request's head to the end of its answer.",
            ("route",),
            buckets=_BUCKETS,
            registry=self._registry,
        )
        self._bytes = Counter(
            "lobefit_http_received_bytes", "Bytes of bodies received.", registry=self._registry
        )
        self._registry.register(_StoreCollector(store))

    def observe(self, seen: Seen) -> None:
        """Count a request under its route's template, so that ids make no new series."""
        route = getattr(seen.scope.get("route"), "path", "none")
        method = seen.method if seen.method in _METHODS else "other"
        self._requests.labels(method, route, str(seen.status)).inc()
        self._seconds.labels(route).observe(seen.seconds)
        self._bytes.inc(seen.received)

    def text(self) -> bytes:
        """Give everything in Prometheus' text format."""
        return generate_latest(self._registry)


_METHODS = {"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"}


class _StoreCollector(Collector):
    def __init__(self, store: Store) -> None:
        self._store = store

    def collect(self) -> Iterator[Metric]:
        try:
            counts = self._store.counts()
            processes = self._store.processes()
            free = self._store.free_bytes()
        except StoreError:  # what was counted here is still worth telling
            return
        jobs = GaugeMetricFamily("lobefit_jobs", "Jobs by state.", labels=["kind", "state"])
        for (kind, state), number in counts.items():
            jobs.add_metric([kind, state], number)
        yield jobs
        age = GaugeMetricFamily(
            "lobefit_worker_heartbeat_age_seconds", "Since a worker was heard of.", labels=["name"]
        )
        rss = GaugeMetricFamily(
            "lobefit_worker_resident_bytes", "Memory of a worker.", labels=["name"]
        )
        for process in processes:
            if process.age is not None:
                age.add_metric([process.name], process.age)
                rss.add_metric([process.name], process.rss)
        yield age
        yield rss
        yield GaugeMetricFamily("lobefit_store_free_bytes", "Free space.", value=free)
