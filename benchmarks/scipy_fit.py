"""Diffuse + one lobe with `scipy.optimize.least_squares`: the fit a careful user would write.

All parameters are searched at once: k_d, k_s (and F0) per channel, and the nonlinear ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from benchmarks.numpy_models import BLOCK, ExponentialLobe

__all__ = ["METHODS", "ScipyFit"]

Array = NDArray[np.float64]

# Name -> method and Jacobian. No bounds: they cost `trf` time and these starts need none.
METHODS: dict[str, tuple[str, str]] = {
    "scipy trf": ("trf", "2-point"),
    "scipy lm": ("lm", "2-point"),
    "scipy trf, Jacobian by hand": ("trf", "by hand"),
}


class ScipyFit:
    """Weighted residuals of a measurement and their fit.

    Parameters
    ----------
    lobe : ExponentialLobe
        The model's lobe on the N directions.
    values, sigma : array
        BRDF and its standard uncertainty [1/sr], arrays [C, N].
    """

    def __init__(self, lobe: ExponentialLobe, values: Array, sigma: Array) -> None:
        self.lobe = lobe
        self._inverse = 1 / sigma
        self._target = values / sigma
        self._lobe_row, self._scratch, self._work = np.empty((3, BLOCK))
        self._linear = 2 if lobe.schlick is None else 3  # coefficients per channel

    def _split(self, p: Array) -> tuple[Array, Array]:
        """Coefficients [k_d, k_s, (F0)] by channel and the nonlinear parameters."""
        n = self._linear * len(self._target)
        return p[:n].reshape(self._linear, -1), p[n:]

    def residuals(self, p: Array) -> Array:
        """(model - value) / sigma, flat over channels and directions; scipy keeps the array."""
        coefficients, x = self._split(p)
        scale, q = self.lobe.scale(x)
        out = np.empty_like(self._target)
        for start in range(0, out.shape[1], BLOCK):
            rows = slice(start, min(start + BLOCK, out.shape[1]))
            row = self._lobe_row[: rows.stop - start]
            scratch = self._scratch[: len(row)]
            self.lobe.fill(q, rows, row, scratch)
            for channel, result in enumerate(out[:, rows]):
                k_d, k_s = (float(v) for v in coefficients[:2, channel])
                if self.lobe.schlick is None:
                    np.multiply(row, scale * k_s, out=result)
                else:
                    f0 = float(coefficients[2, channel])
                    np.multiply(self.lobe.schlick[rows], scale * k_s * (1 - f0), out=result)
                    np.add(result, scale * k_s * f0, out=result)
                    np.multiply(result, row, out=result)
                np.add(result, k_d / np.pi, out=result)
                np.multiply(result, self._inverse[channel, rows], out=result)
                np.subtract(result, self._target[channel, rows], out=result)
        return out.ravel()

    def jacobian(self, p: Array) -> Array:
        """Derivatives of `residuals`, [C * N, P]."""
        coefficients, x = self._split(p)
        scale, q = self.lobe.scale(x)
        d_scale, d_q = self.lobe.gradient(x)
        n_channels, n = self._target.shape
        out = np.zeros((len(p), n_channels, n))
        for start in range(0, n, BLOCK):
            rows = slice(start, min(start + BLOCK, n))
            row, scratch, work = (
                b[: rows.stop - start] for b in (self._lobe_row, self._scratch, self._work)
            )
            self.lobe.fill(q, rows, row, scratch)
            np.multiply(row, scale, out=row)
            for c in range(n_channels):
                inverse = self._inverse[c, rows]
                k_s = float(coefficients[1, c])
                np.multiply(inverse, 1 / np.pi, out=out[c, c, rows])
                by_k_s = out[n_channels + c, c, rows]
                np.multiply(row, inverse, out=by_k_s)
                if self.lobe.schlick is not None:
                    s, f0 = self.lobe.schlick[rows], float(coefficients[2, c])
                    by_f0 = out[2 * n_channels + c, c, rows]
                    np.subtract(1.0, s, out=by_f0)
                    np.multiply(by_f0, by_k_s, out=by_f0)
                    np.multiply(by_f0, k_s, out=by_f0)
                    np.multiply(s, 1 - f0, out=work)
                    np.add(work, f0, out=work)
                    np.multiply(by_k_s, work, out=by_k_s)
                for j in range(len(x)):
                    by_x = out[self._linear * n_channels + j, c, rows]
                    by_x[:] = d_scale[j]
                    for form, factor in zip(self.lobe.forms[:, rows], d_q[j].tolist(), strict=True):
                        np.multiply(form, factor, out=work)
                        np.add(by_x, work, out=by_x)
                    np.multiply(by_x, by_k_s, out=by_x)
                    np.multiply(by_x, k_s, out=by_x)
        return out.reshape(len(p), -1).T

    def chi_square(self, p: Array) -> float:
        """Sum of squared weighted residuals."""
        r = self.residuals(p)
        return float(r @ r)

    def fit(self, method: str, start: Array) -> Array:
        """Best parameters with one of `METHODS` from `start`, scipy's default tolerances."""
        algorithm, jacobian = METHODS[method]
        result = least_squares(
            self.residuals,
            start,
            jac=self.jacobian if jacobian == "by hand" else jacobian,
            method=algorithm,
            x_scale="jac",
        )
        return np.asarray(result.x, dtype=np.float64)
