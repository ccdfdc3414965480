"""What a fit gives back: estimates with their uncertainty, and what to think of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobefit.kernels import evaluate

if TYPE_CHECKING:
    from lobefit.fitting.identifiability_result import Identifiability
    from lobefit.fitting.instrument_result import InstrumentFit

__all__ = [
    "Decade",
    "Diagnostics",
    "FitResult",
    "NoiseScales",
    "Outliers",
    "ParameterEstimate",
    "Plausibility",
    "Status",
    "StopReport",
]

Array = NDArray[np.float64]
Status = Literal["free", "fixed", "tied", "lower", "upper", "undetermined"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterEstimate:
    """One fitted number.

    Attributes
    ----------
    name : str
        Parameter of the model.
    channel : str or None
        Channel it belongs to; None for a shared parameter.
    value : float
        Point estimate, in `unit`.
    standard_error : float or None
        First order, from the Jacobian; None where the parameter is held or the
        data do not determine it.
    status : str
        "free", "fixed" or "tied" to another (by the candidate), "lower" or "upper" (on that bound;
        the error is then that of an estimate free to cross it), or
        "undetermined" (the data say nothing about it).
    unit, meaning : str
        From the model's record.
    """

    name: str
    channel: str | None
    value: float
    standard_error: float | None
    status: Status
    unit: str
    meaning: str

    @property
    def held(self) -> bool:
        """Whether the candidate holds it or ties it to another: no row of the covariance is its."""
        return self.status in ("fixed", "tied")

    @property
    def label(self) -> str:
        """Name, with the channel in brackets where it has one."""
        return self.name if self.channel is None else f"{self.name}[{self.channel}]"


@dataclass(frozen=True, slots=True, kw_only=True)
class StopReport:
    """How the search went.

    Attributes
    ----------
    algorithm : str
        What ran, in order.
    reason : str
        Why it stopped, in words.
    evaluations : int
        Sets of parameters tried against the measurement, the scan included.
    seconds : float
        Wall time of this candidate.
    converged : bool
        Whether the gradient vanished to the stated tolerance.
    device, precision : str
        Where and how the sums were computed.
    """

    algorithm: str
    reason: str
    evaluations: int
    seconds: float
    converged: bool
    device: str
    precision: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseScales:
    """The noise that residuals were weighed with, per channel.

    ``sigma^2 = additive^2 + (relative f)^2`` with f the model's value;
    `given` is True where the measurement's own sigma was used instead. `nu`: degrees of
    freedom of Student's t, whose scale sigma then is; None for a Gaussian.
    """

    given: bool
    relative: tuple[float, ...]
    additive: tuple[float, ...]
    nu: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Decade:
    """Residuals where the measured value lies in [low, high) 1/sr."""

    low: float
    high: float
    count: int
    mean_relative: float
    rms_relative: float


@dataclass(frozen=True, slots=True)
class Outliers:
    """Values far outside the scatter of the others.

    Attributes
    ----------
    count : int
        How many lie more than 8 robust standard deviations from the model.
    examples : tuple of str
        The worst of them, with channel, angles and values.
    """

    count: int
    examples: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnostics:
    """How well a fitted model describes the measurement.

    Attributes
    ----------
    log10_rms : float or None
        Root mean square of log10(model/measured) over positive values.
    log10_count, log10_excluded : int
        Values in it, and values left out because one of the two is not positive.
    decades : tuple of Decade
        Residuals by decade of the measured value.
    reduced_chi_square : float
        Weighted squared residuals per degree of freedom.
    effective_samples : float
        Values that count as independent, from the residuals' autocorrelation.
    samples : int
        Values used.
    misfit_limited : bool
        The model's misfit, not the noise, limits the fit.
    misfit_reason : str
        In words; empty where it is not.
    worst : tuple of str
        Where it fails most, in words.
    outliers : Outliers
        Values that neither the model nor the noise explains.
    """

    log10_rms: float | None
    log10_count: int
    log10_excluded: int
    decades: tuple[Decade, ...]
    reduced_chi_square: float
    effective_samples: float
    samples: int
    misfit_limited: bool
    misfit_reason: str
    worst: tuple[str, ...]
    outliers: Outliers


@dataclass(frozen=True, slots=True, kw_only=True)
class Plausibility:
    """Whether the fitted model can be a surface.

    Attributes
    ----------
    albedo_max : tuple of float
        Largest directional albedo per channel over incidences up to 85 degrees.
    albedo_max_theta_i : tuple of float
        Where, in radians.
    conserves_energy : bool
        No albedo above 1 by more than its numerical error.
    reciprocity_error : float
        Largest ``|f(i,o) - f(o,i)| / (f(i,o) + f(o,i))`` over a grid.
    reciprocal : bool
        Whether that is rounding only.
    """

    albedo_max: tuple[float, ...]
    albedo_max_theta_i: tuple[float, ...]
    conserves_energy: bool
    reciprocity_error: float
    reciprocal: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class FitResult:
    """One candidate fitted to one measurement.

    Attributes
    ----------
    model : str
        Registered name of the model.
    candidate : str
        The form that was fitted, ``model`` or ``model:variant``.
    options : mapping of str to str
        Pieces the model was compiled with.
    channels : tuple of str
        Channel names, the order of the lists in `params`.
    params : dict of str to float or list of float
        Every parameter of the model, held ones too; lists are per channel.
    estimates : tuple of ParameterEstimate
        The same with uncertainty, one row per number.
    covariance : ndarray, shape (F, F)
        Of the estimates that are not held, in the order of `estimates`, as if every
        bound could be crossed; `standard_error` of an estimate beside one that lies on
        its bound is that with the bound kept, and can be smaller.
    rmse : float
        Root mean square of the residuals in 1/sr, over all channels.
    bic : float or None
        Bayesian information criterion; None for metrics without a likelihood.
    log_likelihood : float or None
        Scaled to the effective number of samples; None likewise.
    objective : float
        What the metric minimised: the sum of weighted squared residuals.
    n_parameters : int
        Free parameters.
    noise : NoiseScales
    stop : StopReport
    diagnostics : Diagnostics
    plausibility : Plausibility
    identifiability : Identifiability or None
        What the data do not determine; of the recommended result only.
    instrument : InstrumentFit or None
        Tilt and veil, where the fit accounted for the instrument.
    """

    model: str
    candidate: str
    options: Mapping[str, str]
    channels: tuple[str, ...]
    params: dict[str, float | list[float]]
    estimates: tuple[ParameterEstimate, ...]
    covariance: Array
    rmse: float
    bic: float | None
    log_likelihood: float | None
    objective: float
    n_parameters: int
    noise: NoiseScales
    stop: StopReport
    diagnostics: Diagnostics
    plausibility: Plausibility
    identifiability: Identifiability | None = None
    instrument: InstrumentFit | None = None

    def predict(
        self, theta_i: ArrayLike, phi_i: ArrayLike, theta_o: ArrayLike, phi_o: ArrayLike
    ) -> Array:
        """Evaluate the fitted model at directions in radians, shape (C, N) in 1/sr."""
        values = evaluate(
            self.model, self.params, theta_i, phi_i, theta_o, phi_o, options=self.options
        )
        full: Array = np.broadcast_to(values, (len(self.channels), values.shape[1]))
        return full

    def __str__(self) -> str:
        """Parameters with their standard errors, as a metrologist writes them."""
        from lobefit.fitting.tables import parameters

        return parameters(self)
