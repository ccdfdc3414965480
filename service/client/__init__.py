"""A client of ``lobefit serve`` for Python, with and without ``await``.

::

    from lobefit.service import Client

    with Client() as client:
        fit = client.fit("my_surface.csv", wait=True)
        print(client.result(fit))

It needs neither numpy nor OpenCL. Errors are those of the local API, and `ServiceError`.
"""

from lobefit.service.client.batch_record import Batch
from lobefit.service.client.drivers import DEFAULT_URL, AsyncClient, Client
from lobefit.service.client.errors import ServiceError
from lobefit.service.client.job_records import Artefact, Chart, Fit, Progress
from lobefit.service.client.model_records import ModelParameter, ModelRecord, Values
from lobefit.service.client.report import Estimate, FittedModel, Report
from lobefit.service.client.resources import Check, Checks, Readiness, StoredMeasurement
from lobefit.service.client.retries import Retries

__all__ = [
    "DEFAULT_URL",
    "Artefact",
    "AsyncClient",
    "Batch",
    "Chart",
    "Check",
    "Checks",
    "Client",
    "Estimate",
    "Fit",
    "FittedModel",
    "ModelParameter",
    "ModelRecord",
    "Progress",
    "Readiness",
    "Report",
    "Retries",
    "ServiceError",
    "StoredMeasurement",
    "Values",
]
