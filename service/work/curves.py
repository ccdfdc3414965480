"""Measured against fitted, incidence by incidence, and the residuals over the angles."""

from __future__ import annotations

import numpy as np

from lobefit.fitting.lobes import PLANE, out_of_plane, planes_of, signed
from lobefit.service.task import Outcome, Task, answer
from lobefit.service.work.fitted import fitted, numbers, samples

__all__ = ["perform"]

MOST_CURVES = 200
MOST_ROWS = 20_000


def perform(task: Task) -> Outcome:
    """Give one curve for each incidence, theta_o signed: negative on the side of the light.

    More incidences or rows than a page can show are thinned evenly; `total` tells how many
    there are.
    """
    id = task.request["fit"]
    model, m = fitted(task.store, id, task.request.get("model")), samples(task.store, id)
    predicted = model.predict(m.theta_i, m.phi_i, m.theta_o, m.phi_o)
    turn = m.phi_o - m.phi_i
    aside = out_of_plane(m.theta_i, m.theta_o, turn)
    groups = planes_of(m, m.distinct_incidences())
    keys = list(groups)
    every = np.linspace(0, len(keys) - 1, min(len(keys), MOST_CURVES)).round().astype(int)
    step = -(-m.n_directions // MOST_ROWS)
    curves = []
    for key in (keys[k] for k in every):
        theta_i, phi_i = key
        rows = groups[key][::step]
        # At normal incidence the azimuth of the scan stands in for that of the light.
        angle = np.rad2deg(signed(m.theta_o[rows], (m.phi_o[rows] - phi_i)))
        order = np.argsort(angle, kind="stable")
        rows, angle = rows[order], angle[order]
        curves.append(
            {
                "theta_i_deg": round(float(np.rad2deg(theta_i)), 6),
                "phi_i_deg": round(float(np.rad2deg(phi_i)), 6),
                "plane": bool((aside[rows] < PLANE).all()),
                "theta_o_deg": numbers(angle),
                "phi_o_deg": numbers(np.rad2deg(m.phi_o[rows])),
                "measured": numbers(m.values[:, rows]),
                "fitted": numbers(predicted[:, rows]),
            }
        )
    rows = np.arange(0, m.n_directions, step)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = m.values[:, rows] / predicted[:, rows] - 1.0
    return answer(
        task,
        {
            "model": model.candidate,
            "channels": list(m.channels),
            "curves": curves,
            "residuals": {
                "theta_i_deg": numbers(np.rad2deg(m.theta_i[rows])),
                "theta_o_deg": numbers(np.rad2deg(signed(m.theta_o[rows], turn[rows]))),
                "relative": numbers(relative, 5),
            },
            "total": {"incidences": len(keys), "directions": m.n_directions},
        },
    )
