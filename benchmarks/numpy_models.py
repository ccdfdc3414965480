"""BRDF lobes in numpy, written for speed: what a careful user would have without Lobefit.

Independent of Lobefit on purpose, so that the benchmarks can also compare results. Whatever
depends on directions only is computed once (`Geometry`); loops run over blocks of directions that
stay in the second-level cache; every elementwise call writes into a buffer allocated once
(``out=``). Blocks are not smaller, because each numpy call costs 0.3 to 0.8 microseconds, as long
as 2,000 multiplications take.

Conventions: f = k_d / pi + k_s * lobe [1/sr]; zenith angles and azimuths in radians.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

__all__ = [
    "BLOCK",
    "LOBES",
    "ExponentialLobe",
    "Geometry",
    "GgxSums",
    "GgxSumsTextbook",
    "ggx_lobe",
    "goniometer",
]

Array = NDArray[np.float64]

# 8,192 doubles are 64 KiB: the two buffers of eight such rows fill 1 MiB of second-level cache.
# From 10,000 on, OpenBLAS starts threads for a dot product, and they wait for each other.
BLOCK = 8192


@dataclass(frozen=True, eq=False, slots=True)
class Geometry:
    """Cosines and half-vector numbers of N pairs of directions, each of shape [N].

    Parameters
    ----------
    n_i, n_o : array
        Cosines of the two zenith angles.
    n_h, d_h : array
        Cosine between normal and half vector, and between half vector and either direction.
    h_x, h_y : array
        Tangential components of the unit half vector, along azimuth 0 and 90 degrees.
    """

    n_i: Array
    n_o: Array
    n_h: Array
    d_h: Array
    h_x: Array
    h_y: Array

    @classmethod
    def of(cls, theta_i: Array, phi_i: Array, theta_o: Array, phi_o: Array) -> Geometry:
        """Compute from angles in radians, arrays [N]."""
        sin_i, sin_o = np.sin(theta_i), np.sin(theta_o)
        n_i, n_o = np.cos(theta_i), np.cos(theta_o)
        h = np.stack(
            [
                sin_i * np.cos(phi_i) + sin_o * np.cos(phi_o),
                sin_i * np.sin(phi_i) + sin_o * np.sin(phi_o),
                n_i + n_o,
            ]
        )
        length = np.sqrt(np.einsum("kn,kn->n", h, h))
        h /= length
        # |i + o| = 2 cos(half the angle between them)
        return cls(n_i, n_o, h[2], length / 2, h[0], h[1])

    @property
    def tan2_h(self) -> Array:
        """Squared tangent of the half vector's zenith angle, without cancellation at the mirror."""
        return np.asarray((self.h_x**2 + self.h_y**2) / self.n_h**2)

    @property
    def schlick(self) -> Array:
        """(1 - cos theta_d)^5 of Schlick's Fresnel approximation."""
        return np.asarray((1 - self.d_h) ** 5)


def goniometer(n: int) -> tuple[Array, Array, Array, Array]:
    """Angles of a goniometer's run: 40 incidences, each with a grid of outgoing directions.

    Parameters
    ----------
    n : int
        Number of samples: 10^3, 10^4, 10^5 or 10^6.

    Returns
    -------
    tuple of array
        theta_i, phi_i, theta_o, phi_o in radians, arrays [n].
    """
    n_theta, n_phi = {10**3: (5, 5), 10**4: (10, 25), 10**5: (50, 50), 10**6: (125, 200)}[n]
    theta_i = np.radians([1.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0])
    phi_i = np.radians([0.0, 36.0, 72.0, 108.0, 144.0])
    theta_o = np.radians(np.linspace(2.0, 80.0, n_theta))
    phi_o = np.linspace(0.0, 2 * np.pi, n_phi, endpoint=False)
    grid = np.meshgrid(theta_i, phi_i, theta_o, phi_o, indexing="ij")
    return grid[0].ravel(), grid[1].ravel(), grid[2].ravel(), grid[3].ravel()


def ggx_lobe(geometry: Geometry, alpha: float) -> Array:
    """GGX D G / (4 n_i n_o) with height-correlated Smith masking, without Fresnel [1/sr].

    Formula as in the papers, to check the fast forms with and to make data.
    """
    g, a2 = geometry, alpha**2
    d = a2 / (np.pi * (g.n_h**2 * (g.tan2_h + a2)) ** 2)
    root_i = np.sqrt(g.n_i**2 + a2 * (1 - g.n_i**2))
    root_o = np.sqrt(g.n_o**2 + a2 * (1 - g.n_o**2))
    return np.asarray(d / (2 * (g.n_o * root_i + g.n_i * root_o)))


class GgxSumsTextbook:
    """Weighted sums of squared residuals of diffuse + GGX, operations in the formula's order.

    One parameter set at a time over a block of directions; 20 elementwise passes, a dot product.

    Parameters
    ----------
    geometry : Geometry
        N pairs of directions.
    values, weights : array
        Measured BRDF [1/sr] and the factors of the residuals, arrays [N].
    dtype : dtype
        Precision of everything.
    block : int
        Directions worked on at a time.
    """

    def __init__(
        self,
        geometry: Geometry,
        values: Array,
        weights: Array,
        dtype: DTypeLike = np.float64,
        block: int = BLOCK,
    ) -> None:
        g = geometry
        rows = [g.n_i, g.n_o, g.n_i**2, g.n_o**2, 1 - g.n_i**2, 1 - g.n_o**2]
        rows += [g.tan2_h, np.pi * g.n_h**4, g.schlick, values, weights]
        self._rows: NDArray[Any] = np.array(rows, dtype=dtype)
        self._buffers: NDArray[Any] = np.empty((3, block), dtype=dtype)

    def chi_square(self, k_d: Array, k_s: Array, F0: Array, alpha: Array) -> Array:
        """Sums for S parameter sets, each argument of shape [S]."""
        block = self._buffers.shape[1]
        total = np.zeros(len(alpha))
        # Python floats keep the arrays' precision and are the cheapest scalars to pass.
        sets = list(
            zip(
                (k_d / np.pi).tolist(),
                (0.5 * k_s * alpha**2).tolist(),
                F0.tolist(),
                (alpha**2).tolist(),
                strict=True,
            )
        )
        for start in range(0, self._rows.shape[1], block):
            part = self._rows[:, start : start + block]
            n_i, n_o, n_i2, n_o2, sin2_i, sin2_o, tan2_h, pi_nh4, s, value, weight = part
            a, b, c = self._buffers[:, : part.shape[1]]
            for index, (diffuse, scale, f0, a2) in enumerate(sets):
                np.multiply(sin2_i, a2, out=a)
                np.add(a, n_i2, out=a)
                np.sqrt(a, out=a)
                np.multiply(a, n_o, out=a)
                np.multiply(sin2_o, a2, out=b)
                np.add(b, n_o2, out=b)
                np.sqrt(b, out=b)
                np.multiply(b, n_i, out=b)
                np.add(a, b, out=a)
                np.add(tan2_h, a2, out=b)
                np.multiply(b, b, out=b)
                np.multiply(b, pi_nh4, out=b)
                np.multiply(a, b, out=a)
                np.multiply(s, 1 - f0, out=c)
                np.add(c, f0, out=c)
                np.multiply(c, scale, out=c)
                np.divide(c, a, out=c)
                np.add(c, diffuse, out=c)
                np.subtract(c, value, out=c)
                np.multiply(c, weight, out=c)
                total[index] += np.dot(c, c)
        return total


class GgxSums:
    """The same sums with the formula rearranged: 15 elementwise passes and a dot product.

    With t = tan(theta), n sqrt(1 + alpha² t²) is n alpha sqrt(1/alpha² + t²): a masking term is one
    addition and one root, and every factor of directions alone, the weight among them, goes into
    one array. Several sets are worked on at a time (a column of parameters against a row of
    directions), so that they share the cost of a numpy call.

    Parameters
    ----------
    geometry, values, weights, dtype, block
        As for `GgxSumsTextbook`.
    sets : int
        Parameter sets worked on at a time.
    """

    def __init__(
        self,
        geometry: Geometry,
        values: Array,
        weights: Array,
        dtype: DTypeLike = np.float64,
        block: int = BLOCK,
        sets: int = 8,
    ) -> None:
        g = geometry
        prefactor = weights / (2 * np.pi * g.n_i * g.n_o * g.n_h**4)
        rows = [1 / g.n_i**2 - 1, 1 / g.n_o**2 - 1, g.tan2_h, g.schlick]
        rows += [prefactor, weights / np.pi, weights * values]
        self._rows: NDArray[Any] = np.array(rows, dtype=dtype)
        self._buffers: NDArray[Any] = np.empty((2, sets, block), dtype=dtype)

    def chi_square(self, k_d: Array, k_s: Array, F0: Array, alpha: Array) -> Array:
        """Sums for S parameter sets, each argument of shape [S]."""
        _, sets, block = self._buffers.shape
        total = np.zeros(len(alpha))
        rows = (alpha**2, alpha**-2, k_s * alpha * (1 - F0), k_s * alpha * F0, k_d)
        columns = np.array(rows, dtype=self._rows.dtype)[:, :, None]
        for start in range(0, self._rows.shape[1], block):
            part = self._rows[:, start : start + block]
            tan2_i, tan2_o, tan2_h, s, prefactor, diffuse, value = part
            for first in range(0, len(alpha), sets):
                a2, inverse_a2, slope, offset, albedo = columns[:, first : first + sets]
                a, b = self._buffers[:, : len(a2), : part.shape[1]]
                np.add(tan2_i, inverse_a2, out=a)
                np.sqrt(a, out=a)
                np.add(tan2_o, inverse_a2, out=b)
                np.sqrt(b, out=b)
                np.add(a, b, out=a)
                np.add(tan2_h, a2, out=b)
                np.multiply(b, b, out=b)
                np.multiply(a, b, out=a)
                np.multiply(s, slope, out=b)
                np.add(b, offset, out=b)
                np.multiply(b, prefactor, out=b)
                np.divide(b, a, out=b)
                np.multiply(diffuse, albedo, out=a)
                np.add(b, a, out=b)
                np.subtract(b, value, out=b)
                total[first : first + sets] += np.vecdot(b, b)
        return total


@dataclass(frozen=True, eq=False)
class ExponentialLobe:
    """A lobe prefactor(w) * scale(x) * exp(sum_m q_m(x) Q_m(w)).

    Blinn-Phong, Beckmann and Ward are all of this form.

    Parameters
    ----------
    prefactor : array
        What depends on directions only, [N].
    forms : array
        The Q_m, [M, N].
    scale : callable
        Nonlinear parameters -> (scale, q [M]).
    gradient : callable
        Nonlinear parameters [J] -> (d ln scale / dx [J], dq/dx [J, M]).
    schlick : array or None
        The Fresnel term's (1 - cos theta_d)^5, [N], where the model has one.
    """

    prefactor: Array
    forms: Array
    scale: Callable[[Array], tuple[float, Array]]
    gradient: Callable[[Array], tuple[Array, Array]]
    schlick: Array | None = None

    def fill(self, q: Array, rows: slice, out: Array, scratch: Array) -> None:
        """Write prefactor * exp(sum q Q) of a block of directions into `out`, without the scale."""
        forms = self.forms[:, rows]
        np.multiply(forms[0], float(q[0]), out=out)
        for form, factor in zip(forms[1:], q[1:].tolist(), strict=True):
            np.multiply(form, factor, out=scratch)
            np.add(out, scratch, out=out)
        np.exp(out, out=out)
        np.multiply(out, self.prefactor[rows], out=out)


def _blinn_phong(g: Geometry) -> ExponentialLobe:
    """Lobe (n + 2) / (8 pi) (n.h)^n; x = (n)."""
    return ExponentialLobe(
        np.full_like(g.n_h, 1 / (8 * np.pi)),
        np.log(g.n_h)[None],
        lambda x: (float(x[0]) + 2, x),
        lambda x: (1 / (x + 2), np.ones((1, 1))),
    )


def _cook_torrance(g: Geometry) -> ExponentialLobe:
    """Lobe D G / (4 n_i n_o), Beckmann's D and the V-cavities' G; x = (alpha)."""
    masking = np.minimum(1.0, 2 * g.n_h * np.minimum(g.n_i, g.n_o) / g.d_h)
    return ExponentialLobe(
        masking / (4 * np.pi * g.n_i * g.n_o * g.n_h**4),
        g.tan2_h[None],
        lambda x: (float(x[0]) ** -2, -(x**-2)),
        lambda x: (-2 / x, (2 * x**-3)[:, None]),
        g.schlick,
    )


def _ward(g: Geometry) -> ExponentialLobe:
    """Ward's lobe of 1992, x = (alpha_x, alpha_y, phi_x).

    The exponent is a quadratic form in h_x / h_z and h_y / h_z.
    """
    u, v = g.h_x / g.n_h, g.h_y / g.n_h

    def scale(x: Array) -> tuple[float, Array]:
        (p, q), (c, s) = x[:2] ** -2, (np.cos(x[2]), np.sin(x[2]))
        form = [c * c * p + s * s * q, 2 * s * c * (p - q), s * s * p + c * c * q]
        return float(1 / (x[0] * x[1])), -np.array(form)

    def gradient(x: Array) -> tuple[Array, Array]:
        (p, q), (dp, dq), (c, s) = x[:2] ** -2, 2 * x[:2] ** -3, (np.cos(x[2]), np.sin(x[2]))
        turn = 2 * s * c * (p - q)
        forms = [
            [c * c * dp, 2 * s * c * dp, s * s * dp],
            [s * s * dq, -2 * s * c * dq, c * c * dq],
            [turn, -2 * (c * c - s * s) * (p - q), -turn],
        ]
        return np.array([-1 / x[0], -1 / x[1], 0.0]), np.array(forms)

    prefactor = 1 / (4 * np.pi * np.sqrt(g.n_i * g.n_o))
    return ExponentialLobe(prefactor, np.stack([u * u, u * v, v * v]), scale, gradient)


# The models of the point fit by Lobefit's names.
LOBES: dict[str, Callable[[Geometry], ExponentialLobe]] = {
    "blinn_phong": _blinn_phong,
    "cook_torrance": _cook_torrance,
    "ward": _ward,
}
