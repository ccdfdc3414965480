"""Mirror: ideal specular reflection, seen by a detector of finite aperture.

Formula
-------
f = k_d/pi + k_s / (Omega cos_theta_o) where wo is closer than `aperture` to the mirror
direction of wi, else k_d/pi;   Omega = 2 pi (1 - cos(aperture))

Convention
----------
k_s is the reflectance: the integral of the lobe times cos_theta_o is k_s as long as the
whole cone lies above the horizon. The BRDF of an ideal mirror is infinite in one direction;
this is its mean over the solid angle Omega that a detector, centred on wo, takes in.

Domain
------
aperture from 1e-4 to 0.5 rad, the half angle of the detector as seen from the sample. It
belongs to the instrument, not to the surface, and makes the model not reciprocal: the
radiance read is divided by the cosine on the detector's side only. f jumps at the edge of
the cone: only readings on both sides of the edge bound the aperture, and the derivative
that a fit follows is that of Omega alone. The model is in no candidate set and is fitted by name.

Source
------
F. E. Nicodemus et al., Geometrical considerations and nomenclature for reflectance, NBS
Monograph 160, 1977: the BRDF of a perfect specular reflector and the biconical average.

Verified against
----------------
Quadrature about the mirror direction (k_s up to the angle where the cone reaches the
horizon), and 50-digit arithmetic.
"""

from __future__ import annotations

from lobefit.kernels.library import Lobe, Parameter, Reference
from lobefit.kernels.shared_parameters import K_S

__all__ = ["LOBE"]

LOBE = Lobe(
    name="mirror",
    title="Mirror: ideal specular reflection seen through an aperture",
    convention="reflectance: the lobe integrates to k_s",
    source="Nicodemus et al. 1977",
    energy="conserves energy for k_d + k_s <= 1",
    parameters=(
        K_S,
        Parameter(
            name="aperture",
            unit="rad",
            meaning="half angle of the detector, seen from the sample",
            bounds=(1e-4, 0.5),
            default=0.05,
            scale="log",
            nodes=64,
        ),
    ),
    coefficients=(("k_s",),),
    reciprocal=False,
    isotropic=True,
    edge="aperture",
    sets=(),
    references=(
        Reference(
            params={"k_d": 0.01, "k_s": 0.9, "aperture": 0.02},
            theta_i=30,
            phi_i=0,
            theta_o=31,
            phi_o=180,
            value=835.5706587197856,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.0, "k_s": 0.5, "aperture": 0.1},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=190,
            value=46.57258984899914,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
        Reference(
            params={"k_d": 0.1, "k_s": 0.5, "aperture": 0.1},
            theta_i=75,
            phi_i=10,
            theta_o=70,
            phi_o=195.5,
            value=0.03183098861837907,
            source="the formula in 50-digit arithmetic (mpmath)",
        ),
    ),
)
