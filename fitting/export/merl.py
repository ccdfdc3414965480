"""The MERL table: any isotropic, reciprocal model, evaluated at the centres of the cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.export.fitted import Channels, Fitted
from lobefit.fitting.export.refusal import ExportError
from lobefit.fitting.merl import SHAPE, cell_directions
from lobefit.kernels.geometry import above_horizon

__all__ = ["merl_table"]


def merl_table(fitted: Fitted, tolerance: float) -> NDArray[np.float64]:
    """Tabulate a model.

    Parameters
    ----------
    fitted : Fitted
        The model.
    tolerance : float
        Not used: at the centres of the cells the table is exact.

    Returns
    -------
    ndarray, shape (3, 90, 90, 180)
        BRDF in 1/sr; NaN at and below the horizon.

    Raises
    ------
    ExportError
        The model is anisotropic or not reciprocal, or the channels are not R, G, B.
    """

    def refuse(reason: str, remedy: str) -> ExportError:
        return ExportError(fitted.candidate, "merl", reason, remedy)

    kind = Channels.named(fitted.channels).kind
    if kind not in ("grey", "rgb"):
        raise refuse(
            f"a MERL table has the channels R, G, B, and these are {', '.join(fitted.channels)}",
            "fit a measurement with the channels R,G,B, or with one channel",
        )
    if not fitted.isotropic:
        raise refuse(
            "the table has no azimuth of the surface, and the model is anisotropic",
            "fit an isotropic model, such as ggx",
        )
    if not fitted.reciprocal:
        raise refuse(
            "the table takes light and view for interchangeable, and the model is not reciprocal",
            "fit a reciprocal model; `lobefit models NAME` tells",
        )
    theta_i, theta_o, phi_o = (
        a.ravel() for a in cell_directions(*np.ix_(*(np.arange(n) for n in SHAPE)))
    )
    visible = above_horizon(theta_i, theta_o)
    table = np.full((3, visible.size), np.nan)
    table[:, visible] = fitted.evaluate(theta_i[visible], 0.0, theta_o[visible], phi_o[visible])
    return table.reshape(3, *SHAPE)
