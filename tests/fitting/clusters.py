"""A Dask cluster of two processes for tests, where Dask is installed."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

__all__ = ["local_cluster"]


@contextmanager
def local_cluster(**settings: Any) -> Iterator[str]:
    """Start a scheduler and two workers, and give the address; skips without Dask."""
    distributed: Any = pytest.importorskip(
        "distributed", reason="Dask is not installed: pip install lobefit[dask]"
    )
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        dashboard_address="127.0.0.1:0",
        silence_logs=logging.CRITICAL,
        **settings,
    ) as cluster:
        yield cluster.scheduler_address
