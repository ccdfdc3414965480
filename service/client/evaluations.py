"""Operations on models: list them, evaluate them, simulate measurements; and is the service ready."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lobefit.kernels.errors import ModelError
from lobefit.service.client.base import JSON, STATUS_SILENCE, Operations, json_body, write_whole
from lobefit.service.client.documents import plain, quoted, record
from lobefit.service.client.errors import ServiceError, refused_as
from lobefit.service.client.model_records import ModelRecord, Values
from lobefit.service.client.operation import operation
from lobefit.service.client.resources import Readiness
from lobefit.service.client.retries import exchange
from lobefit.service.client.wire import Operation, Reply, Request

__all__ = ["Evaluations"]


class Evaluations(Operations):
    """What a client does with models."""

    @operation
    def models(self) -> Operation[list[ModelRecord]]:
        """List the models that can be fitted and evaluated."""
        document = yield from self._get("/v1/models")
        return [ModelRecord.read(item) for item in document.get("items", [])]

    @operation
    def model(self, name: str) -> Operation[ModelRecord]:
        """Give a model by name.

        Raises
        ------
        ServiceError
            There is none.
        """
        document = yield from self._get(f"/v1/models/{quoted(name)}")
        return ModelRecord.read(document)

    @operation
    def evaluate(
        self,
        model: str,
        params: Mapping[str, Any],
        *,
        theta_i_deg: Any,
        phi_i_deg: Any = 0.0,
        theta_o_deg: Any,
        phi_o_deg: Any,
        options: Mapping[str, str] | None = None,
        precision: str = "double",
    ) -> Operation[Values]:
        """Evaluate a model at directions.

        Parameters
        ----------
        model : str
            A model or a variant, such as "ggx:k_s=1".
        params : mapping of str to number or sequence
            By channel where a parameter is; `FittedModel.params` fits.
        theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg : number or sequence, shape (N,)
            Degrees; both directions point away from the surface. A number stands for all.
        options : mapping of str to str, optional
            Masking and Fresnel term, where the model leaves a choice.
        precision : {"double", "single"}

        Returns
        -------
        Values
            Shape (C, N), in 1/sr.

        Raises
        ------
        ModelError
            There is no such model, parameter or option, or a value is out of its domain.
        """
        angles = {
            "theta_i_deg": plain(theta_i_deg),
            "phi_i_deg": plain(phi_i_deg),
            "theta_o_deg": plain(theta_o_deg),
            "phi_o_deg": plain(phi_o_deg),
        }
        most = max((len(a) for a in angles.values() if isinstance(a, list)), default=1)
        directions = {k: a if isinstance(a, list) else [a] * most for k, a in angles.items()}
        return (yield from self._values(model, params, options, precision, directions=directions))

    @operation
    def evaluate_grid(
        self,
        model: str,
        params: Mapping[str, Any],
        *,
        theta_i_deg: Sequence[float],
        theta_o_deg: Sequence[float],
        phi_o_deg: Sequence[float],
        options: Mapping[str, str] | None = None,
        precision: str = "double",
    ) -> Operation[Values]:
        """Evaluate a model at all combinations of angles, with phi_i = 0.

        Parameters
        ----------
        model, params, options, precision
            As for `evaluate`.
        theta_i_deg, theta_o_deg, phi_o_deg : sequence of float
            Degrees.

        Returns
        -------
        Values
            Shape (C, len(theta_i_deg), len(theta_o_deg), len(phi_o_deg)), in 1/sr.
        """
        grid = _grid(theta_i_deg, theta_o_deg, phi_o_deg)
        return (yield from self._values(model, params, options, precision, grid=grid))

    @operation
    def evaluate_exr(
        self,
        path: str | Path,
        model: str,
        params: Mapping[str, Any],
        *,
        theta_i_deg: Sequence[float],
        theta_o_deg: Sequence[float],
        phi_o_deg: Sequence[float],
        options: Mapping[str, str] | None = None,
    ) -> Operation[Path]:
        """Write a model on a grid as an OpenEXR picture; as `evaluate_grid`."""
        grid = _grid(theta_i_deg, theta_o_deg, phi_o_deg)
        reply = yield from self._evaluate(model, params, options, format="exr", grid=grid)
        return (yield from write_whole(Path(path), reply.content))

    @operation
    def simulate(
        self,
        model: str,
        params: Mapping[str, Any],
        *,
        geometry: str = "in-plane",
        noise: tuple[float, float] = (0.02, 0.001),
        seed: int = 0,
        sigma: bool = False,
        options: Mapping[str, str] | None = None,
    ) -> Operation[bytes]:
        """Make the measurement that an instrument would give of a model surface.

        Parameters
        ----------
        model, params, options
            As for `evaluate`.
        geometry : str
            Such as "in-plane incidences=0,30,60 step=2.5", or "hemisphere".
        noise : tuple of two float
            Relative, and additive in 1/sr.
        seed : int
            Of the noise.
        sigma : bool
            State the uncertainty in ``sigma_`` columns.

        Returns
        -------
        bytes
            A CSV, as `upload` takes it.
        """
        document = {
            "model": model,
            "params": plain(params),
            "options": dict(options or {}),
            "geometry": geometry,
            "noise": list(noise),
            "seed": seed,
            "sigma": sigma,
        }
        reply = yield from self._compute("/v1/simulate", document)
        return reply.content

    @operation
    def ready(self) -> Operation[Readiness]:
        """Ask whether the service can take fits: its device is compiled for, its store writable.

        Returns
        -------
        Readiness
            False in a condition where it is not ready; for how it is, see its fields.

        Raises
        ------
        ServiceError
            The service cannot be reached.
        """
        reply = yield from exchange(
            self._retries, Request(path="/readyz", silence=STATUS_SILENCE), _tells_readiness
        )
        return record(Readiness, reply.document())

    def _values(
        self,
        model: str,
        params: Mapping[str, Any],
        options: Mapping[str, str] | None,
        precision: str,
        **where: Mapping[str, Any],
    ) -> Operation[Values]:
        asked = {"format": "json", "precision": precision, **where}
        reply = yield from self._evaluate(model, params, options, **asked)
        return Values.read(reply.document())

    def _evaluate(
        self,
        model: str,
        params: Mapping[str, Any],
        options: Mapping[str, str] | None,
        **asked: Any,
    ) -> Operation[Reply]:
        document = {"model": model, "params": plain(params), "options": dict(options or {})}
        return self._compute("/v1/evaluate", {**document, **asked})

    def _compute(self, path: str, document: Mapping[str, Any]) -> Operation[Reply]:
        request = Request(method="POST", path=path, headers=JSON, body=json_body(document))
        with refused_as(ModelError):
            return (yield from self._exchange(request))


def _tells_readiness(reply: Reply) -> bool:
    """Tell a service that is not ready from a proxy that does not reach it; both say 503."""
    try:
        return "ready" in reply.document()
    except ServiceError:
        return False


def _grid(*angles: Sequence[float]) -> dict[str, Any]:
    names = ("theta_i_deg", "theta_o_deg", "phi_o_deg")
    grid = {name: plain(a) for name, a in zip(names, angles, strict=True)}
    for name, a in grid.items():
        if not isinstance(a, list):
            raise ModelError(f"{name} is {a!r}; a grid needs a sequence of angles")
    return grid
