"""The rows of a measurement, as many as a page can draw."""

from __future__ import annotations

import numpy as np

from lobefit.service.task import Outcome, Task, answer
from lobefit.service.work.fitted import numbers
from lobefit.service.work.measured import stored

__all__ = ["perform"]


def perform(task: Task) -> Outcome:
    """Give the rows in degrees and 1/sr, thinned evenly where there are more than wanted."""
    m, _ = stored(task.store, task.request["measurement"])
    step = -(-m.n_directions // max(1, int(task.request.get("max_points", 20_000))))
    m_rows = slice(None, None, step)
    angles = {
        f"{name}_deg": numbers(np.rad2deg(getattr(m, name)[m_rows]))
        for name in ("theta_i", "phi_i", "theta_o", "phi_o")
    }
    return answer(
        task,
        {
            **angles,
            "channels": list(m.channels),
            "values": numbers(m.values[:, m_rows]),
            "sigma": None if m.sigma is None else numbers(m.sigma[:, m_rows]),
            "total": m.n_directions,
        },
    )
