"""Options that several lobes have in common: maskings, and Fresnel terms with what they bring."""

from __future__ import annotations

from lobefit.kernels.library import Choice, Parameter
from lobefit.kernels.shared_parameters import F0

__all__ = ["FRESNEL", "FRESNEL_CHOICES", "MASKING"]

MASKING = ("smith_correlated", "smith_separable", "v_cavity")

# Schlick's term is linear in F0; the others are not linear in what they bring.
FRESNEL_CHOICES = {
    "schlick": Choice(parameters=(F0,), factors=(("F0",), ())),
    "dielectric": Choice(
        parameters=(
            Parameter(
                name="eta",
                unit="1",
                meaning="refractive index of the dielectric, relative to the outside",
                bounds=(1.0, 100.0),
                default=1.5,
                scale="log",
                nodes=12,
            ),
        )
    ),
    "conductor": Choice(
        parameters=(
            Parameter(
                name="eta",
                unit="1",
                meaning="real part of the conductor's refractive index",
                bounds=(0.02, 20.0),
                default=1.0,
                per_channel=True,
                scale="log",
                nodes=12,
            ),
            Parameter(
                name="k",
                unit="1",
                meaning="extinction coefficient, the imaginary part of the index",
                bounds=(0.0, 40.0),
                default=4.0,
                per_channel=True,
                scale="root",
                nodes=14,
            ),
        )
    ),
    "f82": Choice(
        parameters=(
            Parameter(
                name="F0",
                unit="1",
                meaning="Fresnel reflectance at normal incidence",
                bounds=(0.0, 1.0),
                default=0.9,
                per_channel=True,
                nodes=9,
            ),
            Parameter(
                name="F82",
                unit="1",
                meaning="Fresnel reflectance at cos_theta_d = 1/7, about 82 degrees",
                bounds=(0.0, 1.0),
                default=0.9,
                per_channel=True,
                nodes=9,
            ),
        )
    ),
}
# In the order of the options; the first is the default, "none" brings nothing.
FRESNEL = ("schlick", "none", "dielectric", "conductor", "f82")
