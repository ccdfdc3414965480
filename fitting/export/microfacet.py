"""What renderers call a rough conductor: a microfacet lobe by distribution, masking, Fresnel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobefit.fitting.export.fitted import Fitted, Part
from lobefit.fitting.export.refusal import ExportError

__all__ = ["ELSEWHERE", "Microfacet", "diffuse_and_lobes"]

Array = NDArray[np.float64]

ELSEWHERE = "`--to merl` writes any isotropic reciprocal model as a table"

# Distribution, and the masking and Fresnel term of a record that leaves no choice of them.
_LOBES = {
    "ggx": ("ggx", "smith_correlated", "schlick"),
    "ggx_anisotropic": ("ggx", "smith_correlated", "schlick"),
    "beckmann": ("beckmann", "smith_correlated", "schlick"),
    "beckmann_anisotropic": ("beckmann", "smith_correlated", "schlick"),
    "cook_torrance": ("beckmann", "v_cavity", "schlick"),
}


@dataclass(frozen=True, eq=False)
class Microfacet:
    """A lobe k_s D G F / (4 cos_theta_i cos_theta_o).

    Attributes
    ----------
    distribution, masking : str
        "ggx" or "beckmann"; "smith_correlated", "smith_separable" or "v_cavity".
    fresnel : str
        "exact" with `eta` and `k`, "none" where F = 1, else the record's name of it.
    alpha_x, alpha_y, phi_x : float
        Roughness along two axes, and the azimuth of the first in radians; equal and 0 where
        the lobe is isotropic.
    k_s, eta, k : ndarray, shape (C,)
        Strength, and the index of refraction where the Fresnel term is exact.
    """

    distribution: str
    masking: str
    fresnel: str
    alpha_x: float
    alpha_y: float
    phi_x: float
    k_s: Array
    eta: Array
    k: Array

    @classmethod
    def of(cls, part: Part) -> Microfacet | None:
        """Take a term apart; None if it is another kind of lobe."""
        if part.lobe not in _LOBES:
            return None
        distribution, masking, fresnel = _LOBES[part.lobe]
        p = part.params
        fresnel = part.options.get("fresnel", fresnel)
        nothing = np.zeros_like(p["k_s"])
        eta, k = p.get("eta", nothing), p.get("k", nothing)
        if fresnel == "schlick" and np.all(p["F0"] == 1.0):
            fresnel = "none"
        elif fresnel in ("dielectric", "conductor"):
            fresnel = "exact"
        wide, narrow = p.get("alpha_x", p.get("alpha")), p.get("alpha_y", p.get("alpha"))
        if wide is None or narrow is None or np.ptp(wide) or np.ptp(narrow):
            return None
        alpha_x, alpha_y = float(wide[0]), float(narrow[0])
        phi_x = float(p["phi_x"][0]) if "phi_x" in p and alpha_x != alpha_y else 0.0
        masking = part.options.get("masking", masking)
        return cls(distribution, masking, fresnel, alpha_x, alpha_y, phi_x, p["k_s"], eta, k)

    @property
    def isotropic(self) -> bool:
        """Whether both axes are alike."""
        return self.alpha_x == self.alpha_y


def diffuse_and_lobes(
    fitted: Fitted, target: str, masking: str, distributions: tuple[str, ...]
) -> tuple[Array, list[Microfacet]]:
    """Take a model apart into Lambert's term and microfacet lobes that a target has.

    Parameters
    ----------
    fitted : Fitted
        The model.
    target : str
        For errors.
    masking : str
        The one masking that the target has.
    distributions : tuple of str
        The distributions that it has.

    Returns
    -------
    k_d : ndarray, shape (C,)
        Albedo of the diffuse term; 0 where there is none.
    lobes : list of Microfacet
        With an exact Fresnel term or none.

    Raises
    ------
    ExportError
        Another term, distribution, masking or Fresnel term, or two lobes of different axes.
    """

    def refuse(reason: str, remedy: str = ELSEWHERE) -> ExportError:
        return ExportError(fitted.candidate, target, reason, remedy)

    k_d = np.zeros(len(fitted.channels))
    lobes: list[Microfacet] = []
    for part in fitted.parts:
        if part.lobe == "lambert":
            k_d = k_d + part.params["k_d"]
            continue
        lobe = Microfacet.of(part)
        if lobe is None:
            having = ", ".join(n for n, (d, *_) in _LOBES.items() if d in distributions)
            raise refuse(
                f"{target} has no equal of {part.lobe}",
                f"fit lambert, {having} with --option masking={masking}, or: {ELSEWHERE}",
            )
        if lobe.distribution not in distributions:
            raise refuse(
                f"{target} has no {lobe.distribution} distribution",
                f"fit one of {' or '.join(distributions)}, or: {ELSEWHERE}",
            )
        if lobe.masking != masking:
            raise refuse(
                f"its masking is {lobe.masking} and that of {target} is {masking}",
                f"fit with --option masking={masking}",
            )
        if lobe.fresnel not in ("exact", "none"):
            raise refuse(
                f"{target} has no Fresnel term {lobe.fresnel}, only the exact equations",
                "fit with --option fresnel=conductor (metals), dielectric or none",
            )
        lobes.append(lobe)
    if len({lobe.phi_x for lobe in lobes if not lobe.isotropic}) > 1:
        raise refuse("its two lobes have different axes, and a surface has one tangent")
    return k_d, lobes
