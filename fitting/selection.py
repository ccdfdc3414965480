"""The order of the candidates: the simplest within a margin of the best comes first.

For metrics with a likelihood the measure is BIC with an effective sample size::

    BIC = (N_eff / N) (-2 ln L) + k ln N_eff

since residuals of a model that misfits are correlated along a scan and do not
count singly. N_eff is that of the candidate with the highest likelihood, the
same for all, so that BICs compare. Without a likelihood ("log", "cube_root",
"cosine_log") it is the root mean square residual of the metric.

That is the first ranking. Its leaders are then compared by how they predict what was
left out, see `lobefit.fitting.choice`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "BIC_MARGIN",
    "BIC_WINDOW",
    "RMS_MARGIN",
    "RMS_WINDOW",
    "bic",
    "leaders",
    "rank",
    "relative_change",
    "simplest",
    "sum_error",
]

Array = NDArray[np.float64]

# Kass & Raftery 1995: differences of 6 are the start of "strong" evidence.
BIC_MARGIN = 6.0
# Without a likelihood: within 5 % of the best root mean square residual.
RMS_MARGIN = 0.05
# Whoever is within this of the first is compared by prediction: beyond, the matter is settled.
BIC_WINDOW = 20.0
RMS_WINDOW = 0.15
# So many at most: each costs as many refits as there are blocks.
MOST_LEADERS = 4
# Radiance below this share of its median is dark: differences there are judged against it.
DARK = 0.05

Item = TypeVar("Item")


def bic(deviance: float, samples: int, effective: float, n_parameters: int) -> float:
    """Compute BIC from -2 ln L of all samples and the effective number of them."""
    return effective / samples * deviance + n_parameters * float(np.log(effective))


def rank(
    items: Sequence[Item], scores: Sequence[float], sizes: Sequence[int], margin: float
) -> list[Item]:
    """Order candidates.

    Parameters
    ----------
    items : sequence
        What is ranked.
    scores : sequence of float
        Lower is better.
    sizes : sequence of int
        Numbers of free parameters.
    margin : float
        Of the scores: whoever is within it of the best is as good.

    Returns
    -------
    list
        The simplest of those within the margin (at equal size the better
        score) first, then all others by score.
    """
    order = sorted(range(len(items)), key=lambda k: (scores[k], sizes[k]))
    best = scores[order[0]]
    within = [k for k in order if scores[k] <= best + margin]
    first = min(within, key=lambda k: (sizes[k], scores[k]))
    return [items[first], *(items[k] for k in order if k != first)]


def leaders(
    ranked: Sequence[int],
    scores: Sequence[float],
    sizes: Sequence[int],
    margin: float,
    window: float,
) -> tuple[list[int], list[int]]:
    """Find the few candidates whose predictions are worth comparing.

    Parameters
    ----------
    ranked : sequence of int
        Candidates in the order of `rank`.
    scores, sizes : sequence
        Of all candidates, by their number.
    margin, window : float
        Of the scores, above the first one's: what decides nothing, and what may still be.

    Returns
    -------
    rivals : list of int
        The first; simpler ones within the window, others of better score, and richer ones
        whose score is no worse than by the margin.
    onlookers : list of int
        The best of the richer ones within the window that is no rival: for the record.
    """
    first, *others = ranked
    near = [k for k in others if scores[k] <= scores[first] + window]

    def may_win(k: int) -> bool:
        if sizes[k] == sizes[first]:
            return scores[k] < scores[first]
        return sizes[k] < sizes[first] or scores[k] <= scores[first] + margin

    rivals = [k for k in near if may_win(k)][: MOST_LEADERS - 1]
    richer = [k for k in near if sizes[k] > sizes[first] and k not in rivals]
    room = MOST_LEADERS - 1 - len(rivals)
    return [first, *rivals], richer[: min(room, 1)]


def simplest(predicted: Sequence[Array], sizes: Sequence[int], scores: Sequence[float]) -> int:
    """Choose the simplest that none predicts better than, by more than one standard error.

    Parameters
    ----------
    predicted : sequence of ndarray, shape (B,)
        What each candidate scores in each block; higher is better.
    sizes, scores : sequence
        Numbers of parameters; the first ranking's scores, lower is better.

    Returns
    -------
    int
        Which candidate. The error is that of the difference of two, from the differences
        block by block. A richer candidate of the worse score needs two standard errors: half
        of the evidence is against it.
    """

    def beaten(k: int, by: int) -> bool:
        difference = predicted[by] - predicted[k]
        suspect = sizes[by] > sizes[k] and scores[by] > scores[k]
        return float(difference.sum()) > (2.0 if suspect else 1.0) * sum_error(difference)

    everyone = range(len(predicted))
    left = [k for k in everyone if not any(beaten(k, j) for j in everyone if j != k)]
    return min(left, key=lambda k: (sizes[k], scores[k]))


def sum_error(blocks: Array) -> float:
    """Give the standard error of a sum over blocks, shape (B,), from their scatter."""
    return float(np.sqrt(len(blocks) * np.var(blocks, ddof=1)))


def relative_change(
    a: Array,
    b: Array,
    cos_theta_i: Array,
    blocks: NDArray[np.intp],
    counted: NDArray[np.bool_],
) -> float:
    """Give by how much two models differ in the radiance that they predict.

    Parameters
    ----------
    a, b : ndarray, shape (C, N)
        Values of both at the measured directions, 1/sr.
    cos_theta_i : ndarray, shape (N,)
        Of those directions.
    blocks : ndarray of int, shape (N,)
        Block of each row.
    counted : ndarray of bool, shape (C, N)
        Values that are there.

    Returns
    -------
    float
        Root mean square of the relative difference of f cos_theta_i over the directions and
        channels of a block, of the block where it is largest. Where f cos_theta_i is less than
        a twentieth of its channel's median the difference is relative to that.
    """
    bright = np.abs(b) * cos_theta_i
    floor = DARK * np.median(bright, axis=1, keepdims=True)
    size = np.maximum(bright, np.maximum(floor, 1e-300))
    squares = np.where(counted, ((a - b) * cos_theta_i / size) ** 2, 0.0).sum(axis=0)
    sums = np.bincount(blocks, weights=squares)
    counts = np.bincount(blocks, weights=counted.sum(axis=0))
    return float(np.sqrt(np.max(sums / np.maximum(counts, 1.0))))
