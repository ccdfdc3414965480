"""How far a chain can be trusted: autocorrelation time, R-hat, effective sample sizes.

The autocorrelation time is the one of Goodman & Weare 2010 with the window of Sokal; R-hat and
the effective sample sizes are rank-normalised and split, after Vehtari, Gelman, Simpson,
Carpenter & Bürkner 2021. Walkers of one ensemble are no independent chains: R-hat compares
whole ensembles, which never see one another.
"""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

__all__ = ["autocorrelation_time", "bulk_ess", "r_hat", "rank_normalised", "tail_ess"]

Array = NDArray[np.float64]

# Sokal's window: the sum ends where the lag is so many times the sum.
WINDOW = 5.0
# Quantiles of the normal distribution are interpolated between so many nodes.
NODES = 2**15


def _autocovariance(x: Array) -> Array:
    """Give the autocovariance along the last axis of deviations that have no mean left."""
    n = x.shape[-1]
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(x, size)
    covariance: Array = np.fft.irfft(np.abs(spectrum) ** 2, size)[..., :n] / n
    return covariance


def autocorrelation_time(chain: Array) -> float:
    """Estimate the integrated autocorrelation time, in steps.

    Parameters
    ----------
    chain : ndarray, shape (steps, ensembles, walkers)
        Of one number. Deviations are taken from the mean of each ensemble, not of each walker,
        so that a chain too short for a walker to see the whole is not taken for a quick one.

    Returns
    -------
    float
        1 or more for most chains; NaN where nothing moved. Too small where the chain has fewer
        steps than some 50 times the result.
    """
    deviations = chain - chain.mean(axis=(0, 2), keepdims=True)
    covariance = _autocovariance(np.moveaxis(deviations, 0, -1)).mean(axis=(0, 1))
    if not covariance[0] > 0.0:
        return float("nan")
    time = 2.0 * np.cumsum(covariance / covariance[0]) - 1.0
    outside = np.arange(len(time)) >= WINDOW * time
    return float(time[int(np.argmax(outside)) if outside.any() else len(time) - 1])


def _normal_quantiles() -> Array:
    inverse = NormalDist().inv_cdf
    return np.array([inverse((k + 0.5) / NODES) for k in range(NODES)])


_TABLE: list[Array] = []


def rank_normalised(x: Array) -> Array:
    """Replace values by the normal quantiles of their ranks among all, shaped as x."""
    if not _TABLE:
        _TABLE.append(_normal_quantiles())
    flat = x.ravel()
    _, place, counts = np.unique(flat, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    share = (last - 0.5 * (counts - 1.0) - 0.375) / (flat.size + 0.25)
    z = np.interp(share, (np.arange(NODES) + 0.5) / NODES, _TABLE[0])
    # Beyond the table, where few values are, one by one.
    for k in np.flatnonzero((share < 16.0 / NODES) | (share > 1.0 - 16.0 / NODES)):
        z[k] = NormalDist().inv_cdf(float(share[k]))
    return np.asarray(z[place].reshape(x.shape))


def _split(chains: Array) -> Array:
    """Cut each chain (M, N) in two, shape (2 M, N // 2); the middle one of an odd N goes."""
    half = chains.shape[1] // 2
    return np.concatenate([chains[:, :half], chains[:, -half:]])


def _plain_r_hat(chains: Array) -> float:
    n = chains.shape[1]
    within = chains.var(axis=1, ddof=1).mean()
    between = chains.mean(axis=1).var(ddof=1)
    if not within > 0.0:
        return float("nan")
    return float(np.sqrt((n - 1.0) / n + between / within))


def r_hat(chains: Array) -> float:
    """Compute the rank-normalised split R-hat, the larger of that of place and that of scale.

    Parameters
    ----------
    chains : ndarray, shape (M, N)
        Independent chains; for ensembles all walkers' values in the order of the steps.

    Returns
    -------
    float
        1 where the halves of all chains agree; NaN where nothing moved.
    """
    halves = _split(chains)
    folded = np.abs(halves - np.median(halves))
    return float(
        np.fmax(_plain_r_hat(rank_normalised(halves)), _plain_r_hat(rank_normalised(folded)))
    )


def _ess(chains: Array) -> float:
    """Give the effective sample size of the mean, after Geyer's initial monotone sequence."""
    m, n = chains.shape
    means = chains.mean(axis=1)
    covariance = _autocovariance(chains - means[:, None]).mean(axis=0)
    within = covariance[0] * n / (n - 1.0)
    total = covariance[0] + (means.var(ddof=1) if m > 1 else 0.0)
    if not total > 0.0:
        return float("nan")
    rho = 1.0 - (within - covariance) / total
    rho[0] = 1.0
    pairs = rho[: n - n % 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs < 0.0)
    stop = int(ends[0]) if len(ends) else len(pairs)
    monotone = np.minimum.accumulate(pairs[:stop])
    time = -1.0 + 2.0 * float(monotone.sum())
    if 2 * stop < n:  # the first of the pair that ends it still counts, if positive
        time += max(float(rho[2 * stop]), 0.0)
    size = m * n
    return float(size / max(time, 1.0 / np.log10(size)))


def bulk_ess(chains: Array) -> float:
    """Compute the effective sample size for the middle of the distribution.

    Parameters
    ----------
    chains : ndarray, shape (M, N)
        Walkers or chains.
    """
    return _ess(rank_normalised(_split(chains)))


def tail_ess(chains: Array) -> float:
    """Compute the effective sample size for the 5 % and 95 % quantiles, the smaller one."""
    halves = _split(chains)
    low, high = np.quantile(halves, [0.05, 0.95])
    return float(
        np.fmin(_ess((halves <= low).astype(np.float64)), _ess((halves <= high).astype(np.float64)))
    )
