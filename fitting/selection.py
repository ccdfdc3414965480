"""The order of the candidates: the simplest within a margin of the best comes first.

For metrics with a likelihood the measure is BIC with an effective sample size::

    BIC = (N_eff / N) (-2 ln L) + k ln N_eff

since residuals of a model that misfits are correlated along a scan and do not
count singly. N_eff is that of the candidate with the highest likelihood, the
same for all, so that BICs compare. Without a likelihood ("log", "cube_root") it
is the root mean square residual of the metric.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

__all__ = ["BIC_MARGIN", "RMS_MARGIN", "bic", "rank"]

# Kass & Raftery 1995: differences of 6 are the start of "strong" evidence.
BIC_MARGIN = 6.0
# Without a likelihood: within 5 % of the best root mean square residual.
RMS_MARGIN = 0.05

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
