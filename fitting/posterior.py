"""The posterior of a fitted model: what is known of its parameters after the measurement."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobefit import __version__
from lobefit.fitting.artefacts import save_together, write_json
from lobefit.fitting.chains import bulk_ess, r_hat, tail_ess
from lobefit.fitting.inference_data import Group, InferenceData
from lobefit.fitting.likelihood import model_values
from lobefit.fitting.measurement import DIRECTION_COLUMNS, Measurement
from lobefit.fitting.result import FitResult
from lobefit.fitting.space import Space
from lobefit.fitting.tables import aligned
from lobefit.kernels import Device, get_device
from lobefit.kernels.geometry import Directions

__all__ = ["ParameterSummary", "Posterior"]

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSummary:
    """One sampled number.

    Attributes
    ----------
    mean, sd : float
        In the parameter's unit.
    q5, q50, q95 : float
        Quantiles: 90 % of the posterior lie between the outer two.
    ess_bulk, ess_tail : float
        Effective samples for the middle and for the outer quantiles.
    r_hat : float
        Between the ensembles; 1 where they agree.
    tau : float
        Autocorrelation time in steps.
    """

    mean: float
    sd: float
    q5: float
    q50: float
    q95: float
    ess_bulk: float
    ess_tail: float
    r_hat: float
    tau: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Posterior:
    """What `sample` gives.

    Attributes
    ----------
    result : FitResult
        The point fit it began at.
    measurement : Measurement
    space : Space
        Parameters, priors and coordinates.
    chain : ndarray, shape (steps, E, W, n)
        The sampled coordinates of the steps that count, of E ensembles of W walkers.
    log_prob : ndarray, shape (steps, E, W)
        Log-probabilities up to a constant.
    converged : bool
        Long enough (50 autocorrelation times, stable) and mixed (R-hat below 1.01).
    reason : str
        Why not, or what shows it, in words.
    tau : dict of str to float
        Autocorrelation times in steps, by label.
    acceptance : float
        Share of accepted moves.
    warm_up : int
        Steps before those that count.
    not_finite : int
        Log-probabilities that were not finite and count as -inf, in this run.
    evaluations : int
        Parameter sets tried in this run.
    seconds : float
    seed : int
    repeatable : bool
        The same seed and device give the same chain; False where the clock ended the run.
    device, precision : str
    power : float
        What the log-likelihood was multiplied with; below 1 where residuals are correlated.
    notes : tuple of str
        What was decided about noise and likelihood, in words.
    """

    result: FitResult
    measurement: Measurement
    space: Space
    chain: Array
    log_prob: Array
    converged: bool
    reason: str
    tau: dict[str, float]
    acceptance: float
    warm_up: int
    not_finite: int
    evaluations: int
    seconds: float
    seed: int
    repeatable: bool
    device: str
    precision: str
    power: float
    notes: tuple[str, ...] = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the sampled numbers, such as ``alpha`` or ``k_d[R]``."""
        return self.space.labels

    @property
    def thin(self) -> int:
        """Every so manieth step is kept in `idata`: half the shortest autocorrelation time."""
        times = [t for t in self.tau.values() if np.isfinite(t)]
        return max(1, int(0.5 * min(times, default=1.0)))

    @cached_property
    def theta(self) -> Array:
        """The chain in the parameters' units, shape (steps, E, W, n)."""
        flat = self.chain.reshape(-1, self.space.size)
        return self.space.transforms.to_parameters(flat).reshape(self.chain.shape)

    def __getitem__(self, label: str) -> Array:
        """Give all values of a sampled number, one after the other."""
        if label not in self.labels:
            raise KeyError(f"{label!r} was not sampled; these were: {', '.join(self.labels)}")
        return np.asarray(self.theta[..., self.labels.index(label)].ravel())

    def draws(self, count: int) -> Array:
        """Pick values of all parameters, evenly over steps and walkers.

        Parameters
        ----------
        count : int
            How many; fewer than `effective` are nearly independent.

        Returns
        -------
        ndarray, shape (count, n)
            In the order of `labels`.
        """
        flat = self.theta.reshape(-1, self.space.size)
        # Strides of a golden section visit every walker and step alike.
        place = np.mod((np.arange(count) + 0.5) * 0.6180339887498949, 1.0)
        return np.asarray(flat[(place * len(flat)).astype(np.intp)])

    @cached_property
    def _summary(self) -> dict[str, ParameterSummary]:
        ensembles = self.theta.shape[1]
        found = {}
        for k, label in enumerate(self.labels):
            x = self.theta[..., k]
            kept = x[:: self.thin]
            by_walker = kept.reshape(len(kept), -1).T
            by_ensemble = kept.transpose(1, 0, 2).reshape(ensembles, -1)
            q5, q50, q95 = np.quantile(x, [0.05, 0.5, 0.95])
            long_enough = len(kept) >= 8
            found[label] = ParameterSummary(
                mean=float(x.mean()),
                sd=float(x.std()),
                q5=float(q5),
                q50=float(q50),
                q95=float(q95),
                ess_bulk=bulk_ess(by_walker) if long_enough else float("nan"),
                ess_tail=tail_ess(by_walker) if long_enough else float("nan"),
                r_hat=r_hat(by_ensemble),
                tau=self.tau[label],
            )
        return found

    def summary(self) -> dict[str, ParameterSummary]:
        """Summarise every sampled number, by label."""
        return dict(self._summary)

    @property
    def effective(self) -> float:
        """Effective samples of the parameter that has fewest."""
        return min(min(s.ess_bulk, s.ess_tail) for s in self._summary.values())

    def table(self) -> str:
        """Write the summary as a text table."""
        head = ("", "mean", "sd", "5 %", "50 %", "95 %", "ess_bulk", "ess_tail", "r_hat")
        rows: list[tuple[str, ...]] = [head]
        for label, s in self._summary.items():
            # Two digits of the narrowest part.
            part = min(s.sd, s.q50 - s.q5, s.q95 - s.q50)
            digits = 1 - int(f"{part:.1e}".partition("e")[2]) if part > 0.0 else 6
            kind = "f" if 0 <= digits <= 8 else "g"
            places = digits if kind == "f" else 6
            numbers = (f"{v:.{places}{kind}}" for v in (s.mean, s.sd, s.q5, s.q50, s.q95))
            rows.append(
                (label, *numbers, f"{s.ess_bulk:.0f}", f"{s.ess_tail:.0f}", f"{s.r_hat:.4f}")
            )
        return "\n".join(aligned(rows, left=(0,)))

    def __str__(self) -> str:
        """Table, and whether to trust it."""
        state = "converged" if self.converged else "NOT CONVERGED"
        return "\n".join([self.table(), "", f"{state}: {self.reason}", *self.notes])

    def predict(
        self,
        theta_i: ArrayLike,
        phi_i: ArrayLike,
        theta_o: ArrayLike,
        phi_o: ArrayLike,
        *,
        draws: int = 200,
        device: str | Device | None = None,
    ) -> Array:
        """Evaluate the model at draws of the posterior.

        Parameters
        ----------
        theta_i, phi_i, theta_o, phi_o : array_like, shape (N,)
            Directions in radians.
        draws : int
            How many.
        device : str, Device or None
            See `lobefit.kernels.get_device`.

        Returns
        -------
        ndarray, shape (draws, C, N)
            In 1/sr, without noise.
        """
        where = Directions(get_device(device), theta_i, phi_i, theta_o, phi_o)
        try:
            return model_values(self.space, self.draws(draws), where)
        finally:
            where.release()

    def noise_of(self, theta: Array, values: Array) -> Array:
        """Give sigma in 1/sr of model values (S, C, N) at draws (S, n) where noise was sampled."""
        a = self.space.arguments(theta)
        if a.additive is None or a.relative is None:
            raise ValueError("the noise was given, not sampled")
        return np.asarray(np.hypot(a.additive[:, :, None], a.relative[:, :, None] * values))

    @cached_property
    def idata(self) -> InferenceData:
        """Everything in ArviZ's layout; a chain there is a walker, and `ensemble` says of which."""
        m = self.measurement
        _, ensembles, walkers, _ = self.chain.shape
        kept = self.theta[:: self.thin]
        by_walker = np.moveaxis(kept.reshape(len(kept), ensembles * walkers, -1), 0, 1)
        axes = {
            "chain": np.arange(ensembles * walkers),
            "draw": np.arange(len(kept)) * self.thin,
            "channel": np.array(m.channels),
        }
        lp = self.log_prob[:: self.thin].reshape(len(kept), -1).T
        attributes = {
            "inference_library": "emcee",
            "created_by": f"lobefit {__version__}",
            **self._facts(),
        }
        angles: dict[str, tuple[tuple[str, ...], Array]] = {
            name: (("direction",), getattr(m, name)) for name in DIRECTION_COLUMNS
        }
        where = {"channel": axes["channel"]}
        return InferenceData(
            {
                "posterior": Group(self._variables(by_walker), axes, attributes),
                "sample_stats": Group(
                    {
                        "lp": (("chain", "draw"), lp),
                        "ensemble": (("chain",), np.repeat(np.arange(ensembles), walkers)),
                    },
                    {"chain": axes["chain"], "draw": axes["draw"]},
                    {"tau": np.array([self.tau[label] for label in self.labels])},
                ),
                "observed_data": Group({"brdf": (("channel", "direction"), m.values)}, where),
                "constant_data": Group(
                    angles
                    if m.sigma is None
                    else {**angles, "sigma": (("channel", "direction"), m.sigma)},
                    {} if m.sigma is None else where,
                ),
            }
        )

    def _variables(self, values: Array) -> dict[str, tuple[tuple[str, ...], Array]]:
        """Give variables by name, from values of shape (chain, draw, n)."""
        found: dict[str, tuple[tuple[str, ...], Array]] = {}
        for k, c in enumerate(self.space.coordinates):
            if c.channel is None:
                x = values[..., k]
                if c.parameter is not None and c.parameter.period:
                    low = c.parameter.bounds[0]
                    x = low + np.mod(x - low, c.parameter.period)
                found[c.name] = (("chain", "draw"), x)
            elif c.channel == 0:
                columns = [k + i for i in range(len(self.space.channels))]
                found[c.name] = (("chain", "draw", "channel"), values[..., columns])
        return found

    def _facts(self) -> dict[str, Any]:
        return {
            "candidate": self.result.candidate,
            "options": ", ".join(f"{k}={v}" for k, v in self.result.options.items()),
            "converged": self.converged,
            "reason": self.reason,
            "acceptance": self.acceptance,
            "steps": len(self.chain),
            "warm_up": self.warm_up,
            "ensembles": self.chain.shape[1],
            "walkers": self.chain.shape[2],
            "thin": self.thin,
            "seed": self.seed,
            "repeatable": self.repeatable,
            "not_finite": self.not_finite,
            "power": self.power,
            "device": self.device,
            "precision": self.precision,
            "seconds": self.seconds,
            "notes": " ".join(self.notes),
        }

    def to_dict(self) -> dict[str, Any]:
        """Give summary and facts as JSON-ready values."""
        rows = {
            label: {k: v if np.isfinite(v) else None for k, v in asdict(s).items()}
            for label, s in self._summary.items()
        }
        priors = {c.label: repr(c.prior) for c in self.space.coordinates}
        return {**self._facts(), "summary": rows, "priors": priors}

    def save(self, folder: str | Path) -> dict[str, Path]:
        """Write posterior.nc, posterior.json, corner.png, trace.png and predictive.png.

        Parameters
        ----------
        folder : str or Path
            Made if it does not exist.

        Returns
        -------
        dict of str to Path
            What was written, by kind.
        """
        from lobefit.fitting import posterior_figure as figure

        return save_together(
            Path(folder),
            {
                "corner": ("corner.png", lambda p: figure.write(p, figure.draw_corner(self))),
                "trace": ("trace.png", lambda p: figure.write(p, figure.draw_trace(self))),
                "predictive": (
                    "predictive.png",
                    lambda p: figure.write(p, figure.draw_bands(self)),
                ),
                "posterior": ("posterior.nc", self.idata.to_netcdf),
                "summary": ("posterior.json", lambda p: write_json(p, self.to_dict())),
            },
        )
