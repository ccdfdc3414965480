"""Operations on the files of a fit or a chart: download them, open the posterior."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path
from typing import Any

from lobefit.kernels.errors import FitError
from lobefit.service.client.base import Operations, writing
from lobefit.service.client.documents import quoted
from lobefit.service.client.errors import ServiceError
from lobefit.service.client.fetching import fetch
from lobefit.service.client.job_records import Fit, Job
from lobefit.service.client.operation import operation
from lobefit.service.client.wire import Operation, Work

__all__ = ["Files"]

POSTERIOR = "posterior.nc"


class Files(Operations):
    """What a client does with the files of a job."""

    @operation
    def download(
        self, fit: Job | str, folder: str | Path, names: Iterable[str] | None = None
    ) -> Operation[dict[str, Path]]:
        """Download files of a fit, or of a chart.

        A file is either whole and checked against its SHA-256, or not there; what is there already
        is not sent again, and a download that breaks off goes on where it stopped.

        Parameters
        ----------
        fit : Fit, Chart, or id of a fit
        folder : path-like
            Made if it does not exist.
        names : iterable of str, optional
            Which files, such as "report.json" and "fit.png"; all if left out.

        Returns
        -------
        dict of str to Path
            Where they are, by name.

        Raises
        ------
        FitError
            It has no file of such a name.
        LobefitError
            A file cannot be written.
        ServiceError
            The service cannot be reached, or sends something else than it promised.
        """
        kind = Fit if isinstance(fit, str) else type(fit)
        return self._download(kind, fit, Path(folder), names)

    @operation
    def posterior(self, fit: Fit | str) -> Operation[Any]:
        """Give the posterior of a fit, for ArviZ.

        Returns
        -------
        xarray.DataTree or arviz.InferenceData
            What the installed ArviZ opens a NetCDF file as.

        Raises
        ------
        ServiceError
            ArviZ is not installed; says what to install.
        FitError
            The fit sampled no posterior.
        """
        arviz = yield Work(_arviz)
        with tempfile.TemporaryDirectory() as folder:
            found = yield from self._download(Fit, fit, Path(folder), [POSTERIOR])

            def load() -> Any:
                data = arviz.from_netcdf(str(found[POSTERIOR]))
                # Into memory: the file goes.
                data.load()
                data.close()
                return data

            return (yield Work(load))

    def _download(
        self, kind: type[Job], what: Job | str, folder: Path, names: Iterable[str] | None
    ) -> Operation[dict[str, Path]]:
        job = kind.read((yield from self._get(kind.path_of(what))))
        there = {a.name: a for a in job.artefacts}
        wanted = list(there) if names is None else list(names)
        for name in wanted:
            if name not in there:
                raise FitError(
                    f"{kind.NOUN} {job.id} is {job.state} and has no file {name!r}; "
                    f"it has: {', '.join(there) or 'none'}"
                )
            _check_name(name)
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        found = {}
        for name in wanted:
            path = f"{job.path}/artefacts/{quoted(name)}"
            found[name] = yield from fetch(self._retries, path, there[name], folder / name)
        return found


def _check_name(name: str) -> None:
    """Refuse what would be written elsewhere than into the folder."""
    if Path(name).name != name or name.startswith(".") or "\\" in name or not name.isprintable():
        raise ServiceError(f"the service names a file {name!r}, which is not stored")


def _arviz() -> Any:
    try:
        return import_module("arviz")
    except ImportError as error:
        raise ServiceError(
            "posterior() opens the samples with ArviZ, which is not installed: "
            'pip install "lobefit[arviz]"; download(fit, folder, ["posterior.nc"]) and '
            "result(fit).posterior need no ArviZ"
        ) from error
