"""Anisotropy: whether the sample was turned, and whether that, or left and right, made a difference."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.checks.finding import DataCheck
from lobefit.fitting.checks.view import View, plural, steps

__all__ = ["check_anisotropy", "differs_when_turned"]

# Differences below this, and below this many times the noise, are none.
SMALL = 0.05
NOISY = 3.0
# Left and right of the plane of incidence.
UNEVEN = 0.10
# Fewer repeats are no evidence.
FEWEST = 5


def differs_when_turned(view: View) -> tuple[bool, int, float]:
    """Tell whether turning the sample changes its values.

    Returns
    -------
    bool, int, float
        The answer, from how many repeats, and the typical difference of logarithms.
    """
    if not view.m.has_azimuthal_evidence:
        return False, 0, 0.0
    found = _spread(view, sides=False)
    typical = _typical(found)
    enough = found.size >= FEWEST
    return enough and typical > max(SMALL, NOISY * (view.noise or 0.0)), found.size, typical


def check_anisotropy(view: View) -> DataCheck:
    """Compare equal geometries of the turned sample, else left and right views."""
    noise = view.noise
    left = _spread(view, sides=True)
    figures: dict[str, Any] = {
        "turned": view.m.has_azimuthal_evidence,
        "left_right_pairs": left.size,
        "left_right_difference": _typical(left),
        "noise": noise,
    }
    answer = partial(DataCheck, name="anisotropy", figures=figures)
    if view.m.has_azimuthal_evidence:
        differs, repeats, typical = differs_when_turned(view)
        figures |= {"repeats": repeats, "turned_difference": typical}
        if repeats < FEWEST:
            return answer(
                verdict="cannot tell",
                sentence="The sample was turned, but no geometry was repeated at another azimuth.",
                remedy="repeat a scan with the sample turned by 90 degrees",
            )
        return answer(
            verdict="ok",
            sentence=f"The turned sample's values differ by {100 * typical:.2g} % "
            f"({plural(repeats, 'repeat')}): the surface is "
            f"{'anisotropic' if differs else 'isotropic'}.",
        )
    if left.size >= 10 and _typical(left) > max(NOISY * (noise or 0.0), UNEVEN):
        return answer(
            verdict="suspicious",
            sentence=f"Views left and right of the plane of incidence differ by "
            f"{100 * _typical(left):.2g} % ({plural(left.size, 'pair')}), which an isotropic, "
            "aligned sample does not.",
            remedy="a grain at an angle, a tilt, or a scene that changed: turn the sample and "
            "measure again",
        )
    return answer(
        verdict="cannot tell",
        sentence="The sample was not turned: the data fit isotropic models only, and cannot show "
        "that the surface is isotropic.",
        remedy="repeat a scan with the sample turned by 45 and 90 degrees",
    )


def _spread(view: View, *, sides: bool) -> NDArray[np.float64]:
    """Give |ln ratio| between rows of equal geometry that differ in side or azimuth."""
    m = view.m
    turn = steps(view.turn)
    a, b = steps(m.theta_i), steps(m.theta_o)
    key = (a << 40) | (b << 20) | np.abs(turn)
    if sides:
        key = key << 20 | steps(np.mod(m.phi_i, 2.0 * np.pi))
        key = np.where(a == 0, np.arange(-1, -1 - len(a), -1), key)
    else:
        key = (key << 1) | (turn < 0)
        # Along the normal there is no plane of incidence: the view's azimuth turns the sample.
        key = np.where((a == 0) & (b > 0), (1 << 62) | b, key)
        key = np.where(b == 0, np.where(a > 0, (1 << 61) | a, -1), key)
    good = np.isfinite(view.level)
    rows = np.flatnonzero(good)[np.argsort(key[good], kind="stable")]
    same = np.diff(key[rows]) == 0
    if sides:
        same &= np.sign(turn[rows[1:]]) != np.sign(turn[rows[:-1]])
    ratio: NDArray[np.float64] = np.abs(view.log_ratio(rows[1:][same], rows[:-1][same]))
    ratio *= 0.5**0.5
    return ratio


def _typical(found: NDArray[np.float64]) -> float:
    return float(1.4826 * np.median(found)) if found.size else 0.0
