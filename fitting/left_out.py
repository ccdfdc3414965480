"""How a fitted candidate predicts blocks of the measurement that it was not fitted to.

Each block is left out in turn and the candidate is fitted to the rest: Gauss-Newton from the
point of the full fit, with the noise as found there. No importance sampling (PSIS) stands in
for a refit: a refit costs milliseconds, and a block left out moves the parameters by more than
importance weights bear.

The density is that at the refit's point; the uncertainty of its parameters is not spread over
it. Against a density that is, a parameter is charged somewhat more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.blocks import Blocks
from lobefit.fitting.point import PointFit
from lobefit.fitting.polish import polish
from lobefit.fitting.robust import student_terms

__all__ = ["block_scores"]

Array = NDArray[np.float64]

# Parameters within a tenth of the polish's hundredth of a standard error change no comparison.
LOOSE = 1e-2


def block_scores(fit: PointFit, blocks: Blocks) -> Array:
    """Leave out one block at a time and predict it.

    Parameters
    ----------
    fit : PointFit
        The fit to everything; its dataset's weights are changed.
    blocks : Blocks
        What is left out.

    Returns
    -------
    ndarray, shape (B,)
        Log density of each block's values, summed (density per 1/sr); for metrics without a
        likelihood minus the sum of their squared residuals.
    """
    dataset = fit.problem.dataset
    likely = dataset.has_likelihood
    known = np.where(dataset.used, fit.weights, 0.0) if likely else 1.0 * dataset.used
    start = fit.polished
    scores = np.zeros(blocks.count)
    for k in range(blocks.count):
        out = blocks.labels == k
        dataset.set_weights(np.where(out, 0.0, known))
        found = polish(fit.problem, start.t, start.c, max(int(LOOSE * fit.dof), 1))
        predicted = fit.problem.values(found.t, found.c)
        counted = dataset.used[:, out]
        r = dataset.residuals(predicted)[:, out]
        if fit.nu is not None:
            v = fit.variance_at(predicted)[:, out]
            each = -0.5 * student_terms(r, v, fit.nu)
        elif likely:
            v = fit.variance_at(predicted)[:, out]
            each = -0.5 * (r * r / v + np.log(2.0 * np.pi * v))
        else:
            each = -r * r
        scores[k] = np.sum(each, where=counted)
    return scores
